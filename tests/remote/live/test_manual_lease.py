"""Driving by hand from the page: who gets the wheels, who does not, and what ends it."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from tests.remote.live.test_demo_controls import Demo
from tests.remote.live.test_server import Rover, first, serving
from wayfarer.daemon.socket.protocol import Details, RequestRefused
from wayfarer.safety.manual import ManualControl, ManualSample
from wayfarer.safety.permission import Asked
from wayfarer.safety.settings import ManualSettings

LEASE = 7


class DrivenRover(Rover):
    """Gives its wheels to one client, once its checks are done."""

    def __init__(self) -> None:
        super().__init__()
        self.lease: int | None = None
        self.control = ManualControl(ManualSettings())
        self.checked = asyncio.Event()
        self.checked.set()
        self.ended = asyncio.Event()

    async def manual_begin(self, asked: Asked, driver: str) -> Details:
        self.permissions.append((asked.at_s, asked.is_there()))
        self.asked.append(("begin", driver))
        await self.checked.wait()
        if self.lease is not None:
            raise RequestRefused("another client drives the rover")
        self.lease = LEASE
        self.control.begin(now_s(), LEASE, driver)
        return {"lease": LEASE, "deadman_s": self.control.settings.deadman_s, "mode": "manual"}

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        assert lease == self.lease
        if why := self.control.take(now_s(), ManualSample(seq, forward, turn, sent_s)):
            raise RequestRefused(why)
        self.asked.append(("drive", (seq, forward, turn, sent_s)))
        return {}

    async def manual_end(self, lease: int) -> Details:
        if lease != self.lease:
            raise RequestRefused("this lease has ended")
        self.lease = None
        self.asked.append(("end", None))
        self.ended.set()
        return {}


def now_s() -> float:
    return asyncio.get_running_loop().time()


async def ask(connection: Any, do: str, **keys: object) -> dict[str, Any]:
    """Send a request, and return the reply to it."""
    dated = {"manual_begin": "asked_s", "manual_drive": "sent_s"}
    await connection.send_json({"do": do, **({dated[do]: now_s()} if do in dated else {}), **keys})
    while True:
        reply: dict[str, Any] = await first(connection, "reply")
        if reply["do"] == do:
            return reply


@pytest.fixture
def rover() -> DrivenRover:
    return DrivenRover()


def sample(seq: int, **keys: object) -> dict[str, object]:
    return {"seq": seq, "forward": 0.5, "turn": -0.25, **keys}


async def test_page_that_drives_is_told_what_it_needs_to_know_how_old_things_are(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site, site.connect() as connection:
        began = await ask(connection, "manual_begin")
        assert (began["ok"], began["deadman_s"]) == (True, ManualSettings().deadman_s)
        assert "lease" not in began
        told_s = began["t_s"]
        drove = await ask(connection, "manual_drive", **sample(1, sent_s=told_s))
        assert (drove["ok"], drove["seq"]) == (True, 1)
        assert told_s <= drove["t_s"] <= now_s()
        assert rover.asked == [("begin", "page"), ("drive", (1, 0.5, -0.25, told_s))]
        assert (await ask(connection, "manual_end"))["ok"]
        assert rover.asked[-1] == ("end", None)


async def test_wheels_are_not_had_without_the_token_or_from_an_old_page(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site:
        async with site.connect(token="") as connection:
            assert (await ask(connection, "manual_begin"))["why"].endswith("the address that wayfarer status shows")
        shown: list[object] = [now_s() - 1.1, now_s() + 5.0, None, "now", []]
        for asked_s in shown:
            async with site.connect() as connection:
                assert "old state" in (await ask(connection, "manual_begin", asked_s=asked_s))["why"], asked_s
        assert rover.asked == []


async def test_wheels_of_another_page_are_not_had_by_its_lease_its_driver_or_its_samples(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site, site.connect() as driver, site.connect() as thief:
        assert (await ask(driver, "manual_begin"))["ok"]
        assert "another client" in (await ask(thief, "manual_begin", driver="page", lease=LEASE))["why"]
        for keys in (sample(1), sample(1, lease=LEASE), sample(10**6, lease=LEASE, driver="page")):
            assert "does not drive" in (await ask(thief, "manual_drive", **keys))["why"]
        assert (await ask(thief, "manual_end", lease=LEASE))["ok"], "it has nothing to let go"
        assert [what for what, _ in rover.asked] == ["begin", "begin"]


async def test_page_that_connects_again_does_not_drive(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site:
        async with site.connect() as connection:
            await ask(connection, "manual_begin")
            assert (await ask(connection, "manual_drive", **sample(1)))["ok"]
        async with asyncio.timeout(5.0):
            await rover.ended.wait()
        async with site.connect() as connection:
            assert "does not drive" in (await ask(connection, "manual_drive", **sample(2)))["why"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"sent_s": None}, {"sent_s": "now"}, {"seq": None}, {"seq": 1.5}, {"seq": True}, {"forward": 1.01},
        {"forward": "1"}, {"turn": None}, {"turn": [[]]}, {"turn": -2},
    ],
    ids=str,
)  # fmt: skip
async def test_sample_that_is_none_does_not_reach_the_rover(rover: DrivenRover, wrong: dict[str, Any]) -> None:
    async with serving(rover=rover) as site, site.connect() as connection:
        await ask(connection, "manual_begin")
        assert not (await ask(connection, "manual_drive", **sample(1) | wrong))["ok"]
        assert [what for what, _ in rover.asked] == ["begin"]


async def test_sample_that_waited_or_is_sent_again_does_not_drive(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site, site.connect() as connection:
        await ask(connection, "manual_begin")
        assert (await ask(connection, "manual_drive", **sample(5)))["ok"]
        for why, keys in (
            ("repetition", sample(5)),
            ("repetition", sample(4)),
            ("s ago", sample(6, sent_s=now_s() - 0.31)),
            ("from the future", sample(7, sent_s=now_s() + 5.0)),
        ):
            reply = await ask(connection, "manual_drive", **keys)
            assert why in reply["why"], keys
            assert reply["seq"] == keys["seq"], "so the page knows for how long it was under way"
        assert [what for what, _ in rover.asked] == ["begin", "drive"]


async def test_stop_waits_for_no_checks_and_who_leaves_during_them_never_drives(rover: DrivenRover) -> None:
    async with serving(rover=rover) as site:
        rover.checked.clear()
        async with site.connect() as connection:
            await connection.send_json({"do": "manual_begin", "asked_s": now_s()})
            assert (await ask(connection, "hold"))["ok"]
            again = await ask(connection, "manual_begin")
            assert not again["ok"], "it is being asked for"
            assert (await ask(connection, "manual_end"))["ok"]
            rover.checked.set()
            await asyncio.sleep(0)
            assert "does not drive" in (await ask(connection, "manual_drive", **sample(1)))["why"]
        assert rover.lease is None


async def test_demo_is_not_driven(rover: DrivenRover) -> None:
    async with serving(demo=Demo(), rover=rover) as site, site.connect() as connection:
        for do in ("manual_begin", "manual_drive", "manual_end"):
            assert "a demo" in (await ask(connection, do))["why"]
        assert rover.asked == []

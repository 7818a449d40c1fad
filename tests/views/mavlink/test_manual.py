"""A station's stick: who drives, and when it must be let go first."""

from __future__ import annotations

import asyncio

import pytest
from pymavlink.dialects.v20 import common

from tests.views.mavlink.station import KEY, Encoder, Linked, linked, mode, stick
from tests.virtual import virtual
from wayfarer.config.mavlink_settings import MavlinkSettings
from wayfarer.views.mavlink.modes import MODE_AUTO, MODE_MANUAL

SIGNED = MavlinkSettings(key_file="key")


async def moves(link: Linked, *samples: tuple[int, int], every_s: float = 0.04) -> list[tuple[float, float]]:
    """What a stick that is moved so drives."""
    link.rover.driven.clear()
    link.station._stick._count = 0
    for x, y in samples:
        await link.says(stick(x, y))
        await asyncio.sleep(every_s - 0.01)
    return list(link.rover.driven)


@virtual
async def test_stick_drives_in_manual_mode_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        assert await moves(link, (0, 0), (1000, 0)) == []
        await link.says(mode(MODE_MANUAL))
        assert await moves(link, (0, 0), (1000, -500), (-1000, 1000)) == [(0.0, 0.0), (1.0, -0.5), (-1.0, 1.0)]
        await link.says(mode(MODE_AUTO))
        assert link.rover.asked == ["manual by mavlink", "end of 7", "resume"]
        assert await moves(link, (1000, 0)) == []


@virtual
async def test_stick_must_be_let_go_at_the_beginning_and_after_a_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        await link.says(mode(MODE_MANUAL))
        assert await moves(link, (1000, 0), (1000, 0)) == [(0.0, 0.0)] * 2
        assert await moves(link, (30, 0), (1000, 0)) == [(0.0, 0.0), (1.0, 0.0)]
        await asyncio.sleep(0.4)  # more than the deadman: the wheels have stopped
        assert await moves(link, (1000, 0), (0, 0), (1000, 0)) == [(0.0, 0.0), (0.0, 0.0), (1.0, 0.0)]


@virtual
async def test_messages_that_come_twice_from_others_or_with_no_such_axes_do_not_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        await link.says(mode(MODE_MANUAL))
        await moves(link, (0, 0))
        link.rover.driven.clear()
        link.station._stick._count = 0
        twice = link.encoder.frame(stick(500, 0))
        for _ in range(3):
            link.port.receive(twice)
            await asyncio.sleep(0.01)
        other = Encoder(KEY, system=254)
        await link.says(stick(1000, 0), encoder=other)
        await link.says(stick(1000, 0), encoder=Encoder())
        await link.says(stick(1000, 0, target=2), stick(0x7FFF, 0), stick(1001, 0))
        await link.says(common.MAVLink_rc_channels_override_message(1, 1, *[1900] * 8))
        assert link.rover.driven == [(0.5, 0.0)]


@virtual
async def test_manual_mode_that_somebody_ended_needs_to_be_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    async with linked(monkeypatch, SIGNED) as link:
        await link.says(mode(MODE_MANUAL))
        assert await moves(link, (0, 0), (1000, 0)) == [(0.0, 0.0), (1.0, 0.0)]
        link.log.event("manual_ended", 102.0, reason="asked to hold", mode="disarmed")
        assert await moves(link, (1000, 0), (0, 0), (1000, 0)) == []
        await link.says(mode(MODE_MANUAL))
        link.rover.refuses = "a sample of 0.4 s ago"  # the loop was held up
        await moves(link, (0, 0))
        link.rover.refuses = None
        assert await moves(link, (0, 0), (1000, 0)) == [(0.0, 0.0), (1.0, 0.0)]

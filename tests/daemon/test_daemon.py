"""A daemon on a real loop: what it leaves in its log, what ends it, and that its wheels then stay stopped."""

# ruff: noqa: ASYNC110, TID251 - a daemon lives in real time, and is polled
from __future__ import annotations

import asyncio
import errno
import json
import os
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import pytest

from tests.config.test_own_file import DRIVER
from tests.daemon.conftest import Listener
from tests.fieldlog.disks import FailingCall
from tests.kit.logs import read_log
from tests.kit.workshop import Overriding
from tests.logview.records import HEADER, drive, numbered, write
from wayfarer.commissioning.checks import Check, Finding, Inspection, system
from wayfarer.commissioning.checks.api import fail
from wayfarer.config.registry import find_driver
from wayfarer.config.rover_file import laid_over, load_rover
from wayfarer.daemon.daemon import Daemon, RoverSetup, Service, serve
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.paths import AlreadyRunning, single_daemon
from wayfarer.errors import NotResponding, WayfarerError
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.fieldlog import sink
from wayfarer.fieldlog.folders import run_folders
from wayfarer.hal import STOP, WheelCommand
from wayfarer.logview.narrator import Console
from wayfarer.run_sim import simulated_rover_setup
from wayfarer.safety.mission import RunEnd
from wayfarer.safety.settings import ManualSettings
from wayfarer.simhal.world.physics import Depth

LONG_S = 10.0

Finish = Callable[[str, str], None]


class Site:
    """A simulated rover that a daemon is to drive, and what became of both."""

    def __init__(self, folder: Path) -> None:
        self.logs, self.socket = folder / "logs", folder / "control.sock"
        self.closed = 0
        self.stops: list[float] = []
        self.checks: list[Check] = []
        self.service = Service(
            config=load_rover("sim"),
            algorithm=CATALOGUE["forest-pledge"],
            seed=7,
            make_rover=self.make_rover,
            logs=self.logs,
            socket=self.socket,
            simulated=True,
            dry_run=False,
            console=lambda write: Console("Arm it", write).show,
        )

    def make_rover(self, finish: Finish) -> RoverSetup:
        self.finish = finish
        rover_setup = simulated_rover_setup(self.service.config, Depth.DEVICE, 7, finish)
        checks = [*rover_setup.checks, *self.checks]
        motors = rover_setup.rover.motors

        def noted_halt() -> None:
            self.stops.append(time.monotonic())
            motors.halt()

        noting: Any = Overriding(motors, halt=noted_halt)
        self.rover = replace(rover_setup.rover, motors=noting)
        return replace(rover_setup, rover=self.rover, checks=checks, close_buses=self.close_buses)

    async def close_buses(self) -> None:
        self.closed += 1

    async def wheels(self) -> WheelCommand:
        told = await self.rover.motors.read_back()
        assert told is not None
        return told

    async def ask(self, do: str, **keys: object) -> dict[str, Any]:
        return await asyncio.to_thread(ask, {"do": do, **keys}, self.socket)

    def runs(self) -> int:
        return len(run_folders(self.logs))

    def log(self) -> list[dict[str, Any]]:
        return read_log(run_folders(self.logs)[-1])

    def events(self, name: str) -> list[dict[str, Any]]:
        return [record for record in self.log() if record["record"] == "event" and record["name"] == name]


class Running:
    """A daemon that runs, for ``async with``: its end is awaited, and the wheels must stand still then."""

    def __init__(self, site: Site) -> None:
        self.site = site

    async def __aenter__(self) -> Running:
        before = self.site.runs()
        self.site.socket.unlink(missing_ok=True)  # as ``single_daemon`` does
        self._run = asyncio.create_task(Daemon(self.site.service).run())
        await self.until(lambda: self.site.runs() > before and any(each.get("heading_deg") for each in self.site.log()))
        return self

    async def __aexit__(self, kind: object, error: object, where: object) -> None:
        if error is not None:
            self._run.cancel()

    async def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds, or the daemon has ended."""
        async with asyncio.timeout(LONG_S):
            while not self._run.done() and not holds():
                await asyncio.sleep(0.01)

    async def drives(self) -> None:
        await self.site.ask("arm", heading_deg=0.0)
        async with asyncio.timeout(LONG_S):
            while await self.site.wheels() == STOP:
                await asyncio.sleep(0.01)

    async def stop(self) -> RunEnd:
        await self.site.ask("stop")
        return await self.end()

    async def end(self) -> RunEnd:
        async with asyncio.timeout(LONG_S):
            try:
                return await self._run
            finally:
                assert await self.site.wheels() == STOP


@pytest.fixture
def site(monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:  # a socket's path must be short
        for name in ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"):
            monkeypatch.delenv(name, raising=False)
        monkeypatch.setenv("XDG_STATE_HOME", folder)
        yield Site(Path(folder))


async def test_log_begins_with_what_runs_and_ends_with_how_it_ended(site: Site) -> None:
    async with Running(site) as daemon:
        site.finish("escaped", "the simulated rover has escaped after 3.0 m")
        assert await daemon.end() == RunEnd("escaped", "the simulated rover has escaped after 3.0 m")
    first, *_, last = site.log()
    told = {key: first[key] for key in ("record", "rover", "algorithm", "seed", "simulated", "dry_run")}
    assert told == {
        "record": "run", "rover": "sim", "algorithm": "forest-pledge", "seed": 7, "simulated": True, "dry_run": False,
    }  # fmt: skip
    assert first["parts"]["compass"] == "simulated compass"
    assert first["config"]["vehicle"]["max_speed_m_s"] == site.service.config.vehicle.max_speed_m_s
    assert (last["record"], last["reason"]) == ("outcome", "escaped")
    assert site.closed == 1


async def test_log_is_named_so_that_it_is_found_from_any_folder(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(site.logs.parent)
    site.service = replace(site.service, logs=Path("logs"))
    async with Running(site) as daemon:
        told = (await site.ask("status"))["log"]
        stopped = await site.ask("stop")
        await daemon.end()
    assert Path(told) == run_folders(site.logs)[-1]
    assert stopped["log"] == site.log()[0]["log"] == told


async def test_log_in_a_folder_whose_name_is_no_text_is_written(site: Site) -> None:
    site.logs = Path(os.fsdecode(bytes(site.logs) + b"\xff"))
    site.service = replace(site.service, logs=site.logs)
    async with Running(site) as daemon:
        assert "\ufffd" in (await site.ask("status"))["log"]
        await daemon.stop()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1])
async def test_signal_stops_the_wheels_at_once_and_ends_the_run_in_order(site: Site, number: signal.Signals) -> None:
    signal.signal(number, signal.SIG_DFL)  # it may be ignored where these tests run
    async with Running(site) as daemon:
        await daemon.drives()
        before = len(site.stops)  # on a busy computer the stall guard has stopped them once already
        os.kill(os.getpid(), number)
        await daemon.until(lambda: len(site.stops) > before)
        assert await site.wheels() == STOP
        assert await daemon.end() == RunEnd("signal", f"ended by {number.name}")
    assert site.log()[-1]["reason"] == "signal"


async def test_hangup_that_is_ignored_ends_nothing(site: Site) -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        async with Running(site) as daemon:
            await daemon.drives()
            os.kill(os.getpid(), signal.SIGHUP)
            assert (await site.ask("status"))["mode"] == "armed"
            assert (await daemon.stop()).reason == "requested"
    finally:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


async def test_loop_that_stands_still_has_its_wheels_stopped_meanwhile(site: Site) -> None:
    async with Running(site) as daemon:
        await daemon.drives()
        began_s = time.monotonic()
        time.sleep(0.5)  # noqa: ASYNC251 - the bug that is guarded against
        assert site.stops, "nobody stopped the wheels"
        assert site.stops[0] - began_s < 0.45
        await daemon.until(lambda: bool(site.events("loop_stalled")))
        await daemon.stop()
    (told,) = site.events("loop_stalled")
    assert told["stall_s"] >= 0.4
    assert told["where"].startswith("daemon/test_daemon.py:"), told
    assert "test_loop_that_stands_still" in told["where"].split(" < ")[0]


async def test_person_drives_over_the_socket_until_the_loop_stands_still_and_must_then_let_go(site: Site) -> None:
    """The client and the daemon, both real; the stall guard stops a person as well."""
    by_hand = ManualSettings(allowed=True)
    site.service = replace(site.service, config=site.service.config.model_copy(update={"manual": by_hand}))
    async with Running(site) as daemon:
        lease = (await asyncio.to_thread(ask, {"do": "manual_begin", "driver": "page"}, site.socket))["lease"]
        seq = 0

        async def press(forward: float) -> dict[str, Any]:
            nonlocal seq
            seq += 1
            sample = {"lease": lease, "seq": seq, "forward": forward, "turn": 0.0}
            sent_s = time.clock_gettime(time.CLOCK_BOOTTIME)
            told = await asyncio.to_thread(ask, {"do": "manual_drive", "sent_s": sent_s, **sample}, site.socket)
            await asyncio.sleep(0.05)
            return told

        for forward in (0.0, 0.0, 0.0, *[0.5] * 6):
            await press(forward)
        assert (await site.wheels()).left > 0.1
        halted = len(site.stops)
        time.sleep(0.5)  # noqa: ASYNC251 - a bug blocks the loop
        assert len(site.stops) > halted
        told = [await press(0.5) for _ in range(4)]
        assert told[-1] == {"wheels": [0.0, 0.0], "why_not": "let go of keys and stick first"}
        assert await site.wheels() == STOP
        await asyncio.sleep(0.1)
        await daemon.stop()


async def test_settings_of_two_runs_are_told_apart_by_their_hash(site: Site) -> None:
    hashes = []
    for control_hz in (20.0, 20.0, 25.0):
        site.service = replace(site.service, config=site.service.config.model_copy(update={"control_hz": control_hz}))
        async with Running(site) as daemon:
            await daemon.stop()
        hashes.append(site.log()[0]["config_hash"])
        assert site.events("unclean_shutdown") == [], "the run before was ended in order"
    assert hashes[0] == hashes[1] != hashes[2]
    assert all(len(bytes.fromhex(each)) == 8 for each in hashes)


# -- the run before ----------------------------------------------------------------------------------------------------


async def test_mission_that_was_cut_off_is_told_by_the_next_run_which_stands_disarmed(
    site: Site, capfd: pytest.CaptureFixture[str]
) -> None:
    site.logs.mkdir()
    cut_off = {"run": "00016-20261121T061405Z", "armed_t_wall": 1.795e9}
    (site.logs / ".last_mission.json").write_text(json.dumps(cut_off), encoding="utf-8")
    async with Running(site) as daemon:
        status = await site.ask("status")
        assert (status["mode"], status["last_mission"]["mission_ended"]) == ("disarmed", None)
        await daemon.stop()
    (told,) = site.events("unclean_shutdown")
    assert (told["last_run"], told["armed_t_wall"]) == tuple(cut_off.values())
    assert f"(run {cut_off['run']}) was cut off: killed, or without power" in capfd.readouterr().err


async def test_next_run_tells_how_the_last_mission_ended(site: Site, capfd: pytest.CaptureFixture[str]) -> None:
    """In its log, in the status, on stderr, and on the light."""
    site.service = replace(
        site.service,
        config=laid_over(site.service.config, {"safety": {"mission_distance_m": 1.0, "start_delay_s": 0.0}}),
    )
    async with Running(site) as daemon:
        await daemon.drives()
        await daemon.until(lambda: bool(site.events("mission_ended")))
        assert (await site.ask("status"))["why_disarmed"] == "mission_distance"
        await daemon.stop()
    first = run_folders(site.logs)[-1].name
    async with Running(site) as daemon:
        told = (await site.ask("status"))["last_mission"]
        await daemon.stop()
    (event,) = site.events("last_mission")
    assert (told["run"], told["mission_ended"]) == (first, "mission_distance")
    assert told["mission_m"] == event["mission_m"] == pytest.approx(1.0, abs=0.1)
    assert f" (run {first}) is over after " in capfd.readouterr().err


async def test_mission_that_a_stop_of_the_daemon_ends_is_told_to_its_last_tick(site: Site) -> None:
    async with Running(site) as daemon:
        await daemon.drives()
        await asyncio.sleep(0.4)
        await daemon.stop()
    records = [record for record in site.log() if record["record"] in {"event", "outcome"}]
    assert [record.get("name") for record in records[-2:]] == ["mission_ended", None]
    last = max(record["t_s"] for record in site.log() if record["record"] == "tick")
    (armed,), (ended,) = site.events("armed"), site.events("mission_ended")
    assert ended["mission_s"] == pytest.approx(last - armed["t_s"], abs=0.1)
    assert ended["mission_s"] > 0.0
    assert ended["mission_ended"] == "requested"
    assert json.loads((site.logs / ".last_mission.json").read_bytes())["mission_ended"] == "requested"


async def test_file_of_the_last_mission_that_cannot_be_read_is_told_and_stops_no_daemon(
    site: Site, capfd: pytest.CaptureFixture[str]
) -> None:
    site.logs.mkdir()
    os.mkfifo(site.logs / ".last_mission.json")
    async with Running(site) as daemon:
        assert (await site.ask("status"))["last_mission"] is None
        await daemon.stop()
    assert ".last_mission.json: the last mission cannot be read: it is a pipe" in capfd.readouterr().err


async def test_mark_keeps_its_run_and_no_other_is_asked_to(site: Site) -> None:
    async with Running(site) as daemon:
        keep = run_folders(site.logs)[-1] / "keep"
        await site.ask("status")
        assert not keep.exists()
        await site.ask("mark", text="a log across the way")
        await daemon.until(keep.exists)
        await daemon.stop()


# -- disk and power ----------------------------------------------------------------------------------------------------


async def test_disk_that_takes_no_records_lets_the_rover_drive_on_and_refuses_the_next_arming(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is told of other errors is in ``tests/fieldlog/test_sink_on_bad_disks.py``."""
    async with Running(site) as daemon:
        await daemon.drives()
        disk = FailingCall(monkeypatch, "fdatasync", errno.ENOSPC)
        disk.failures, broke_s = 10**9, time.monotonic()
        while not (await site.ask("status"))["log_dropped"]:
            await asyncio.sleep(0.05)
            assert time.monotonic() - broke_s < LONG_S
        assert time.monotonic() - broke_s < 1.5, "a second, and this machine's patience"
        assert (await site.ask("status"))["mode"] == "armed"
        assert await site.wheels() != STOP
        await site.ask("disarm")
        with pytest.raises(WayfarerError, match=r"not armed: log: .*cannot be written: .*delete old runs.*a second"):
            await site.ask("arm", heading_deg=0.0)
        disk.failures = 0
        await asyncio.sleep(2.5)
        await daemon.drives()
        await daemon.stop()


@pytest.mark.parametrize(
    ("ill", "told"), [("read-only", "Read-only file system"), ("hung", "the disk does not answer")]
)
async def test_daemon_starts_whatever_the_disk_drives_only_if_told_to_and_logs_as_soon_as_it_can(
    site: Site, monkeypatch: pytest.MonkeyPatch, ill: str, told: str
) -> None:
    real, well = os.mkdir, Event()

    def mkdir(path: Any, *more: Any, **keys: Any) -> None:
        if (Path(path).is_relative_to(site.logs) or keys) and not well.is_set():
            if ill == "read-only":
                raise OSError(errno.EROFS, os.strerror(errno.EROFS))
            assert well.wait(LONG_S)
        real(path, *more, **keys)

    monkeypatch.setattr(os, "mkdir", mkdir)
    monkeypatch.setattr(sink, "SILENT_S", 0.1)
    run = asyncio.create_task(Daemon(site.service).run())
    async with asyncio.timeout(LONG_S):
        while not site.socket.exists() or not (status := await site.ask("status")).get("heading_deg"):
            await asyncio.sleep(0.05)
    assert told in status["log_trouble"]
    with pytest.raises(WayfarerError, match=rf"not armed: log: .*{told}.*: wayfarer arm --without-log"):
        await site.ask("arm", heading_deg=0.0)
    answer = await site.ask("arm", heading_deg=0.0, without_log=True)
    assert any(told in warning for warning in answer["warnings"])
    async with asyncio.timeout(LONG_S):
        while await site.wheels() == STOP:
            await asyncio.sleep(0.01)
        well.set()
        while (await site.ask("status"))["log_trouble"]:
            await asyncio.sleep(0.05)
    await site.ask("stop")
    await run
    header, *records, end = site.log()
    assert (header["part"], end["record"], end["dropped"]) == (1, "outcome", 0)
    assert [record["n"] for record in (*records, end)] == list(range(1, end["n"] + 1)), "they have waited for the disk"


async def test_old_runs_are_deleted_at_the_start_where_the_rover_file_says_so(site: Site) -> None:
    for number in (1, 2):
        before = site.logs / f"{number:05d}-20261101T000000Z"
        write(before, numbered([HEADER, *drive(0.0, 1.0)]))
        os.truncate(before / "run.00001.jsonl", 9_000_000)
    log = replace(site.service.config.log, keep_mb=10)
    site.service = replace(site.service, config=site.service.config.model_copy(update={"log": log}))
    run = asyncio.create_task(Daemon(site.service).run())
    async with asyncio.timeout(LONG_S):
        while not site.events("runs_deleted"):
            await asyncio.sleep(0.05)
    assert (await site.ask("status"))["runs_deleted"] == 1
    await site.ask("stop")
    await run
    assert site.events("runs_deleted")[0]["runs"] == ["00001-20261101T000000Z"]
    assert [run.name[:5] for run in run_folders(site.logs)] == ["00002", "00003"]


async def test_low_voltage_of_the_computer_is_noticed_within_a_second(
    site: Site, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    flags = tmp_path / "get_throttled"
    monkeypatch.setattr(system, "THROTTLED", str(flags))
    async with Running(site) as daemon:
        flags.write_text("50005\n", encoding="ascii")
        async with asyncio.timeout(1.5):  # a second, and this machine's patience
            while "undervoltage" not in (await site.ask("status"))["conditions"]:
                await asyncio.sleep(0.05)
        await daemon.stop()
    (told,) = site.events("power")
    assert (told["flags"], told["text"].split(",")[0]) == ("0x50005", "The computer's supply: under-voltage now")


async def test_check_of_the_rover_setup_that_fails_refuses_arming(site: Site) -> None:
    async def mount(_: Inspection) -> Finding:
        return fail("mount", "the compass is loose", "tighten it")

    site.checks.append(mount)
    async with Running(site) as daemon:
        with pytest.raises(WayfarerError, match=r"not armed: mount: the compass is loose \(tighten it\)"):
            await site.ask("arm", heading_deg=0.0)
        await daemon.stop()


async def test_dry_run_does_everything_but_turn_the_wheels(site: Site) -> None:
    site.service = replace(site.service, dry_run=True)
    async with Running(site) as daemon:
        await site.ask("arm", heading_deg=0.0)
        await daemon.until(lambda: any(record.get("wanted_left") for record in site.log()))
        assert await site.wheels() == STOP
        await daemon.stop()


async def test_systemd_is_told_when_it_is_up_that_it_lives_and_when_it_stops(
    site: Site, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", listener.socket.getsockname())
    monkeypatch.setenv("WATCHDOG_USEC", "80000")
    told: list[str] = []

    def heard(message: str) -> bool:
        told.extend(listener.heard())
        return message in told

    async with Running(site) as daemon:
        await daemon.until(lambda: heard("WATCHDOG=1"))
        site.finish("over", "the test is over")
        await daemon.end()
    assert heard("STOPPING=1")
    assert told[0] == "READY=1"
    assert told.index("WATCHDOG=1") < told.index("STOPPING=1")


# -- serve: one daemon, and errors for people --------------------------------------------------------------------------


def test_second_daemon_leaves_the_first_alone(site: Site) -> None:
    with single_daemon(site.socket), pytest.raises(AlreadyRunning):
        serve(site.service)
    assert not site.logs.exists(), "a run that never was leaves no log"


def test_part_that_does_not_open_is_named_and_everything_is_let_go(site: Site) -> None:
    make_rover = site.make_rover

    def make_broken(finish: Finish) -> RoverSetup:
        rover_setup = make_rover(finish)

        async def fail() -> None:
            raise NotResponding("CMPS14 at 0x60 on /dev/i2c-1: no answer")

        broken: Any = Overriding(rover_setup.rover.compass, open=fail)
        return replace(rover_setup, rover=replace(rover_setup.rover, compass=broken))

    site.service = replace(site.service, make_rover=make_broken)
    with pytest.raises(NotResponding, match="CMPS14 at 0x60"):
        serve(site.service)
    assert site.closed == 1
    assert site.log()[-1]["reason"] == "failed"
    with single_daemon(site.socket):
        pass  # the socket is free again


def test_mistake_in_a_file_of_one_s_own_ends_the_run_with_its_line(site: Site, tmp_path: Path) -> None:
    (file := tmp_path / "needle.py").write_text(
        DRIVER.replace("async def open(self): ...", "async def open(self): self.x")
    )
    make_rover, needle = site.make_rover, find_driver(str(file))

    def make_own(finish: Finish) -> RoverSetup:
        rover_setup = make_rover(finish)
        return replace(rover_setup, rover=replace(rover_setup.rover, compass=needle(None, None)))

    site.service = replace(site.service, make_rover=make_own)
    with pytest.raises(WayfarerError, match=r"ended the run: needle\.py:12: AttributeError: 'Needle' object") as ended:
        serve(site.service)
    assert "\n" not in str(ended.value)
    assert site.log()[-1]["reason"] == "failed"

"""A USB serial adapter that is pulled out and plugged in again never drives on by itself (fault 54)."""

from __future__ import annotations

import errno
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from tests.control.bench import Bench
from wayfarer.control.modes import Mode
from wayfarer.drivers.sabertooth import Sabertooth, SabertoothSettings
from wayfarer.drivers.threaded import ThreadedSerial

BY_ID = "/dev/serial/by-id/usb-adapter"
TIMEOUT_COMMAND = 14  # serial timeout, in tenths of a second


class Adapter:
    """A port under a name that stays the same; ``writes`` are what came out of it since it was opened last."""

    def __init__(self) -> None:
        self.plugged = True
        self.opened = 0
        self.writes: list[bytes] = []

    def open(self) -> Adapter:
        if not self.plugged:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory", BY_ID)
        self.opened += 1
        self.writes.clear()
        return self

    def write(self, data: bytes) -> None:
        if not self.plugged:
            raise OSError(errno.EIO, "Input/output error")
        self.writes.append(data)

    def forget_input(self) -> None: ...

    def read(self, _count: int, _wait_s: float) -> bytes:
        return b""

    def close(self) -> None: ...

    def packets(self) -> list[tuple[int, int]]:
        """Command and data of each packet."""
        sent = b"".join(self.writes)
        return [(sent[at + 1], sent[at + 2]) for at in range(0, len(sent), 4)]

    @property
    def turns(self) -> bool:
        """Whether any motor was told to turn."""
        return any(data for command, data in self.packets() if command != TIMEOUT_COMMAND)


async def test_adapter_that_comes_back_gets_zeros_until_the_board_was_opened_again() -> None:
    adapter = Adapter()
    port = ThreadedSerial(BY_ID, adapter.open, deadline_s=10.0)  # no deadline of a busy computer ends a transfer
    buses: Any = SimpleNamespace(serial=lambda _name, baud: port)
    motors = Sabertooth(SabertoothSettings(port=BY_ID), buses)
    await motors.open()
    bench = Bench(wheels=motors)
    await bench.tick()
    bench.controller.arm(bench.t_s, 0.0)
    await bench.tick(5)
    assert adapter.turns

    adapter.plugged = False
    await bench.tick(2)
    assert bench.controller.waits_for_motors
    (failed,) = bench.log.named("motors_failed")
    assert BY_ID in failed["error"]
    await bench.tick(20)

    adapter.plugged = True
    await bench.tick(40)
    assert adapter.opened == 2, "its name is the same, and so it is found again"
    assert adapter.writes
    assert not adapter.turns, "what waited for it is no motion"
    assert bench.controller.mode is Mode.ARMED

    await motors.open()
    bench.controller.motors_opened(bench.t_s)
    await bench.tick(25)  # the warning, and then it drives
    assert adapter.turns
    assert (TIMEOUT_COMMAND, 3) in adapter.packets(), "it has its deadman before it turns"
    motors.halt()
    await port.close()


def test_port_is_named_by_its_adapter_and_not_by_a_number() -> None:
    """What ``/dev/ttyUSB0`` is depends on what else is plugged in: shipped rovers and examples never use it."""
    root = Path(__file__).resolve().parents[1]
    files = [*root.glob("wayfarer/rovers/*.toml"), *root.glob("examples/**/*.toml")]
    assert files
    assert [file.name for file in files if "ttyUSB" in file.read_text(encoding="utf-8")] == []

"""The interface of a check: it examines one thing and returns one finding, with likely cause and remedy.

The same checks run twice: for a person (``wayfarer check``), who may have wired the rover a minute ago, and before each
arming, inside the daemon. They differ in what is open already and in where a reading comes from; ``Inspection`` is
given both.
"""

from __future__ import annotations

import os
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from wayfarer.config.calibration_file import Calibration, calibration_file
from wayfarer.config.own_file import own_mistake
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import DriverError, kind_and_text
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.hal import Rover


class CheckVerdict(StrEnum):
    """How a check ended; only ``fail`` keeps a rover from being armed."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"
    SKIPPED = "skipped"


class Finding(NamedTuple):
    """What a check found, in one line, with the likely cause; ``remedy`` is empty if nothing is wrong."""

    name: str
    verdict: CheckVerdict
    text: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class HostEnvironment:
    """Where the rover's software runs, and when.

    Attributes:
        log_folder: where runs are logged; it need not exist yet.
        calibration_file: see ``wayfarer.config.calibration_file``.
        devices: the device files that the rover's parts use, such as ``/dev/i2c-1``.
        t_wall: the wall clock in seconds since 1970.
        root: what all system files are looked up under.
    """

    log_folder: Path
    calibration_file: Path
    devices: tuple[str, ...]
    t_wall: float
    root: Path = Path("/")

    @classmethod
    def here(cls, log_folder: Path, devices: tuple[str, ...] = (), t_s: float = 0.0) -> HostEnvironment:
        """Return this computer with this user's calibration file; ``t_s`` is the time of the loop."""
        return cls(log_folder, calibration_file(os.environ, Path.home()), devices, wall_clock(t_s))

    def path(self, absolute: str) -> Path:
        """Return a system file by its absolute path."""
        return self.root / absolute.lstrip("/")


class Inspection:
    """What checks may look at. They speak to parts through it only, and none of its methods turns a wheel.

    A part is opened once, when it is first needed; if it does not open, each request raises the same error. Leaving the
    context stops the wheels and closes what was opened here. ``unusable`` has the device files of which a finding has
    said already that they cannot be used.

    Args:
        config: the rover file.
        rover: the parts: for their names, and for the motors once a person has agreed to motion.
        host: files, clock and device files.
        calibration: what is in the calibration file.
        read: gives a fresh reading of an open sensor, by its name in ``hal.Rover``; without it the sensor is asked.
        opened: which parts were opened by somebody else, and with which error; None if it opened.
    """

    def __init__(
        self,
        config: RoverConfig,
        rover: Rover,
        host: HostEnvironment,
        calibration: Calibration,
        read: Callable[[str], Awaitable[Any]] | None = None,
        opened: Mapping[str, DriverError | None] | None = None,
    ) -> None:
        self.config = config
        self.rover = rover
        self.host = host
        self.calibration = calibration
        self.unusable: set[str] = set()
        self._read = read
        self._tried = dict(opened or {})
        self._ours: list[str] = []

    async def __aenter__(self) -> Self:
        """Open nothing yet."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop the wheels, if the motors were opened here, and close what was."""
        if "motors" in self._ours:
            await self.rover.motors.stop()
        for name in self._ours:
            await self.rover.parts[name].close()

    async def open(self, name: str) -> None:
        """Make sure that a part of the rover (a member of ``hal.Rover``) is open.

        Raises:
            DriverError: it does not open.
        """
        if name not in self._tried:
            self._tried[name] = None
            self._ours.append(name)
            try:
                await self.rover.parts[name].open()
            except DriverError as error:
                self._tried[name] = error
        if (failed := self._tried[name]) is not None:
            raise failed

    async def read(self, name: str) -> Any:
        """Return a fresh reading of a sensor that the rover has, such as ``compass``.

        Raises:
            DriverError: it does not open, or gives none.
        """
        await self.open(name)
        return await (self.rover.parts[name].read() if self._read is None else self._read(name))  # type: ignore[attr-defined]


Ask = Callable[[str], Awaitable[bool]]
"""Asks a person a question of yes or no."""

Check = Callable[[Inspection], Awaitable[Finding]]


def ok(name: str, text: str) -> Finding:
    """Return that all is well."""
    return Finding(name, CheckVerdict.OK, text)


def skipped(name: str, why: str) -> Finding:
    """Return that this could not be looked at, or need not be."""
    return Finding(name, CheckVerdict.SKIPPED, why)


def warn(name: str, text: str, remedy: str) -> Finding:
    """Return something to be put right, which does not keep the rover from driving."""
    return Finding(name, CheckVerdict.WARN, text, remedy)


def fail(name: str, text: str, remedy: str) -> Finding:
    """Return something that must be put right before the rover may drive."""
    return Finding(name, CheckVerdict.FAIL, text, remedy)


def passed(findings: Iterable[Finding]) -> bool:
    """Return whether nothing failed: the rover may be armed."""
    return all(finding.verdict is not CheckVerdict.FAIL for finding in findings)


async def run_checks(inspection: Inspection, checks: Iterable[Check]) -> list[Finding]:
    """Return what each check found, in their order; one that breaks is itself a finding."""
    return [await _run(check, inspection) for check in checks]


async def _run(check: Check, inspection: Inspection) -> Finding:
    try:
        return await check(inspection)
    except Exception as error:  # a third party's driver; arming must be refused, not the daemon ended
        name = getattr(check, "__name__", "check").replace("_", " ")
        if mistake := own_mistake(error):
            return fail(name, mistake, "correct that and run it again")
        return fail(
            name, f"{kind_and_text(error)}: an error in a driver or in wayfarer itself", "report it with this text"
        )

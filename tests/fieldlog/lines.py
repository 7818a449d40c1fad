"""Logs whose lines are as short as they can be, and what they say when they are read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from wayfarer.config.rover_file import LogSettings
from wayfarer.control.tick import TickRecord
from wayfarer.fieldlog.reader import RunReader, log_segments
from wayfarer.fieldlog.record import SCHEMA, AnyRecord, Event, Header, Tick, encode
from wayfarer.fieldlog.sink import Sink

FREE = LogSettings(free_mb=0.0)
SMALL = LogSettings(part_mb=0.001, run_mb=1.0, free_mb=0.0)  # about ten ticks a part


def header(part: int) -> bytes:
    """Return the first line of a part."""
    return encode(Header(schema=SCHEMA, part=part, t_s=0.0, t_wall=0.0, rover="Wühlmaus"))


def tick(number: int) -> bytes:
    """Return the line of a control tick, 20 a second."""
    stands: dict[str, Any] = dict.fromkeys(("wanted_left", "wanted_right", "applied_left", "applied_right"), 0.0)
    return encode(Tick(n=number, t_s=number / 20, t_wall=1e9, phase="halt", why="größe", **stands))


def standing(t_s: float = 1.0, memory: Callable[[], Mapping[str, float | str]] = dict) -> TickRecord:
    """Return a control tick of a rover that stands and whose sensors are silent."""
    record = TickRecord(t_s)
    record.memory = memory
    return record


def event(number: int) -> bytes:
    """Return the line of something that happened."""
    return encode(Event(n=number, t_s=number / 20, t_wall=1e9, name="mark", text="Mark: here"))


def read(run: Path) -> tuple[list[AnyRecord], RunReader]:
    """Return the records of a run and the reader that knows its damage."""
    reader = RunReader(run)
    return list(reader), reader


def numbers(run: Path) -> list[int]:
    """Return the numbers of the records of a run, in their order."""
    return [record.n for record in RunReader(run) if record.n]


class Log:
    """The sink of a run that writes in the caller's thread, and what a person was told."""

    def __init__(self, folder: Path, limits: LogSettings = FREE) -> None:
        self.told: list[str] = []
        self.folder = folder
        self.sink = Sink(folder, limits, self.told.append)
        self.sink.open(header)

    def put(self, *numbers: int) -> None:
        """Write ticks."""
        for number in numbers:
            self.sink.put(tick(number))

    def write(self, *numbers: int) -> None:
        """Write events, each of which is written at once."""
        for number in numbers:
            self.sink.put(event(number), urgent=True)

    def parts(self) -> list[int]:
        """Return the numbers of its files."""
        return [int(part.name.split(".")[1]) for part in log_segments(self.folder)]

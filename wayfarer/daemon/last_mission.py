"""The last mission: counted while it goes on, kept beside the logs, and printed at the daemon's next start.

``.last_mission.json`` in the folder of all runs is written at arming and at the mission's end, whole, so a power cut
leaves the old one or the new one. One that has no end was cut off: by a power cut, or by the death of the process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar

import msgspec
from annotated_types import Interval, MaxLen
from pydantic import ConfigDict, TypeAdapter, ValidationError

from wayfarer.control.run_log import RunLog
from wayfarer.control.status_light import LastEnd
from wayfarer.control.tick import TickRecord
from wayfarer.errors import BadInput
from wayfarer.escape.api import Anomaly, Phase
from wayfarer.fieldlog.clock import WallClock, local_time, wall_clock
from wayfarer.fieldlog.folders import error_advice
from wayfarer.files import read_own, write_atomically
from wayfarer.vocabulary import disarmed_text
from wayfarer.waiting_thread import OneCall

FILE_NAME = ".last_mission.json"  # hidden, so that a shell's field_logs/* is all runs and nothing else
MOST_BYTES = 10_000  # a hundred times what there is to say
CLOSE_S = 1.0  # how long the end of a run waits for the disk
OUT = {"mission_radius", "escaped", "left_bounds"}  # ends of a rover that has left the wood
_STRICT = ConfigDict(extra="forbid", strict=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class LastMission:
    """A mission in a few words.

    Attributes:
        run: the name of its run's folder.
        armed_t_wall: when it was armed, seconds since 1970, by the computer's clock.
        mission_s: how long it was.
        mission_m: how far the rover was commanded, in metres.
        mission_anomalies: how many anomalies there were.
        mission_ended: why the rover was disarmed, or the run ended; None if it was cut off. Then the three before
            are not known.
    """

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    run: Annotated[str, MaxLen(255)]
    armed_t_wall: Annotated[float, Interval(ge=0, le=1e11)]
    mission_s: Annotated[float, Interval(ge=0, le=1e9)] | None = None
    mission_m: Annotated[float, Interval(ge=-1e9, le=1e9)] | None = None
    mission_anomalies: Annotated[int, Interval(ge=0)] | None = None
    mission_ended: Annotated[str, MaxLen(1000)] | None = None

    @property
    def how(self) -> str:
        """How it ended, as a clause behind "the mission"."""
        if self.mission_ended is None:
            return "was cut off: killed, or without power"
        told = [
            f"{self.mission_s:.0f} s" if self.mission_s else "",
            f"{self.mission_m:.0f} m" if self.mission_m else "",
        ]
        told.append(f"anomalies: {self.mission_anomalies}" if self.mission_anomalies else "")
        after = ", ".join(filter(None, told))
        return f"is over{' after ' if after else ''}{after}: {disarmed_text(self.mission_ended)}"

    @property
    def text(self) -> str:
        """How it ended, as a sentence for the next run."""
        return f"The last mission of {local_time(self.armed_t_wall, '%Y-%m-%d %H:%M')} (run {self.run}) {self.how}"

    @property
    def end(self) -> LastEnd:
        """How it ended, as the status light shows it."""
        why = self.mission_ended
        if why is None:
            return LastEnd.UNFINISHED
        if why == "failed" or why.startswith("fault"):
            return LastEnd.FAILED
        return LastEnd.OUT if why in OUT else LastEnd.STOPPED


def read_last_mission(logs: Path) -> LastMission | None:
    """Return the last mission that the daemons of a folder of runs have had; None if there is no such file.

    Raises:
        BadInput: the file cannot be read, or says something else.
    """
    path = logs / FILE_NAME
    try:
        return TypeAdapter(LastMission).validate_json(read_own(path, MOST_BYTES))
    except FileNotFoundError:
        return None
    except ValidationError:
        raise BadInput(f"{path}: not what a daemon has written: delete it") from None
    except OSError as error:
        raise BadInput(f"{path}: the last mission cannot be read: {error.strerror}") from None


class MissionKeeper(RunLog):
    """Follows a run, keeps its latest mission in the file, and logs an event at the end of each.

    Args:
        run: the folder of the run, among all others.
        log: takes the event. Write it before the outcome of the run: the log takes no event after that.
        tell: prints a line for the person if the file cannot be written; from any thread.
        wall: the wall clock, given the loop's time.
    """

    def __init__(self, run: Path, log: RunLog, tell: Callable[[str], None], wall: WallClock = wall_clock) -> None:
        self._path = run.parent / FILE_NAME
        self._run = run.name
        self._log = log
        self._tell = tell
        self._wall = wall
        self._mission: LastMission | None = None  # the one under way
        self._t_s = self._driven_s = self._driven_m = 0.0  # at its latest tick
        self._anomalies = 0
        self._before: tuple[Anomaly, ...] = ()
        self._newest = b""
        self._writing = OneCall(self._write)

    def tick(self, record: TickRecord) -> None:
        """Take a tick of a mission, and count the anomalies that no person drove into."""
        seen = record.observation
        if self._mission is None or seen is None or record.mission_s is None or record.mission_m is None:
            return
        if record.decision.phase is not Phase.MANUAL:
            self._anomalies += len(set(seen.anomalies).difference(self._before))
        self._before = seen.anomalies
        self._t_s, self._driven_s, self._driven_m = record.t_s, record.mission_s, record.mission_m

    def event(self, name: str, t_s: float, **details: object) -> None:
        """Begin or end a mission."""
        if name == "armed":
            self._t_s, self._driven_s, self._driven_m = t_s, 0.0, 0.0
            self._anomalies, self._before = 0, ()
            self._mission = LastMission(run=self._run, armed_t_wall=round(self._wall(t_s), 3))
            self._keep(self._mission)
        elif name == "disarmed":
            self._end(t_s, str(details["reason"]))

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002 - as any RunLog
        """End a mission that goes on until the end of the run, and wait until the disk has it, at most ``CLOSE_S``."""
        self._end(self._t_s, reason)
        self._writing.join(CLOSE_S)

    def _end(self, t_s: float, why: str) -> None:
        if self._mission is None:
            return
        over = replace(
            self._mission,
            mission_s=round(self._driven_s, 1),
            mission_m=round(self._driven_m, 2),
            mission_anomalies=self._anomalies,
            mission_ended=why,
        )
        self._mission = None
        self._keep(over)
        self._log.logger.info(
            "mission_ended", t_s=t_s, text=f"The mission {over.how}", mission_s=over.mission_s,
            mission_m=over.mission_m, mission_anomalies=over.mission_anomalies, mission_ended=why,
        )  # fmt: skip

    def _keep(self, mission: LastMission) -> None:
        """Have a thread write the file: a disk that does not answer must not delay the control tick."""
        self._newest = self._line(mission)
        try:
            self._writing.start()
        except RuntimeError as error:  # too many, or no memory; no log may raise
            self._tell(f"this mission is not kept: {error}")

    @staticmethod
    def _line(mission: LastMission) -> bytes:
        return msgspec.json.encode(mission) + b"\n"

    def _write(self) -> None:
        try:
            write_atomically(self._path, self._newest, mode=0o644)
        except BadInput as error:
            self._tell(f"the end of this mission is not kept: {error}")
        except OSError as error:
            self._tell(f"{self._path}: the end of this mission is not kept: {error_advice(error)}")

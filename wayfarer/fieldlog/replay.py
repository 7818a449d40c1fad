"""Replay: recorded readings and operator commands through the installed code, decisions compared with the log.

Everything that came from outside is taken from the log: readings, what the motors took, what people asked for, what the
motor board said. Everything that the rover concluded is computed again, by the controller itself: anomalies,
conditions, arming, the gate's level, and what the algorithm decided. So a log is a regression test, and a question:
what would the rover have done with another threshold?
"""

from __future__ import annotations

from math import inf, nextafter
from operator import itemgetter
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import msgspec
from pydantic import ValidationError

from wayfarer.config.messages import explain
from wayfarer.config.own_file import OwnFile, as_used, changed
from wayfarer.config.registry import find_algorithm, refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.controller import Controller
from wayfarer.control.run_log import RunLog
from wayfarer.control.supervisor import make_detector, needs_of
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.errors import BadInput
from wayfarer.fieldlog.log import tick_fields
from wayfarer.fieldlog.reader import Lines, RunReader
from wayfarer.fieldlog.record import AnyRecord, Board, Compass, Event, Header, Record, Tick, encode
from wayfarer.hal import CompassReading, MotorHealth, WheelCommand
from wayfarer.safety.manual import ManualSample

# What a tick concluded, the root first: a heading that is believed or not explains an anomaly, that a phase.
CONCLUSIONS = ("heading_deg", "anomalies", "level", "cause", "mode", "goal_heading_deg", "phase", "why", "wanted_left")
READINGS = {"compass", "motion", "contact", "wheels"}
INPUT_KEYS = frozenset({*Record.__struct_fields__, *READINGS, "applied_left", "applied_right"})


class DecisionDifference(NamedTuple):
    """The first decision that came out otherwise: the tick's time and number, and the conclusion by its key."""

    elapsed_s: float
    n: int | None
    key: str
    logged: object
    today: object


class Replay(NamedTuple):
    """What became of a replay.

    ``ticks`` decisions were compared. ``cut_elapsed_s`` is where records are missing in the log or garbled, or where a
    tick did not end: what follows cannot be replayed, because what the rover remembered there is not known.
    ``changed_file`` is the algorithm's file, if it is not the one that was logged.
    """

    ticks: int
    difference: DecisionDifference | None
    cut_elapsed_s: float | None = None
    changed_file: str | None = None


def replay(run: Path, config: RoverConfig | None = None, *, allow_code: bool = False) -> Replay:
    """Replay a run and compare every tick, up to the first difference.

    Args:
        run: a run's folder.
        config: settings to try instead of those that the rover had.
        allow_code: import the algorithm that the log names as a file or ``"module:attribute"``, which may be any one.

    Raises:
        BadInput: no log, one whose beginning is gone, or one of an algorithm or settings that there are no more.
    """
    reader = RunReader(run)
    records = iter(reader)
    first = next(records)
    try:
        rerun = Rerun(first, config, allow_code=allow_code)
    except BadInput as error:
        raise BadInput(f"{run} cannot be replayed: {error}") from None
    ticks = 0
    for record in records:
        if reader.damage.missing or not rerun.add(record):
            return Replay(ticks, None, record.elapsed_s, rerun.changed_file)
        if not isinstance(record, Tick):
            continue
        today = rerun.tick(record)
        if today is None:
            return Replay(ticks, None, record.elapsed_s, rerun.changed_file)
        difference = compare(record, today)
        if difference is not None:
            return Replay(ticks, difference, changed_file=rerun.changed_file)
        ticks += 1
    return Replay(ticks, None, changed_file=rerun.changed_file)


class Rerun:
    """The controller of a run, made again as the log's first record says, and fed from the log."""

    def __init__(self, header: AnyRecord, config: RoverConfig | None, *, allow_code: bool) -> None:
        if not isinstance(header, Header):
            raise BadInput("its log does not begin with a header")
        if header.part != 1:
            raise BadInput(f"its log begins with part {header.part}, earlier parts are missing")
        if header.algorithm is None or header.config is None:
            raise BadInput("its first record is incomplete")
        if not allow_code:
            refuse_code(header.algorithm)
        config = config or _config_of(header.config)
        files = {name: OwnFile(file.get("path", ""), file.get("blake2b", "")) for name, file in header.files.items()}
        algorithm = find_algorithm(as_used(header.algorithm, files))
        self.changed_file = changed(header.algorithm, files)
        handler = algorithm.make(config.escape, config.vehicle, Random(header.algorithm_seed))
        detector = make_detector(config, needs_of(algorithm, config), header.parts)
        self._heard: list[tuple[float, Event]] = []  # what happens between two ticks, and when it counts
        self._inbox = Inbox()
        self._controller = Controller(config, detector, handler, RunLog(), ladder_seed=header.ladder_seed or 0)
        self._compass: tuple[Compass | None, CompassReading | None] = (None, None)

    def add(self, record: AnyRecord) -> bool:
        """Take what came from outside, at a tick or between two; return whether the record can be what was written."""
        try:
            match record:
                case Tick():
                    self._hear_until(record.t_s)
                    self._sense(record)
                case Board(battery_v=battery_v, faults=faults, says_left=left, says_right=right):
                    duties = None if left is None or right is None else WheelCommand(left, right)
                    self._inbox.put_board(BoardReport(record.t_s, MotorHealth(battery_v, faults), duties))
                case Event(data={"lost": "tick"}):
                    return False  # nobody knows how far that tick came
                case Event():
                    self._take_event(record)
        except (LookupError, TypeError, ValueError):
            return False
        return True

    def tick(self, logged: Tick) -> Tick | None:
        """Do the control tick again whose record was taken, and return what it concludes, as the log would have it.

        None if no log would have it: a time that cannot be gives a mission that began later than now.
        """
        tick = self._controller.step(self._inbox.take(logged.t_s))
        tick.applied = self._inbox.next.applied = self._applied
        again = Lines().parse(encode(Tick(t_s=logged.t_s, t_wall=logged.t_wall, **tick_fields(tick))))
        return again if isinstance(again, Tick) else None

    def _sense(self, tick: Tick) -> None:
        self._inbox.next.compass = self._compass_of(tick.compass)
        self._inbox.next.contact = None if tick.contact is None else tick.contact.reading()
        if tick.motion is not None:
            self._inbox.put_motion(tick.motion.reading())
        if tick.wheels is not None:
            self._inbox.put_wheels(tick.wheels.reading())
        if tick.manual is not None:
            self._controller.manual.sample = ManualSample._make(msgspec.structs.astuple(tick.manual))
        if tick.applied_left is None or tick.applied_right is None:
            raise ValueError("no duties")
        self._applied = WheelCommand(tick.applied_left, tick.applied_right)

    def _take_event(self, event: Event) -> None:
        """Keep what people asked for until its time; the next tick gets its inputs in the order of the log."""
        if event.name == "board_silent":
            self._inbox.put_board(BoardReport(event.t_s, None, error=str(event.data["error"])))
        elif event.name == "power":
            self._inbox.put_power(event.t_s, int(event.data["flags"], 16))
        else:
            at_s = event.t_s
            if event.name == "motors_failed":  # it has the time of its tick, and followed what came while it was waited
                at_s = max([nextafter(at_s, inf), *(before_s for before_s, _ in self._heard)])
            self._heard.append((at_s, event))

    def _hear_until(self, t_s: float) -> None:
        """Do what people asked for before the tick at ``t_s``.

        An event is written at once, so those that came during a tick stand before it, and count after it, and after
        what the tick concluded, which is written last.
        """
        heard, self._heard = sorted(self._heard, key=itemgetter(0)), []
        for at_s, event in heard:
            if at_s <= t_s:
                self._do(event)
            else:
                self._heard.append((at_s, event))

    def _do(self, event: Event) -> None:
        controller, t_s, data = self._controller, event.t_s, event.data
        if event.name == "arming":
            controller.arm(t_s, data.get("goal_heading_deg"))
        elif event.name == "disarmed":
            controller.disarm(t_s, data["reason"])
        elif event.name == "hold":
            controller.hold(t_s)
        elif event.name == "resume":
            controller.resume(t_s)
        elif event.name == "manual":
            controller.begin_manual(t_s, 0, str(data["driver"]))
        elif event.name == "manual_ended":
            controller.end_manual(t_s, data["reason"])
        elif event.name == "goal":
            controller.set_goal(t_s, float(data["goal_heading_deg"]))
        elif event.name == "motors_failed":
            controller.motors_lost(t_s, str(data["error"]), data.get("lost"))
        elif event.name == "motors_opened":
            controller.motors_opened(t_s)

    def _compass_of(self, logged: Compass | None) -> CompassReading | None:
        """Return the reading; the same one as before if the sensor had not spoken again, as in its cell."""
        # The detector takes each reading once, and knows it by its identity.
        if logged != self._compass[0]:
            self._compass = logged, None if logged is None else logged.reading()
        return self._compass[1]


def compare(logged: Tick, today: Tick) -> DecisionDifference | None:
    """Return the first conclusion of a tick that is not as logged; one that only one of the two has counts, too."""
    was, now = _conclusions(logged), _conclusions(today)
    for key in (*CONCLUSIONS, *was, *now):
        if was.get(key) != now.get(key):
            return DecisionDifference(logged.elapsed_s, logged.n, key, was.get(key), now.get(key))
    return None


def _conclusions(tick: Tick) -> dict[str, Any]:
    """Return what a tick concluded by its keys, what the algorithm remembered by its own."""
    concluded = {key: getattr(tick, key) for key in Tick.__struct_fields__ if key not in INPUT_KEYS}
    memory = concluded.pop("memory")
    return concluded | {f"memory.{key}": value for key, value in memory.items()}


def _config_of(config: dict[str, Any]) -> RoverConfig:
    """Return the rover's settings; its parts are not needed, nor their drivers."""
    try:
        return RoverConfig.model_validate_json(msgspec.json.encode({**config, "parts": {}}), strict=True)
    except ValidationError as error:
        said = explain(error, RoverConfig)
        raise BadInput(f"its own settings are not valid: {said}; give others with --rover") from None

"""Replay: recorded readings and operator commands through the installed code, decisions compared with the log.

Everything that came from outside is taken from the log: readings, what the motors took, what people asked for, what the
motor board said. Everything that the rover concluded is computed again, by the controller itself: anomalies,
conditions, arming, the gate's level, and what the algorithm decided. So a log is a regression test, and a question:
what would the rover have done with another threshold?
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, nan, nextafter
from operator import itemgetter
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import orjson
from pydantic import ValidationError

from wayfarer.config.messages import explain
from wayfarer.config.registry import find_algorithm, refuse_code
from wayfarer.config.rover_file import RoverConfig
from wayfarer.control.controller import Controller
from wayfarer.control.run_log import PartialLog
from wayfarer.control.supervisor import make_detector, needs_of
from wayfarer.control.tick import BoardReport, Inbox
from wayfarer.errors import BadInput
from wayfarer.fieldlog.clock import seconds_since
from wayfarer.fieldlog.log import tick_fields
from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.schema import OLDEST, Record
from wayfarer.hal import CompassReading, ContactReading, MotionReading, MotorHealth, Side, WheelCommand
from wayfarer.safety.manual import ManualSample

# What a tick concluded, the root first: a heading that is believed or not explains an anomaly, that a phase.
CONCLUSIONS = ("heading_deg", "anomalies", "level", "cause", "goal_heading_deg", "phase", "why", "wanted_left")
INPUT_KEYS = frozenset(
    {"record", "n", "t_s", "t_wall", "compass", "motion", "contact", "applied_left", "applied_right"}
)


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
    """

    ticks: int
    difference: DecisionDifference | None
    cut_elapsed_s: float | None = None


def replay(run: Path, config: RoverConfig | None = None, *, allow_code: bool = False) -> Replay:
    """Replay a run and compare every tick, up to the first difference.

    Args:
        run: a run's folder.
        config: settings to try instead of those that the rover had.
        allow_code: import the algorithm that the log names as ``"module:attribute"``, which may be any module.

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
        if reader.damage.missing or not rerun.take(record):
            return Replay(ticks, None, cut_elapsed_s=seconds_since(first, record))
        if record["record"] != "tick":
            continue
        difference = compare(record, rerun.tick(record["t_s"]), seconds_since(first, record))
        if difference is not None:
            return Replay(ticks, difference)
        ticks += 1
    return Replay(ticks, None)


class Rerun:
    """The controller of a run, made again as the log's first record says, and fed from the log."""

    def __init__(self, header: Record, config: RoverConfig | None, *, allow_code: bool) -> None:
        if header["record"] != "run":
            raise BadInput("its log does not begin with a header")
        if header["schema"] < OLDEST:
            raise BadInput(f"its log has schema {header['schema']}, this wayfarer replays those from {OLDEST}")
        if header.get("part", 1) != 1:
            raise BadInput(f"its log begins with part {header['part']}, earlier parts are missing")
        try:
            if not allow_code:
                refuse_code(header["algorithm"])
            self._make(header, config or _config_of(header))
        except (KeyError, TypeError, AttributeError):
            raise BadInput("its first record is incomplete") from None

    def _make(self, header: Record, config: RoverConfig) -> None:
        algorithm = find_algorithm(header["algorithm"])
        handler = algorithm.make(config.escape, config.vehicle, Random(header["algorithm_seed"]))
        detector = make_detector(config, needs_of(algorithm, config), watches_motion="motion" in header["parts"])
        self._heard: list[tuple[float, Record]] = []  # what happens between two ticks, and when
        self._inbox = Inbox()
        ladder_seed = header.get("ladder_seed", 0)  # an old log has none: its random turns are not drawn again
        self._controller = Controller(config, detector, handler, PartialLog(), ladder_seed=ladder_seed)
        self._compass: tuple[Mapping[str, Any] | None, CompassReading | None] = (None, None)

    def take(self, record: Record) -> bool:
        """Take what came from outside, at a tick or between two; return whether the record can be what was written."""
        try:
            if record["record"] == "tick":
                self._hear_until(record["t_s"])
                self._sense(record)
            elif record["record"] == "board":
                health = MotorHealth(record["battery_v"], tuple(record["faults"]))
                left, right = record.get("says_left"), record.get("says_right")  # an old log has none
                duties = None if left is None or right is None else WheelCommand(left, right)
                self._inbox.put_board(BoardReport(record["t_s"], health, duties))
            elif record.get("lost") == "tick":
                return False  # nobody knows how far that tick came
            elif record["record"] == "event":
                self._take_event(record)
        except (LookupError, TypeError, ValueError, AttributeError):
            return False
        return True

    def tick(self, t_s: float) -> dict[str, Any]:
        """Do the control tick again whose record was taken, and return what it concludes, as the log would have it."""
        tick = self._controller.step(self._inbox.take(t_s))
        tick.applied = self._inbox.next.applied = self._applied
        again: dict[str, Any] = orjson.loads(orjson.dumps(tick_fields(tick)))
        return again

    def _sense(self, record: Record) -> None:
        self._inbox.next.compass = self._compass_of(record["compass"])
        self._inbox.next.contact = _contact_of(record["contact"])
        if record["motion"] is not None:
            self._inbox.put_motion(MotionReading(**_with_nan(record["motion"])))
        if record.get("manual_seq") is not None:
            sample = (record[f"manual_{key}"] for key in ManualSample._fields)
            self._controller.manual.sample = ManualSample._make(sample)
        self._applied = WheelCommand(float(record["applied_left"]), float(record["applied_right"]))

    def _take_event(self, record: Record) -> None:
        """Keep what people asked for until its time; what the next tick is told is told in the order of the log."""
        name, t_s = record["name"], record["t_s"]
        if name == "board_silent":
            self._inbox.put_board(BoardReport(t_s, None, error=str(record["error"])))
        elif name == "power":
            self._inbox.put_power(t_s, int(record["flags"], 16))
        else:
            if name == "motors_failed":  # it has the time of its tick, and followed what came while it was waited for
                t_s = max([nextafter(t_s, inf), *(at_s for at_s, _ in self._heard)])
            self._heard.append((t_s, record))

    def _hear_until(self, t_s: float) -> None:
        """Do what people asked for before the tick at ``t_s``.

        An event is written at once, so those that came during a tick stand before it, and count after it, and after
        what the tick concluded, which is written last.
        """
        heard, self._heard = sorted(self._heard, key=itemgetter(0)), []
        for at_s, record in heard:
            if at_s <= t_s:
                self._event(record)
            else:
                self._heard.append((at_s, record))

    def _event(self, record: Record) -> None:
        controller, name, t_s = self._controller, record["name"], record["t_s"]
        if name == "arming":
            controller.arm(t_s, record.get("goal_heading_deg"))
        elif name == "disarmed":
            controller.disarm(t_s, record["reason"])
        elif name == "hold":
            controller.hold(t_s)
        elif name == "resume":
            controller.resume(t_s)
        elif name == "manual":
            controller.begin_manual(t_s, 0, str(record["driver"]))
        elif name == "manual_ended":
            controller.end_manual(t_s, record["reason"])
        elif name == "goal":
            controller.set_goal(t_s, float(record["goal_heading_deg"]))
        elif name == "motors_failed":
            controller.motors_lost(t_s, str(record["error"]), record.get("lost"))
        elif name == "motors_opened":
            controller.motors_opened(t_s)

    def _compass_of(self, fields: Mapping[str, Any] | None) -> CompassReading | None:
        """Return the reading; the same one as before where the sensor had not spoken again, as in its cell."""
        # The detector takes each reading once, and knows it by its identity.
        if fields != self._compass[0]:
            self._compass = fields, None if fields is None else CompassReading(**_with_nan(fields))
        return self._compass[1]


def compare(logged: Record, today: Mapping[str, Any], elapsed_s: float) -> DecisionDifference | None:
    """Return the first conclusion of a tick that is not as logged; one that only one of the two has counts, too."""
    others = dict.fromkeys(key for key in (*logged, *today) if key not in CONCLUSIONS and key not in INPUT_KEYS)
    for key in (*CONCLUSIONS, *others):
        if logged.get(key) != today.get(key):
            return DecisionDifference(elapsed_s, logged.get("n"), key, logged.get(key), today.get(key))
    return None


def _config_of(header: Record) -> RoverConfig:
    """Return the rover's settings; its parts are not needed, nor their drivers."""
    try:
        return RoverConfig.model_validate_json(orjson.dumps({**header["config"], "parts": {}}), strict=True)
    except ValidationError as error:
        said = explain(error, RoverConfig)
        raise BadInput(f"its own settings are not valid: {said}; give others with --rover") from None


def _contact_of(fields: Mapping[str, Any] | None) -> ContactReading | None:
    if fields is None:
        return None
    return ContactReading(fields["t_s"], tuple(map(Side, fields["sides"])), fields["obstacle_bearing_deg"])


def _with_nan(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a reading; JSON has no NaN, so that a number which was none is null in the log."""
    return {key: nan if value is None and key != "calibration" else value for key, value in fields.items()}

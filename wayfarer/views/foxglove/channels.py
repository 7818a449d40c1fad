"""Foxglove channels of a run: field log records in, messages out; for MCAP files and live viewers."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple, Protocol

import orjson
from foxglove import Channel, Context
from foxglove.channels import FrameTransformChannel, LocationFixChannel, LogChannel, SceneUpdateChannel
from foxglove.messages import (
    FrameTransform,
    LocationFix,
    LocationFixPositionCovarianceType,
    Log,
    SceneUpdate,
    Timestamp,
)

from wayfarer.fieldlog.elapsed import Elapsed
from wayfarer.fieldlog.reader import Record
from wayfarer.views.foxglove.notes import Notes
from wayfarer.views.foxglove.places import Places
from wayfarer.views.foxglove.plots import PLOTS, Plot
from wayfarer.views.foxglove.scene import (
    ROVER,
    TRUTH,
    body_scene,
    forest_scene,
    orientation,
    path_scene,
    point,
    transform,
)

# Raised by a record that is JSON but not as the schema says: edited by hand, or written by another program.
ODD = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
SECOND_NS = 1_000_000_000
LATEST_S = 2.0**32 - 1.0  # in the year 2106, where the SDK's times end

# The SDK logs through Python's logging, for instance when a viewer disconnects; by default that would be printed.
logging.getLogger("foxglove").addHandler(logging.NullHandler())


class MessageTime(NamedTuple):
    """The time of a message, in the forms that the SDK wants."""

    time_ns: int
    stamp: Timestamp


class SdkChannel(Protocol):
    """The methods used of the SDK's channels, which have no common base class."""

    def has_sinks(self) -> bool:
        """Return whether a file, or any viewer, takes this channel."""

    def log(self, msg: Any, /, *, log_time: int | None = None) -> None:
        """Send a message."""


Make = Callable[[Record, MessageTime], Iterator[Any]]
Row = list[tuple[SdkChannel, Make]]


class Channels:
    """The channels of one run, fed with its records in their order.

    A message is only made for a channel that a file or a viewer takes. No method raises because of the content of a
    record: one that cannot be understood gives no message.

    Args:
        context: the SDK's; a file or a server that is opened on it gets the messages.
    """

    def __init__(self, context: Context) -> None:
        self._elapsed = Elapsed()
        self._places = Places()
        self._notes = Notes()
        self._rows: defaultdict[str, Row] = defaultdict(list)
        self._lasting: Row = []
        self._add_plots(context)
        self._add_log(context)
        self._add_scene(context)

    def take(self, record: Record, time_s: float) -> None:
        """Send what a record says, at a time in seconds since 1970."""
        known: Record = {"elapsed_s": self._elapsed.at(record)}
        with suppress(*ODD):
            known |= {"place": self._places.take(record), "path_m": self._places.path_m}
        kind = record["record"]
        _send(self._rows[kind], record | known if kind == "tick" else record, time_s)

    def send_lasting(self, time_s: float) -> None:
        """Send again what stays in sight: forest, bodies and paths."""
        _send(self._lasting, self._places.header, time_s)

    def _add_plots(self, context: Context) -> None:
        for topic, plot in PLOTS.items():
            channel = Channel(topic, schema=plot.schema(topic), context=context)
            self._rows[plot.record].append((channel, partial(_values, plot)))

    def _add_log(self, context: Context) -> None:
        channel = LogChannel("/log", context=context)
        for kind in ("run", "event", "fault", "tick", "outcome"):
            self._rows[kind].append((channel, self._lines))

    def _add_scene(self, context: Context) -> None:
        self._rows["tick"].append((FrameTransformChannel("/pose", context=context), _pose))
        self._rows["truth"].append((FrameTransformChannel("/truth", context=context), _true_pose))
        self._rows["position"].append((LocationFixChannel("/location", context=context), _location))
        for topic, make in (("/forest", _forest), ("/rover", _bodies)):
            channel = SceneUpdateChannel(topic, context=context)
            self._rows["run"].append((channel, make))
            self._lasting.append((channel, make))
        for topic, kind, frame in (("/track", "tick", ROVER), ("/truth_track", "truth", TRUTH)):
            channel = SceneUpdateChannel(topic, context=context)
            self._rows[kind].append((channel, partial(self._longer_path, frame)))
            self._rows["outcome"].append((channel, partial(self._path, frame)))
            self._lasting.append((channel, partial(self._path, frame)))

    def _lines(self, record: Record, at: MessageTime) -> Iterator[Log]:
        for note in self._notes.take(record):
            yield Log(timestamp=at.stamp, level=note.level, name=note.name, message=note.text)

    def _longer_path(self, frame: str, record: Record, at: MessageTime) -> Iterator[SceneUpdate]:
        if self._places.is_due(frame, record["t_s"]):
            yield from self._path(frame, record, at)

    def _path(self, frame: str, _record: Record, at: MessageTime) -> Iterator[SceneUpdate]:
        if points := self._places.paths[frame].points:
            yield path_scene(at.stamp, frame, [point(east_m, north_m) for east_m, north_m, _ in points])


def _send(row: Row, record: Record, time_s: float) -> None:
    """Send a record on a row of channels; an error of one does not affect the others."""
    at = _moment(time_s)
    for channel, make in row:
        with suppress(*ODD):
            if channel.has_sinks():
                for message in make(record, at):
                    channel.log(message, log_time=at.time_ns)


def nanoseconds(time_s: float) -> int:
    """Return a time since 1970 as the SDK counts it, to the microsecond: a float of today's seconds has no more."""
    return round(min(max(time_s, 0.0), LATEST_S) * 1e6) * 1000


def _moment(time_s: float) -> MessageTime:
    time_ns = nanoseconds(time_s)
    return MessageTime(time_ns, Timestamp(*divmod(time_ns, SECOND_NS)))


def _values(plot: Plot, record: Record, _at: MessageTime) -> Iterator[bytes]:
    if message := plot.message(record):
        yield orjson.dumps(message)


def _pose(tick: Record, at: MessageTime) -> Iterator[FrameTransform]:
    if place := tick["place"]:
        tilt_deg = tick.get("pitch_deg") or 0.0, tick.get("roll_deg") or 0.0
        yield transform(at.stamp, ROVER, place.east_m, place.north_m, orientation(place.heading_deg, *tilt_deg))


def _true_pose(truth: Record, at: MessageTime) -> Iterator[FrameTransform]:
    rotation = orientation(truth["heading_deg"], truth["pitch_deg"], truth["roll_deg"])
    yield transform(at.stamp, TRUTH, truth["x_m"], truth["y_m"], rotation)


def _location(fix: Record, at: MessageTime) -> Iterator[LocationFix]:
    """Give a position; its error is horizontal, and says nothing of the height."""
    unknown = LocationFixPositionCovarianceType.Unknown
    known = LocationFixPositionCovarianceType.Approximated
    variance_m2 = (fix.get("error_m") or 0.0) ** 2
    yield LocationFix(
        timestamp=at.stamp,
        frame_id=ROVER,
        latitude=fix["latitude_deg"],
        longitude=fix["longitude_deg"],
        position_covariance=[variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, 0.0],
        position_covariance_type=known if variance_m2 else unknown,
    )


def _forest(header: Record, at: MessageTime) -> Iterator[SceneUpdate]:
    if "world" in header:
        yield forest_scene(at.stamp, header["world"])


def _bodies(header: Record, at: MessageTime) -> Iterator[SceneUpdate]:
    frames = (ROVER, TRUTH) if "world" in header else (ROVER,)
    yield body_scene(at.stamp, header["config"]["vehicle"], frames)

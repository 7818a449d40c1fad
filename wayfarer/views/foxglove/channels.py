"""Foxglove channels of a run: field log records in, messages out; for MCAP files and live viewers."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
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
    LogLevel,
    SceneUpdate,
    Timestamp,
)

from wayfarer.fieldlog.contact_map import ContactMapNoted, MapRow, Point
from wayfarer.fieldlog.run_events import Ended, RunBegan
from wayfarer.fieldlog.run_fold import RunFold
from wayfarer.fieldlog.schema import Record
from wayfarer.fieldlog.typed import Fix, Header, RunEvent, Tick, Truth
from wayfarer.fieldlog.wording import Tone
from wayfarer.views.export.wall_time import SECOND_NS, nanoseconds
from wayfarer.views.foxglove.plots import FURTHER, PLOTS, Plot
from wayfarer.views.foxglove.scene import (
    ROVER,
    TRUTH,
    DrawnPath,
    body_scene,
    contact_map_scene,
    forest_scene,
    orientation,
    path_scene,
    point,
    transform,
)
from wayfarer.views.text.log_lines import LOG_NAMES, log_lines

LOG_LEVELS: Mapping[Tone, LogLevel] = {Tone.WARNING: LogLevel.Warning, Tone.FAULT: LogLevel.Error}

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


Make = Callable[[Any, MessageTime], Iterator[Any]]  # of an event of the kinds whose row it stands in
Row = list[tuple[SdkChannel, Make]]


class Channels:
    """The channels of one run, fed with its records in their order.

    The map's origin is where the log begins; in a simulated run it is the forest's, and the log begins at its start.
    A message is only made for a channel that a file or a viewer takes.

    Args:
        context: the SDK's; a file or a server that is opened on it gets the messages.
    """

    def __init__(self, context: Context) -> None:
        self._fold = RunFold()
        self._start_m = (0.0, 0.0)
        self._here_m: tuple[float, float] | None = None
        self._remembered: tuple[Sequence[MapRow], Sequence[Point]] | None = None
        self._paths = {frame: DrawnPath() for frame in (ROVER, TRUTH)}
        self._rows: defaultdict[type[RunEvent], Row] = defaultdict(list)
        self._lasting: Row = []
        self._add_plots(context)
        self._add_log(context)
        self._add_scene(context)

    @property
    def header(self) -> Header:
        """Return what ran."""
        return self._fold.state.header

    def take(self, record: Record, time_s: float) -> None:
        """Send what a record says, at a time in seconds since 1970."""
        for event in self._fold.take(record):
            match event:
                case Tick(place=place) if place is not None:
                    east_m, north_m = place.east_m + self._start_m[0], place.north_m + self._start_m[1]
                    event.place = place._replace(east_m=east_m, north_m=north_m)
                    self._here_m = east_m, north_m
                    self._paths[ROVER].grow(east_m, north_m)
                case ContactMapNoted(is_placed=True) if self._here_m is not None:
                    self._remembered = event.trunks_from(self._here_m), event.way_from(self._here_m)
                case Truth(x_m=x_m, y_m=y_m):
                    self._paths[TRUTH].grow(x_m, y_m)
                case RunBegan(header=Header(world=world)) if world is not None:
                    self._start_m = (float(world["start_m"][0]), float(world["start_m"][1]))
            _send(self._rows[type(event)], event, time_s)

    def send_lasting(self, time_s: float) -> None:
        """Send again what stays in sight: forest, bodies and paths."""
        state = self._fold.state
        _send(self._lasting, RunBegan(state.elapsed_s, state.t_s, state.header, late=False), time_s)

    def _add_plots(self, context: Context) -> None:
        for topic, plot in PLOTS.items():
            channel = Channel(topic, schema=plot.schema(topic), context=context)
            self._rows[plot.view].append((channel, partial(_values, plot)))
        self._rows[Tick].append((Channel("/further", schema=dict(FURTHER), context=context), _further))

    def _add_log(self, context: Context) -> None:
        channel = LogChannel("/log", context=context)
        for kind in LOG_NAMES:
            self._rows[kind].append((channel, _lines))

    def _add_scene(self, context: Context) -> None:
        self._rows[Tick].append((FrameTransformChannel("/pose", context=context), _pose))
        self._rows[Truth].append((FrameTransformChannel("/truth", context=context), _true_pose))
        self._rows[Fix].append((LocationFixChannel("/location", context=context), _location))
        scenes: tuple[tuple[str, type[RunEvent], Make], ...] = (
            ("/forest", RunBegan, _forest), ("/rover", RunBegan, _bodies),
            ("/contact_map", ContactMapNoted, self._contact_map),
        )  # fmt: skip
        for topic, kind, make in scenes:
            channel = SceneUpdateChannel(topic, context=context)
            self._rows[kind].append((channel, make))
            self._lasting.append((channel, make))
        for topic, kind, frame in (("/track", Tick, ROVER), ("/truth_track", Truth, TRUTH)):
            channel = SceneUpdateChannel(topic, context=context)
            self._rows[kind].append((channel, partial(self._longer_path, frame)))
            self._rows[Ended].append((channel, partial(self._path, frame)))
            self._lasting.append((channel, partial(self._path, frame)))

    def _contact_map(self, _event: RunEvent, at: MessageTime) -> Iterator[SceneUpdate]:
        if self._remembered is not None:
            yield contact_map_scene(at.stamp, *self._remembered)

    def _longer_path(self, frame: str, event: RunEvent, at: MessageTime) -> Iterator[SceneUpdate]:
        if self._paths[frame].is_due(event.t_s):
            yield from self._path(frame, event, at)

    def _path(self, frame: str, _event: RunEvent, at: MessageTime) -> Iterator[SceneUpdate]:
        if points := self._paths[frame].points:
            yield path_scene(at.stamp, frame, [point(east_m, north_m) for east_m, north_m, _ in points])


def _send(row: Row, event: RunEvent, time_s: float) -> None:
    """Send an event on a row of channels."""
    at = _moment(time_s)
    for channel, make in row:
        if channel.has_sinks():
            for message in make(event, at):
                channel.log(message, log_time=at.time_ns)


def _moment(time_s: float) -> MessageTime:
    time_ns = nanoseconds(time_s)
    return MessageTime(time_ns, Timestamp(*divmod(time_ns, SECOND_NS)))


def _values(plot: Plot, view: RunEvent, _at: MessageTime) -> Iterator[bytes]:
    if message := plot.message(view):
        yield orjson.dumps(message)


def _further(tick: Tick, _at: MessageTime) -> Iterator[bytes]:
    if further := tick.further:
        yield orjson.dumps(further)


def _lines(event: RunEvent, at: MessageTime) -> Iterator[Log]:
    for name, text, tone in log_lines(event):
        yield Log(timestamp=at.stamp, level=LOG_LEVELS.get(tone, LogLevel.Info), name=name, message=text)


def _pose(tick: Tick, at: MessageTime) -> Iterator[FrameTransform]:
    if (place := tick.place) is not None:
        rotation = orientation(place.heading_deg, tick.pitch_deg or 0.0, tick.roll_deg or 0.0)
        yield transform(at.stamp, ROVER, place.east_m, place.north_m, rotation)


def _true_pose(truth: Truth, at: MessageTime) -> Iterator[FrameTransform]:
    rotation = orientation(truth.heading_deg, truth.pitch_deg, truth.roll_deg)
    yield transform(at.stamp, TRUTH, truth.x_m, truth.y_m, rotation)


def _location(fix: Fix, at: MessageTime) -> Iterator[LocationFix]:
    """Give a position; its error is horizontal, and says nothing of the height."""
    unknown = LocationFixPositionCovarianceType.Unknown
    known = LocationFixPositionCovarianceType.Approximated
    variance_m2 = (fix.error_m or 0.0) ** 2
    yield LocationFix(
        timestamp=at.stamp,
        frame_id=ROVER,
        latitude=fix.latitude_deg,
        longitude=fix.longitude_deg,
        position_covariance=[variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, 0.0],
        position_covariance_type=known if variance_m2 else unknown,
    )


def _forest(began: RunBegan, at: MessageTime) -> Iterator[SceneUpdate]:
    if began.header.world is not None:
        yield forest_scene(at.stamp, began.header.world)


def _bodies(began: RunBegan, at: MessageTime) -> Iterator[SceneUpdate]:
    length_m, width_m = (began.header.setting("vehicle", key) for key in ("length_m", "width_m"))
    if length_m is not None and width_m is not None:
        yield body_scene(at.stamp, length_m, width_m, (ROVER,) if began.header.world is None else (ROVER, TRUTH))

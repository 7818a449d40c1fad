"""A run's log as an MCAP file for Foxglove: field log records in, messages on Foxglove's channels out."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import msgspec
from foxglove import Channel, Context, open_mcap
from foxglove.channels import FrameTransformChannel, LocationFixChannel, LogChannel, SceneUpdateChannel
from foxglove.mcap import MCAPWriter
from foxglove.messages import (
    FrameTransform,
    LocationFix,
    LocationFixPositionCovarianceType,
    Log,
    LogLevel,
    SceneUpdate,
    Timestamp,
)

from wayfarer import __version__
from wayfarer.export import SECOND_NS, nanoseconds, read_clock_zero_s
from wayfarer.export.mcap_plots import FURTHER, PLOTS, Plot
from wayfarer.export.mcap_scene import (
    ROVER,
    TRUTH,
    DrawnPath,
    body_scene,
    forest_scene,
    orientation,
    path_scene,
    point,
    transform,
)
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import AnyRecord, Fix, Header, Outcome, ReckonedPose, Tick, Truth
from wayfarer.fieldlog.run_fold import RunBegan, RunFold, Told
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview.narrator import LOG_NAMES, further, log_lines

LOG_LEVELS: Mapping[Tone, LogLevel] = {Tone.WARNING: LogLevel.Warning, Tone.FAULT: LogLevel.Error}


def write_mcap(run: Path, file: BinaryIO) -> Damage:
    """Write a run's log into an open file as MCAP, and return what of it could not be read.

    The same log gives the same bytes.

    Raises:
        BadInput: there is no log, or nothing in it can be read.
        OSError: the file takes no more.
    """
    reader = RunReader(run)
    zero_s = read_clock_zero_s(reader)
    began_ns = nanoseconds(zero_s + next(iter(RunReader(run))).t_s)
    context = Context()
    channels = Channels(context)
    sink = _Sink(file)
    writer = open_mcap(sink, context=context)
    try:
        for record in RunReader(run):
            channels.take(record, zero_s + record.t_s)
            sink.check()
        _describe(writer, channels.header, began_ns)
    finally:
        try:
            writer.close()
        except RuntimeError:  # it says that something was not written; the sink knows why
            sink.check()
            raise
    return reader.damage


class MessageTime(NamedTuple):
    """The time of a message, in the forms that the SDK wants."""

    time_ns: int
    stamp: Timestamp


class SdkChannel(Protocol):
    """The method used of the SDK's channels, which have no common base class."""

    def log(self, msg: Any, /, *, log_time: int | None = None) -> None:
        """Send a message."""


Make = Callable[[Any, MessageTime], Iterator[Any]]  # of an event of the kinds whose row it stands in
Row = list[tuple[SdkChannel, Make]]


class Channels:
    """The channels of one run, fed with its records in their order.

    The map's origin is where the log begins; in a simulated run it is the forest's, and the log begins at its start.

    Args:
        context: the SDK's; a file that is opened on it gets the messages.
    """

    def __init__(self, context: Context) -> None:
        self._fold = RunFold()
        self._start_m = (0.0, 0.0)
        self._paths = {frame: DrawnPath() for frame in (ROVER, TRUTH)}
        self._rows: defaultdict[type[Told], Row] = defaultdict(list)
        self._add_plots(context)
        self._add_log(context)
        self._add_scene(context)

    @property
    def header(self) -> Header:
        """Return what ran."""
        return self._fold.state.header

    def take(self, record: AnyRecord, time_s: float) -> None:
        """Send what a record says, at a time in seconds since 1970."""
        for event in self._fold.take(record):
            match event:
                case Tick() if (place := event.place) is not None:
                    self._paths[ROVER].grow(*self._on_map(place))
                case Truth(x_m=x_m, y_m=y_m):
                    self._paths[TRUTH].grow(x_m, y_m)
                case RunBegan(header=Header(world=world)) if world is not None:
                    self._start_m = world.start_m
            _send(self._rows[type(event)], event, time_s)

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
        self._rows[Tick].append((FrameTransformChannel("/pose", context=context), self._pose))
        self._rows[Truth].append((FrameTransformChannel("/truth", context=context), _true_pose))
        self._rows[Fix].append((LocationFixChannel("/location", context=context), _location))
        self._rows[RunBegan].append((SceneUpdateChannel("/forest", context=context), _forest))
        self._rows[RunBegan].append((SceneUpdateChannel("/rover", context=context), _bodies))
        for topic, kind, frame in (("/track", Tick, ROVER), ("/truth_track", Truth, TRUTH)):
            channel = SceneUpdateChannel(topic, context=context)
            self._rows[kind].append((channel, partial(self._longer_path, frame)))
            self._rows[Outcome].append((channel, partial(self._path, frame)))

    def _on_map(self, place: ReckonedPose) -> tuple[float, float]:
        """Return metres east and north of the map's origin."""
        return place.east_m + self._start_m[0], place.north_m + self._start_m[1]

    def _pose(self, tick: Tick, at: MessageTime) -> Iterator[FrameTransform]:
        if (place := tick.place) is not None:
            rotation = orientation(place.heading_deg, tick.pitch_deg or 0.0, tick.roll_deg or 0.0)
            yield transform(at.stamp, ROVER, *self._on_map(place), rotation)

    def _longer_path(self, frame: str, event: Told, at: MessageTime) -> Iterator[SceneUpdate]:
        if self._paths[frame].is_due(event.t_s):
            yield from self._path(frame, event, at)

    def _path(self, frame: str, _event: Told, at: MessageTime) -> Iterator[SceneUpdate]:
        if points := self._paths[frame].points:
            yield path_scene(at.stamp, frame, [point(east_m, north_m) for east_m, north_m, _ in points])


def _send(row: Row, event: Told, time_s: float) -> None:
    """Send an event on a row of channels."""
    at = _moment(time_s)
    for channel, make in row:
        for message in make(event, at):
            channel.log(message, log_time=at.time_ns)


def _moment(time_s: float) -> MessageTime:
    time_ns = nanoseconds(time_s)
    return MessageTime(time_ns, Timestamp(*divmod(time_ns, SECOND_NS)))


def _values(plot: Plot, view: AnyRecord, _at: MessageTime) -> Iterator[bytes]:
    if message := plot.message(view):
        yield msgspec.json.encode(message)


def _further(tick: Tick, _at: MessageTime) -> Iterator[bytes]:
    if others := further(tick):
        yield msgspec.json.encode(others)


def _lines(event: Told, at: MessageTime) -> Iterator[Log]:
    for name, text, tone in log_lines(event):
        yield Log(timestamp=at.stamp, level=LOG_LEVELS.get(tone, LogLevel.Info), name=name, message=text)


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


def _describe(writer: MCAPWriter, header: Header, began_ns: int) -> None:
    """Add what ran: as a metadata record, and the rover file's settings as an attachment."""
    writer.write_metadata("wayfarer", _metadata(header))
    if header.config is not None:
        settings = msgspec.json.format(msgspec.json.encode(header.config), indent=2)
        writer.attach(
            log_time=began_ns, create_time=began_ns, name="rover.json", media_type="application/json", data=settings
        )


def _metadata(header: Header) -> dict[str, str]:
    """Return the metadata of a run by key; what the log does not say is left out."""
    values = {
        "exported_by": f"wayfarer {__version__}",
        "wayfarer_version": header.version,
        "rover": header.rover,
        "rover_file_hash": header.config_hash,
        "algorithm": header.algorithm,
        "log_schema": header.schema,
        "simulated": None if header.simulated is None else str(header.simulated).lower(),
        "seed": header.seed,
        "trial": header.trial,
    }
    return {key: str(value) for key, value in values.items() if value is not None}


class _Sink:
    """A file for the SDK's writer that remembers its first error: the SDK passes none on when it takes a message."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error that kept something from being written."""
        if self._error is not None:
            raise self._error

    def write(self, data: bytes | bytearray) -> int:
        with self._remembered():
            return self._file.write(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        with self._remembered():
            return self._file.seek(offset, whence)

    def flush(self) -> None:
        with self._remembered():
            self._file.flush()

    @contextmanager
    def _remembered(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self._error = self._error or error
            raise

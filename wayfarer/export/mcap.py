"""A run's log as an MCAP file for Foxglove: field log records in, messages on Foxglove's channels out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import msgspec
from foxglove import Channel, Context, open_mcap
from foxglove.channels import FrameTransformChannel, LocationFixChannel, LogChannel, SceneUpdateChannel
from foxglove.mcap import MCAPWriter
from foxglove.messages import (
    LocationFix,
    LocationFixPositionCovarianceType,
    Log,
    LogLevel,
    Point3,
    SceneUpdate,
    Timestamp,
)

from wayfarer import __version__
from wayfarer.export import SECOND_NS, nanoseconds, read_clock_zero_s
from wayfarer.export.mcap_plots import FURTHER, PLOTS
from wayfarer.export.mcap_scene import (
    ROVER,
    TRUTH,
    DrawnPath,
    body_scene,
    forest_scene,
    orientation,
    path_scene,
    transform,
)
from wayfarer.fieldlog.reader import Damage, RunReader
from wayfarer.fieldlog.record import AnyRecord, Fix, Header, Outcome, Tick, Truth
from wayfarer.fieldlog.run_fold import RunBegan, RunFold, Told
from wayfarer.fieldlog.wording import Tone
from wayfarer.logview.narrator import further, log_lines

LOG_LEVELS: Mapping[Tone, LogLevel] = {Tone.WARNING: LogLevel.Warning, Tone.FAULT: LogLevel.Error}


def write_mcap(run: Path, file: BinaryIO) -> Damage:
    """Write a run's log into an open file as MCAP, and return what of it could not be read.

    The same log gives the same bytes. It raises as ``ExportFormat.write``.
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
            channels.send(record, zero_s + record.t_s)
            sink.check()
        _describe(writer, channels.header, began_ns)
    finally:
        try:
            writer.close()
        except RuntimeError:  # it says that something was not written; the sink knows why
            sink.check()
            raise
    return reader.damage


class SdkChannel(Protocol):
    """The method used of the SDK's channels, which have no common base class."""

    def log(self, msg: Any, /, *, log_time: int | None = None) -> None:
        """Send a message."""


class Channels:
    """The channels of one run by topic, fed with its records in their order.

    The map's origin is where the log begins; in a simulated run it is the forest's, and the log begins at its start.

    Args:
        context: the SDK's; a file that is opened on it gets the messages.
    """

    def __init__(self, context: Context) -> None:
        self._fold = RunFold()
        self._start_m = (0.0, 0.0)
        self._paths = {frame: DrawnPath() for frame in (ROVER, TRUTH)}
        self.by_topic: dict[str, SdkChannel] = {
            **{topic: Channel(topic, schema=plot.schema(topic), context=context) for topic, plot in PLOTS.items()},
            "/further": Channel("/further", schema=dict(FURTHER), context=context),
            "/log": LogChannel("/log", context=context),
            "/pose": FrameTransformChannel("/pose", context=context),
            "/truth": FrameTransformChannel("/truth", context=context),
            "/location": LocationFixChannel("/location", context=context),
            **{topic: SceneUpdateChannel(topic, context=context)
               for topic in ("/forest", "/rover", "/track", "/truth_track")},
        }  # fmt: skip

    @property
    def header(self) -> Header:
        """Return what ran."""
        return self._fold.state.header

    def send(self, record: AnyRecord, time_s: float) -> None:
        """Send what a record says, at a time in seconds since 1970."""
        time_ns = nanoseconds(time_s)
        stamp = Timestamp(*divmod(time_ns, SECOND_NS))
        for event in self._fold.add(record):
            for topic, message in self._messages(event, stamp):
                self.by_topic[topic].log(message, log_time=time_ns)

    def _messages(self, event: Told, stamp: Timestamp) -> Iterator[tuple[str, Any]]:
        """Yield what an event says, with the topic of each message."""
        for topic, plot in PLOTS.items():
            if type(event) is plot.view and (values := plot.message(event)):
                yield topic, msgspec.json.encode(values)
        if isinstance(event, Tick) and (others := further(event)):
            yield "/further", msgspec.json.encode(others)
        for name, text, tone in log_lines(event):
            yield "/log", Log(timestamp=stamp, level=LOG_LEVELS.get(tone, LogLevel.Info), name=name, message=text)
        yield from self._scene(event, stamp)

    def _scene(self, event: Told, stamp: Timestamp) -> Iterator[tuple[str, Any]]:
        """Yield what an event says of places: forest, poses and paths."""
        match event:
            case RunBegan(header=header):
                if header.world is not None:
                    self._start_m = header.world.start_m
                    yield "/forest", forest_scene(stamp, header.world)
                length_m, width_m = (header.setting("vehicle", key) for key in ("length_m", "width_m"))
                if length_m is not None and width_m is not None:
                    frames = (ROVER,) if header.world is None else (ROVER, TRUTH)
                    yield "/rover", body_scene(stamp, length_m, width_m, frames)
            case Tick():
                if (place := event.place) is not None:
                    here_m = place.east_m + self._start_m[0], place.north_m + self._start_m[1]
                    self._paths[ROVER].grow(*here_m)
                    rotation = orientation(place.heading_deg, event.pitch_deg or 0.0, event.roll_deg or 0.0)
                    yield "/pose", transform(stamp, ROVER, *here_m, rotation)
                if self._paths[ROVER].is_due(event.t_s):
                    yield from self._path("/track", ROVER, stamp)
            case Truth(x_m=x_m, y_m=y_m):
                self._paths[TRUTH].grow(x_m, y_m)
                rotation = orientation(event.heading_deg, event.pitch_deg, event.roll_deg)
                yield "/truth", transform(stamp, TRUTH, x_m, y_m, rotation)
                if self._paths[TRUTH].is_due(event.t_s):
                    yield from self._path("/truth_track", TRUTH, stamp)
            case Fix():
                yield "/location", _location(event, stamp)
            case Outcome():
                yield from self._path("/track", ROVER, stamp)
                yield from self._path("/truth_track", TRUTH, stamp)

    def _path(self, topic: str, frame: str, stamp: Timestamp) -> Iterator[tuple[str, SceneUpdate]]:
        if points := self._paths[frame].points:
            yield topic, path_scene(stamp, frame, [Point3(x=east_m, y=north_m) for east_m, north_m, _ in points])


def _location(fix: Fix, stamp: Timestamp) -> LocationFix:
    """Return a position; its error is horizontal, and says nothing of the height."""
    variance_m2, kinds = (fix.error_m or 0.0) ** 2, LocationFixPositionCovarianceType
    return LocationFix(
        timestamp=stamp,
        frame_id=ROVER,
        latitude=fix.latitude_deg,
        longitude=fix.longitude_deg,
        position_covariance=[variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, 0.0],
        position_covariance_type=kinds.Approximated if variance_m2 else kinds.Unknown,
    )


def _describe(writer: MCAPWriter, header: Header, began_ns: int) -> None:
    """Add what ran, as far as the log says it: as a metadata record, and the rover file's settings as an attachment."""
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
    writer.write_metadata("wayfarer", {key: str(value) for key, value in values.items() if value is not None})
    if header.config is not None:
        settings = msgspec.json.format(msgspec.json.encode(header.config), indent=2)
        writer.attach(
            log_time=began_ns, create_time=began_ns, name="rover.json", media_type="application/json", data=settings
        )


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

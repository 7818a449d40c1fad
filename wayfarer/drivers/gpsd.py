"""Positions from gpsd, the daemon that reads GPS receivers, for the log and for mission limits.

gpsd sends lines of JSON over TCP (gpsd_json(5)). Six fields of its TPV report are used: ``device``, ``time``, ``mode``,
``lat``, ``lon`` and ``eph``. Existing client libraries block, or reconnect by themselves and hide that gpsd is gone;
reading the lines directly is shorter than working around that.

A fix is not trusted until its own ``time`` has been seen to advance, because a receiver or a gpsd that hangs repeats
its last fix as if it were new. If ``time`` goes back, as at a correction of the week, the fix counts again when its
time advances from there.

The reports of several receivers come mixed. Each receiver is judged by its own reports only, and one is served until
it says that it has no fix, or has had no new one for ``SERVED_S``: two are some metres apart, and a hung one still
says where it once was.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from math import inf, isfinite
from typing import Annotated, Any, ClassVar

from annotated_types import Interval, Len

from wayfarer.drivers.buses import Buses
from wayfarer.errors import NotResponding, WrongPart
from wayfarer.hal import NoFix, PositionFix
from wayfarer.setting_ranges import LongSeconds

WATCH = b'?WATCH={"enable":true,"json":true};\n'
LINE_LIMIT = 65_536  # bytes; gpsd's report of a sky full of satellites is a tenth of it
ANSWER_S = 2.0
FIX_2D = 2  # TPV's mode: 0 unknown, 1 no fix, 2 without and 3 with altitude
SERVED_S = 3.0  # mission limits use no older fix (``safety.mission.FIX_FRESH_S``)
MOST_RECEIVERS = 16  # remembered; gpsd is built for 4. Chosen by us

# What a receiver lacks, the likely cause, and what to do.
NO_FIX = NoFix("has no fix", "no free view of the sky, or just switched on", "wait some minutes outdoors")
NO_TIME = NoFix(
    "sends a position without a time",
    "a position of unknown age does not count",
    "have it send its time too, in NMEA the sentence RMC; gpspipe -w shows what gpsd makes of it",
)
TIME_STANDS = NoFix(
    "has sent nothing new",
    "it hangs or is unplugged, or gpsd hangs",
    "switch its power off for a moment; sudo systemctl restart gpsd",
)
NO_RECEIVER = NoFix(
    "no receiver sends anything",
    "it is not plugged in, or gpsd does not know of it",
    "set DEVICES in /etc/default/gpsd; sudo systemctl restart gpsd",
)


@dataclass(frozen=True, slots=True)
class GpsdSettings:
    """Where gpsd listens, and how old a fix may be."""

    host: Annotated[str, Len(1, 253)] = "127.0.0.1"
    """Name or address of the computer; gpsd listens on its own one only, unless it was started with -G."""
    port: Annotated[int, Interval(ge=1, le=65_535)] = 2947
    """Number of the TCP port."""
    stale_s: LongSeconds = 3.0
    """A fix whose time has not advanced for this long is not reported any more. More than 3 s has no effect on
    ``safety.mission_radius_m``, which uses a fix for 3 s at most (``safety.mission.FIX_FRESH_S``)."""


class Receiver:
    """What one of gpsd's receivers has said; pure.

    Several reports may come for one moment, the first of them incomplete; the last one counts. ``fix`` is of the last
    report, None if it has no position or no time; ``lacks`` says what is missing unless that fix is new.
    """

    def __init__(self) -> None:
        self.fix: PositionFix | None = None
        self.lacks = NO_FIX
        self.heard_s = -inf
        self._time: str | None = None
        self._moved_on_s = -inf

    def take(self, report: dict[str, Any], t_s: float) -> None:
        """Take a TPV report that arrived at ``t_s``."""
        self.heard_s, time = t_s, report.get("time")
        if isinstance(time, str):
            if self._time is not None and time > self._time:  # ISO 8601 in UTC sorts as text
                self._moved_on_s = t_s
            self._time = time
        fix = fix_of(report, self._moved_on_s)
        self.fix = fix if isinstance(time, str) else None
        self.lacks = NO_FIX if fix is None else NO_TIME if self.fix is None else TIME_STANDS

    def fix_s(self) -> float:
        """Return the time of the fix, minus infinity if there is none."""
        return -inf if self.fix is None else self.fix.t_s


class Fixes:
    """Gets positions from the lines of gpsd; pure."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self._receivers: dict[str, Receiver] = {}
        self._served: Receiver | None = None

    def take(self, line: bytes, t_s: float) -> None:
        """Take a line that arrived at ``t_s``; a line that is not a TPV report changes nothing."""
        report = parse(line)
        if report.get("class") != "TPV":
            return
        device, receivers = str(report.get("device", "the receiver")), self._receivers
        if device not in receivers and len(receivers) >= MOST_RECEIVERS:
            del receivers[min(receivers, key=lambda each: receivers[each].heard_s)]
        receivers.setdefault(device, Receiver()).take(report, t_s)

    def latest(self, t_s: float) -> PositionFix | None:
        """Return the fix that holds at ``t_s``, of the receiver that is served, or None."""
        if self._served is None or not t_s - self._served.fix_s() <= min(self._stale_s, SERVED_S):
            self._served = max(self._receivers.values(), key=Receiver.fix_s, default=None)
        if self._served is None or t_s - self._served.fix_s() > self._stale_s:
            return None
        return self._served.fix

    def why_none(self) -> NoFix:
        """Return why there is no fix: what each receiver lacks, and what to do about one of them."""
        if not self._receivers:
            return NO_RECEIVER
        lacks = {device: receiver.lacks for device, receiver in self._receivers.items()}
        one = min(lacks.values(), key=(NO_TIME, NO_FIX, TIME_STANDS).index)
        return one._replace(found=", ".join(f"{device} {each.found}" for device, each in lacks.items()))


def parse(line: bytes) -> dict[str, Any]:
    """Return the JSON object on a line, all numbers as float; empty if there is none."""
    try:
        report = json.loads(line, parse_int=float)
    except (ValueError, RecursionError):  # also no UTF-8; brackets without end
        return {}
    return report if isinstance(report, dict) else {}


def fix_of(report: dict[str, Any], t_s: float) -> PositionFix | None:
    """Return the position in a TPV report, and its time, or None if it has none. The error is ``eph``, in metres."""
    mode, latitude_deg, longitude_deg, error_m = (number(report, key) for key in ("mode", "lat", "lon", "eph"))
    if mode is None or mode < FIX_2D or latitude_deg is None or longitude_deg is None:
        return None
    if abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0:
        return None
    error_m = error_m if error_m is not None and error_m >= 0.0 else None
    return PositionFix(t_s, latitude_deg, longitude_deg, error_m, _utc_s(report.get("time")))


def _utc_s(time: object) -> float | None:
    """Return the time of a report (ISO 8601, UTC) in seconds since 1970, None if it is none."""
    try:
        moment = datetime.fromisoformat(str(time))
    except ValueError:  # also the second 60 of a leap second
        return None
    return None if moment.tzinfo is None else moment.timestamp()


def number(report: dict[str, Any], key: str) -> float | None:
    """Return a finite number, or None if it is missing, NaN or infinite: that must not become 0."""
    value = report.get(key)
    return value if isinstance(value, float) and isfinite(value) else None


class Gpsd:
    """A client of gpsd as a ``hal.PositionReceiver``; ``t_s`` of a fix is when it arrived, tenths of a second late."""

    part: ClassVar[str] = "position"
    Settings = GpsdSettings

    def __init__(self, settings: GpsdSettings, _buses: Buses) -> None:
        self.name = f"gpsd at {settings.host}:{settings.port}"
        self._settings = settings
        self._fixes = Fixes(settings.stale_s)
        self._writer: asyncio.StreamWriter | None = None
        self._follower: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Connect, make sure that it is gpsd, and ask for reports; takes 2 s at most.

        Raises:
            NotResponding: nothing listens there, or it sends nothing.
            WrongPart: what listens there is not gpsd.
        """
        await self.close()
        try:
            async with asyncio.timeout(ANSWER_S):
                reader = await self._connect()
        except (OSError, ValueError) as error:  # a name may not be a name of a host
            await self.close()
            reason = str(error) or f"no answer within {ANSWER_S:g} s"  # the error of a timeout has no text
            raise NotResponding(
                f"{self.name}: {reason}; is it installed and running? sudo apt install gpsd; systemctl status gpsd"
            ) from None
        except BaseException:
            await self.close()
            raise
        self._fixes = Fixes(self._settings.stale_s)
        self._follower = asyncio.create_task(self._follow(reader), name=self.name)

    async def identify(self) -> None:
        """Connect, make sure that it is gpsd, and hang up; raises as ``open``."""
        await self.open()
        await self.close()

    async def close(self) -> None:
        """Close the connection."""
        follower, self._follower = self._follower, None
        if follower is not None:
            follower.cancel()
            await asyncio.wait([follower])
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.transport.abort()  # nothing is left to send, and a peer that hangs must not delay this
            with suppress(OSError):
                await writer.wait_closed()

    async def read(self) -> PositionFix | None:
        """Return the latest fix, or None while there is none; never waits.

        Raises:
            NotResponding: the connection is gone.
        """
        if self._follower is None:
            raise NotResponding(f"{self.name}: not open")
        if self._follower.done():
            raise NotResponding(f"{self.name}: has closed the connection; was it stopped? systemctl status gpsd")
        return self._fixes.latest(asyncio.get_running_loop().time())

    def why_no_fix(self) -> NoFix:
        """Return what its receivers lack; see ``hal.ExplainsNoFix``."""
        return self._fixes.why_none()

    async def _connect(self) -> asyncio.StreamReader:
        settings = self._settings
        reader, self._writer = await asyncio.open_connection(settings.host, settings.port, limit=LINE_LIMIT)
        try:
            greeting = await reader.readline()
        except ValueError:
            raise WrongPart(self.name, "gpsd's VERSION", f"more than {LINE_LIMIT} bytes without a line end") from None
        if not greeting:
            raise ConnectionResetError("it closed the connection without an answer")
        if parse(greeting).get("class") != "VERSION":
            raise WrongPart(self.name, "gpsd's VERSION", repr(greeting[:40]))
        self._writer.write(WATCH)
        return reader

    async def _follow(self, reader: asyncio.StreamReader) -> None:
        """Take the lines that arrive until the connection ends."""
        time = asyncio.get_running_loop().time
        with suppress(OSError):
            while not reader.at_eof():
                with suppress(ValueError):  # a line beyond the limit is dropped; its rest is not a report
                    self._fixes.take(await reader.readline(), time())

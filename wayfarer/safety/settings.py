"""Settings of the safety package: sections ``safety``, ``manual``, ``board`` and ``progress`` of a rover file.

They stand apart from the logic that reads them, because the logic is compiled and pydantic needs plain Python classes.
What a field means is written below it; ``python -m docs.generate`` makes the schema of rover files from that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, MaxLen

from wayfarer.setting_ranges import (
    Count,
    DegreesPerSecond,
    Hertz,
    LongSeconds,
    MetresPerSecond,
    ShortSeconds,
    SmallAngle,
    StrideMetres,
    Volts,
)


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """Limits at the gate, and what arming demands."""

    duty_max: Annotated[float, Interval(gt=0, le=1)] = 1.0
    """Highest duty of a side, as a share of full duty."""
    slew_per_s: Annotated[float, Interval(ge=0.1, le=100)] = 8.0
    """How fast a duty may grow, in shares of full duty per second. Motors that start too fast can reset the computer,
    the most frequent problem of such rovers. A stop is not limited."""
    tick_late_s: ShortSeconds = 0.2
    """Age from which a control tick is late: its command becomes a stop, a condition says so, and no more than this
    time counts as driven. Below the shortest deadman of a board, 0.25 s."""
    mission_time_s: Annotated[float, Interval(ge=1, le=86_400)] = 3600.0
    """A mission ends after this time."""
    mission_distance_m: Annotated[float, Interval(ge=1, le=1_000_000)] = 2000.0
    """A mission ends after this commanded distance."""
    mission_radius_m: Annotated[float, Interval(ge=1, le=1_000_000)] = 300.0
    """A mission ends at this distance from its start. Needs a receiver, [parts.position]."""
    start_delay_s: Annotated[float, Interval(ge=0, le=600)] = 10.0
    """Between arming and the first turn of a wheel: time to step away."""
    resume_warning_s: Annotated[float, Interval(ge=0, le=60)] = 1.0
    """How long the status light warns before a rover that held its wheels by itself, for more than a second, lets them
    turn again; 0 for no warning."""
    on_lost_sense: Literal["continue", "hold"] = "continue"
    """Whether a rover that has lost its compass, motion or contact sensor, or whose supply sags again and again,
    continues with limits, or holds its wheels; and whether one whose motor board failed opens it again or waits for a
    person. "hold" is for a rover that drives among people."""
    settle_s: ShortSeconds = 1.0
    """Arming waits until the heading has stayed within ``settle_spread_deg`` for this time. Chosen by us."""
    settle_spread_deg: SmallAngle = 3.0
    """See ``settle_s``. Chosen by us."""
    calibration_min: Annotated[int, Interval(ge=0, le=3)] = 2
    """Lowest calibration level of the compass, 0 to 3, at which the rover is armed."""
    allow_no_deadman: bool = False
    """Arm a rover whose motor board has no deadman: nothing stops its wheels if the computer fails."""
    deadman_unproved_because: Annotated[str, MaxLen(200)] = ""
    """Why nobody has seen the deadman of a board stop the wheels that cannot report it; shown at each arming. Without
    a reason a person must see it (``wayfarer check``)."""


@dataclass(frozen=True, slots=True)
class ManualSettings:
    """Driving by a person, on the live page's pad."""

    allowed: bool = False
    """Let a person drive the rover by hand. ``wayfarer run --manual`` allows it for one run."""
    deadman_s: Annotated[float, Interval(ge=0.1, le=1)] = 0.3
    """The wheels are stopped if the newest sample of keys, finger or stick is older. ROSbot and LeKiwi allow 0.5 s, in
    which a rover goes 0.5 m at 1 m/s; 0.3 s is enough for the jitter of a wireless link."""
    speed_m_s: MetresPerSecond | None = None
    """Speed at full deflection; without it ``cruise_m_s`` of [escape]."""
    turn_deg_s: DegreesPerSecond | None = None
    """Turn rate at full deflection; without it ``turn_deg_s`` of [escape]."""


@dataclass(frozen=True, slots=True)
class BoardSettings:
    """Limits of the motor board. The times are those of the fault catalogue, fault 31 (ArduPilot waits 10 s)."""

    battery_low_v: Volts | None = None
    """A battery below this voltage is reported, and the rover continues; without a value it is not checked."""
    battery_critical_v: Volts | None = None
    """Below this voltage the rover stops for good; without a value it is not checked."""
    battery_low_s: LongSeconds = 10.0
    """For how long the battery must be below ``battery_low_v``."""
    battery_critical_s: LongSeconds = 5.0
    """For how long the battery must be below ``battery_critical_v``."""
    health_hz: Hertz = 4.0
    """How often the board is asked. A drive fault that it reports twice in a row stops the wheels within 0.5 s (fault
    26); twice, because a flag that is set at power-up takes a moment to clear."""

    def __post_init__(self) -> None:
        low_v, critical_v = self.battery_low_v, self.battery_critical_v
        if low_v is not None and critical_v is not None and critical_v >= low_v:
            raise ValueError(f"battery_critical_v = {critical_v:g} must be below battery_low_v = {low_v:g}")


@dataclass(frozen=True, slots=True)
class EntrapmentSettings:
    """When a rover makes no progress: fault catalogue, fault 57.

    A rover that has no free run for too long climbs the ladder of ``escape.recovery``.

    The catalogue asks for 12 anomalies or 60 s. Of 1,660 simulated trials with all ten algorithms (21 November 2026),
    1,571 got out: with Forest-Pledge after 8 anomalies without a free run and 13 s at most, in a Lévy walk after 17 and
    48 s. So the 60 s are kept, less 1 s for the reaction, and 12 anomalies would be too few.
    """

    anomalies_max: Count = 24
    """Number of anomalies without a free run between them after which it makes no progress."""
    give_up_s: Annotated[float, Interval(ge=1, le=3600)] = 59.0
    """Time in which the wheels were commanded to turn, without a free run, after which it makes no progress."""
    anomaly_every_s: ShortSeconds = 0.5
    """Anomalies are counted at most once in this time."""
    free_run_m: StrideMetres = 0.2
    """A free run is so far commanded ahead without an anomaly."""
    covered_m: Annotated[float, Interval(ge=0.001, le=1)] = 0.02
    """What the motion sensor must see of a free run. Its largest readings are not counted, so that single wild readings
    are not progress."""
    give_up: bool = False
    """End the mission with a fault if there is no progress, instead of climbing the ladder."""

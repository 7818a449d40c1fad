"""Settings of the safety package: sections ``safety``, ``board`` and ``progress`` of a rover file.

They stand apart from the logic that reads them, because the logic is compiled and pydantic needs plain Python classes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, MaxLen

from wayfarer.setting_ranges import Count, Hertz, Metres, Seconds

Volts = Annotated[float, Interval(gt=0, le=60)]


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """Limits at the gate, and what arming demands.

    ``slew_per_s`` limits how fast a duty may grow, because motors that start too fast can reset the computer, the most
    frequent problem of such rovers. ``mission_*`` are limits that end a mission. A rover whose compass is
    calibrated to less than ``calibration_min`` (0 to 3) is not armed. A rover whose motor board has no deadman is armed
    only with ``allow_no_deadman``. A board that has one but cannot report it needs a person who has seen it stop the
    wheels (``wayfarer check``), or a reason why nobody has in ``deadman_unproved_because``, which is shown at each
    arming. Arming waits until the heading has stayed within ``settle_spread_deg`` for ``settle_s``; both from no
    source. ``tick_late_s`` is the age from which a tick is late: its command becomes a stop, a condition says so, and
    no more than this time counts as driven; below the shortest deadman of a board, 0.25 s. ``resume_warning_s`` is how
    long the status light warns before a rover that held its wheels by itself, for more than a second, lets them turn
    again; 0 for no warning. ``on_lost_sense`` says whether a rover that has lost its compass, motion or contact sensor,
    or whose supply sags again and again, continues with limits, or holds its wheels, and whether one whose motor board
    failed opens it again or waits for a person: "hold" is for a rover that drives among people.
    """

    duty_max: Annotated[float, Interval(gt=0, le=1)] = 1.0
    slew_per_s: Annotated[float, Interval(gt=0, le=1000)] = 8.0
    tick_late_s: Seconds = 0.2
    mission_time_s: Seconds = 3600.0
    mission_distance_m: Annotated[float, Interval(gt=0, le=1_000_000)] = 2000.0
    mission_radius_m: Annotated[float, Interval(gt=0, le=1_000_000)] = 300.0
    start_delay_s: Annotated[float, Interval(ge=0, le=600)] = 10.0
    resume_warning_s: Annotated[float, Interval(ge=0, le=60)] = 1.0
    on_lost_sense: Literal["continue", "hold"] = "continue"
    settle_s: Seconds = 1.0
    settle_spread_deg: Annotated[float, Interval(gt=0, le=180)] = 3.0
    calibration_min: Annotated[int, Interval(ge=0, le=3)] = 2
    allow_no_deadman: bool = False
    deadman_unproved_because: Annotated[str, MaxLen(200)] = ""


@dataclass(frozen=True, slots=True)
class BoardSettings:
    """Limits of the motor board.

    A battery below ``battery_low_v`` for ``battery_low_s`` is reported, and the rover continues. Below
    ``battery_critical_v`` for ``battery_critical_s`` it stops. The times are those of the fault catalogue, fault 31
    (ArduPilot waits 10 s). A limit of None is not checked. The board is asked at ``health_hz``. A drive fault that it
    reports twice in a row stops the wheels within 0.5 s (fault 26); twice, because a flag that is set at power-up takes
    a moment to clear.
    """

    battery_low_v: Volts | None = None
    battery_critical_v: Volts | None = None
    battery_low_s: Seconds = 10.0
    battery_critical_s: Seconds = 5.0
    health_hz: Hertz = 4.0

    def __post_init__(self) -> None:
        low_v, critical_v = self.battery_low_v, self.battery_critical_v
        if low_v is not None and critical_v is not None and critical_v >= low_v:
            raise ValueError(f"battery_critical_v = {critical_v:g} must be below battery_low_v = {low_v:g}")


@dataclass(frozen=True, slots=True)
class EntrapmentSettings:
    """When a rover makes no progress: fault catalogue, fault 57.

    A free run is ``free_run_m`` commanded ahead without an anomaly, of which the motion sensor sees ``covered_m``. Its
    largest readings are not counted, so that single wild readings are no progress. Without such a run, after
    ``anomalies_max`` anomalies, counted at most once in ``anomaly_every_s``, or after ``give_up_s`` in which the wheels
    were commanded to turn, the rover climbs the ladder of ``escape.ladder``. With ``give_up`` it ends its mission with
    a fault instead.

    The catalogue asks for 12 anomalies or 60 s. Of 1,660 simulated trials with all ten algorithms, 1,571 got out: with
    Forest-Pledge after 8 anomalies without a free run and 13 s at most, in a Lévy walk after 17 and 48 s. So the 60 s
    are kept, less 1 s for the reaction, and 12 anomalies would be too few.
    """

    anomalies_max: Count = 24
    give_up_s: Seconds = 59.0
    anomaly_every_s: Seconds = 0.5
    free_run_m: Metres = 0.2
    covered_m: Metres = 0.02
    give_up: bool = False

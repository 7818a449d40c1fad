"""What takes the wheels from the algorithm, or ends its mission: a place that it does not leave, reversed sides."""

from __future__ import annotations

from math import inf

from tests.control.bench import TICK_S, Bench
from wayfarer.config.rover_file import load_rover
from wayfarer.control.run_log import RunLog
from wayfarer.control.tick import TickRecord
from wayfarer.escape.recovery import BLIND_DETOUR, UNSEEN_S
from wayfarer.experiments.campaign import Campaign, Task
from wayfarer.experiments.trial import run_watched
from wayfarer.hal import MotionReading, WheelCommand
from wayfarer.safety.conditions import Condition
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.faults.world import Drive
from wayfarer.simhal.world.physics import GroundName


class Seen(RunLog):
    """Remembers the conditions and decisions of a trial."""

    def __init__(self) -> None:
        self.conditions: set[Condition] = set()
        self.whys: set[str] = set()

    def tick(self, record: TickRecord) -> None:
        self.conditions.update(record.conditions)
        self.whys.add(record.decision.why)


def trial(drive: Drive) -> tuple[str, Seen]:
    """A trial on dry soil in which the sides change after ten seconds; return its outcome and what was seen."""
    campaign = Campaign(("forest-pledge",), trials=1, rover=load_rover("sim"), seed=1000, ground=GroundName.dry_soil)
    spec, seen = campaign.spec(Task("forest-pledge", 0), campaign.make_forest(0)), Seen()
    faulty = spec.__class__(
        **{name: getattr(spec, name) for name in spec.__slots__}
        | {"faults": (Fault(10.0, inf, "world", "drive", drive),)}
    )
    return run_watched(faulty, lambda *_: seen).outcome, seen


def test_rover_with_reversed_sides_is_stopped() -> None:
    outcome, seen = trial(Drive(left_gain=-1.0, right_gain=-1.0))
    assert outcome == "fault"
    assert Condition.DRIVE_REVERSED in seen.conditions


async def to_and_fro(bench: Bench, for_s: float) -> None:
    """Drive half a metre ahead and back, again and again: each way is a free run."""
    for n in range(round(for_s / TICK_S)):
        sign = 1.0 if n // 20 % 2 == 0 else -1.0
        bench.handler.wheels = WheelCommand(0.5 * sign, 0.5 * sign)
        moved_m = (bench.controller.last.applied.left if bench.controller.last else 0.0) * TICK_S
        bench.inbox.put_motion(MotionReading(bench.t_s + TICK_S, moved_m, 1e-4 * (n % 3), 1.0))
        await bench.tick()


async def test_rover_that_stays_at_one_place_climbs_the_ladder_though_it_has_free_runs() -> None:
    bench = await Bench().armed()
    await to_and_fro(bench, 110.0)
    assert Condition.NO_PROGRESS not in bench.controller.conditions
    await to_and_fro(bench, 20.0)
    assert any(Condition.NO_PROGRESS in tick.conditions for tick in bench.log.ticks)


async def blind(bench: Bench, for_s: float) -> list[str]:
    """Drive for so long without sight; return what was decided."""
    whys = []
    for _ in range(round(for_s / TICK_S)):
        bench.handler.wheels = WheelCommand(0.5, 0.5)
        bench.inbox.put_motion(MotionReading(bench.t_s + TICK_S, 0.0, 0.0, 0.0))
        await bench.tick()
        assert bench.controller.last is not None
        whys.append(bench.controller.last.decision.why)
    return whys


async def test_rover_that_is_driven_long_without_sight_makes_a_detour_and_goes_on() -> None:
    bench = await Bench(watches_motion=True).armed()
    assert set(await blind(bench, UNSEEN_S - 1.0)) == {"follow"}
    whys = await blind(bench, 12.0)
    assert BLIND_DETOUR.name in whys
    assert whys[-1] == "follow"
    assert Condition.NO_PROGRESS not in bench.controller.conditions

"""Ground truth in the log of a simulated run: the rover's true pose and what happens to it."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees, inf

from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.fieldlog.log import FieldLog
from wayfarer.simhal.faults.kinds import Fault
from wayfarer.simhal.world.simulated_world import SimulatedWorld

TICKS_A_RECORD = 4  # a fifth of a second at 20 Hz: plenty to draw a path


class GroundTruthLog(PartialLog):
    """Writes ``truth`` beside the ticks: regularly, and whenever the rover begins or ceases to slip or to touch.

    Injected faults are ground truth too: ``note`` writes ``fault`` when one begins or ends.
    """

    def __init__(self, log: FieldLog, world: SimulatedWorld) -> None:
        self._log = log
        self._world = world
        self._ticks = 0
        self._last = (False, False)

    def tick(self, record: TickRecord) -> None:
        """Look at the world at a control tick."""
        world = self._world
        happening = (world.slipping, world.touch is not None)
        if self._ticks % TICKS_A_RECORD == 0 or happening != self._last:
            self._log.note("truth", record.t_s, _truth(world))
        self._ticks += 1
        self._last = happening

    def note(self, t_s: float, fault: Fault, *, begins: bool) -> None:
        """Take the beginning of a fault, or its end; implements ``simhal.faults.injector.NoteFault``."""
        about = {"target": fault.target, "kind": fault.kind, "begins": begins}
        lasting_s = fault.for_s if fault.for_s < inf else None
        self._log.note("fault", t_s, {**about, "for_s": lasting_s, "params": asdict(fault.params)})


def _truth(world: SimulatedWorld) -> dict[str, float | bool]:
    """Return the pose in the forest's own metres, x east and y north, and what holds the rover."""
    return {
        "x_m": round(world.x_m, 4),
        "y_m": round(world.y_m, 4),
        "heading_deg": round(degrees(world.heading_rad) % 360.0, 2),
        "pitch_deg": round(world.pitch_deg, 2),
        "roll_deg": round(world.roll_deg, 2),
        "slipping": world.slipping,
        "touching": world.touch is not None,
    }

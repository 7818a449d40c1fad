"""The state machine of an escape: every phase, every event that ends one, and the next phase.

Theory of operation
-------------------
A blind rover holds its goal heading (``FOLLOW``) until something is wrong: it does not move, it tilts, it touches.
That starts an *episode*. The rover backs off a little, turns away on the spot, and then one of two families takes over.

The *Pledge* family (paper, section III-A) counts how far it has turned since the episode began: the counter C, in
degrees, clockwise positive, taken from the compass, so a turn that was blocked half-way counts half. Then it drives a
curve back against the turn (``PROBE``), feeling for the end of the obstacle as a hand feels along a wall. Each new
anomaly backs off, turns away and adds to C; each metre of curve takes from it. When C is back at zero the rover has
unwound every turn it made and the way towards the goal was free to curve into: it follows the goal again. Counting
turns, not only looking where the nose points, is what frees it from spirals and pockets. *Forest-Pledge* also ends the
episode whenever the heading comes within 5 degrees of the goal, whole turns forgiven: shorter in clutter, at the
price of Pledge's guarantee.

The *stochastic* and *reactive* families drive a straight piece in the new direction instead (``STRIDE``) and then
follow the goal again. They remember nothing, which is why they stay in pockets.

Every phase is bounded in time and in commanded distance. Running out is an event like any other (``EXHAUSTED``), so a
rover whose reverse is blocked, or whose wheels spin in place, goes on to the next manoeuvre instead of grinding.

A counter beyond three turns is forgotten (``OVERWOUND``), whatever the phase: a compass that drifts, or a spiral that
no forest has, would otherwise have the rover unwind for ever.

Every transition is in ``PLEDGE`` and ``STRIDES`` below, and nowhere else. The event's name, with the phase it ended,
is the ``why`` of the decision and of the log: ``probe.unwound``, ``turn_away.exhausted``.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final

from wayfarer.escape.api import Phase


class PhaseEvent(Enum):
    """What ends a phase."""

    ANOMALY = "anomaly"  # something new is wrong
    DONE = "done"  # the manoeuvre did what it was meant to do
    UNWOUND = "unwound"  # the counter came back to zero
    REALIGNED = "realigned"  # the heading came back to the goal, whole turns forgiven
    EXHAUSTED = "exhausted"  # out of time or distance
    OVERWOUND = "overwound"  # the counter can no longer be true


Transitions = Mapping[tuple[Phase, PhaseEvent], Phase]

_SHARED: Final[Transitions] = {
    **{(phase, PhaseEvent.OVERWOUND): Phase.FOLLOW for phase in (Phase.FOLLOW, Phase.BACK_OFF, Phase.TURN_AWAY)},
    (Phase.FOLLOW, PhaseEvent.ANOMALY): Phase.BACK_OFF,
    # FOLLOW runs out when it cannot turn to the goal: something holds the tail or the side.
    (Phase.FOLLOW, PhaseEvent.EXHAUSTED): Phase.BACK_OFF,
    (Phase.BACK_OFF, PhaseEvent.DONE): Phase.TURN_AWAY,
    # Blocked behind as well: go on with the turn, do not grind.
    (Phase.BACK_OFF, PhaseEvent.ANOMALY): Phase.TURN_AWAY,
    (Phase.BACK_OFF, PhaseEvent.EXHAUSTED): Phase.TURN_AWAY,
    (Phase.TURN_AWAY, PhaseEvent.ANOMALY): Phase.BACK_OFF,
}

PLEDGE: Final[Transitions] = {
    **_SHARED,
    (Phase.TURN_AWAY, PhaseEvent.DONE): Phase.PROBE,
    (Phase.TURN_AWAY, PhaseEvent.EXHAUSTED): Phase.PROBE,
    (Phase.PROBE, PhaseEvent.ANOMALY): Phase.BACK_OFF,
    (Phase.PROBE, PhaseEvent.UNWOUND): Phase.FOLLOW,
    (Phase.PROBE, PhaseEvent.REALIGNED): Phase.FOLLOW,
    # The heading does not follow the curve (one side dead, wheels spinning): steer to the goal instead.
    (Phase.PROBE, PhaseEvent.EXHAUSTED): Phase.FOLLOW,
    (Phase.PROBE, PhaseEvent.OVERWOUND): Phase.FOLLOW,
}

STRIDES: Final[Transitions] = {
    **_SHARED,
    (Phase.TURN_AWAY, PhaseEvent.DONE): Phase.STRIDE,
    (Phase.TURN_AWAY, PhaseEvent.EXHAUSTED): Phase.STRIDE,
    (Phase.STRIDE, PhaseEvent.ANOMALY): Phase.BACK_OFF,
    (Phase.STRIDE, PhaseEvent.DONE): Phase.FOLLOW,
    (Phase.STRIDE, PhaseEvent.EXHAUSTED): Phase.FOLLOW,
    (Phase.STRIDE, PhaseEvent.OVERWOUND): Phase.FOLLOW,
}

# Interned once: the control tick must not build strings.
WHY: Final[Mapping[tuple[Phase, PhaseEvent], str]] = {
    (phase, event): f"{phase.value}.{event.value}" for phase in Phase for event in PhaseEvent
}

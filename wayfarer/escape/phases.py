"""The state machine of an escape: every phase, every event that ends one, and the next phase.

Theory of operation
-------------------
A blind rover holds its goal heading (``FOLLOW``) until there is an anomaly: it is stuck, tilts, or touches something.
That starts an *episode*. The rover backs off a little and turns away on the spot. What follows depends on the family of
the algorithm.

The *Pledge* family counts how far it has turned since the episode began: the counter C, in degrees, clockwise
positive. This is Algorithm 2 of the paper in our words, and where each line is here::

    1  given: a side tau and an angle theta       EscapePlan.side, .turn_deg; chosen by PhasedHandler._plan
    2  C = 0                                      PhasedHandler._plan, if the episode is new
    3  reverse from the obstacle                  BACK_OFF
    4  turn to tau by theta, on the spot          TURN_AWAY
    5  C = C + theta                              EscapePlan.counter_deg, in PhasedHandler.decide, by the compass
    6  while C is not 0:                          Probe.event: UNWOUND if C is back at 0, then FOLLOW
    7      if there is no anomaly:                Probe.event: ANOMALY if there is a new one
    8          drive a curve against tau          PROBE
    9          C = C - what the heading changed   as line 5
    11-13  else: as lines 3 to 5                  BACK_OFF, TURN_AWAY, and so on

Counting turns, instead of looking at the heading only, lets it leave spirals and pockets. *Forest-Pledge* also ends the
episode when the heading comes within 5 degrees of the goal heading, with any number of whole turns (``REALIGNED``).
This is shorter among many obstacles, but loses Pledge's guarantee. The variants choose tau or theta in another way
(``catalogue``).

Every phase has bounds, which Algorithm 2 has not (below). Six more things differ; the last is the paper's released
simulator's, the others are chosen by us:

1. An episode also begins without an anomaly: ``FOLLOW`` is exhausted if the rover cannot turn to the goal.
2. After two blocked turns in a row tau alternates, beginning with the other side
   (``handler.BLOCKED_TURNS_BEFORE_ALTERNATING``). It is tau again as soon as the turn is over.
3. How far line 3 backs off goes with the number of blocked turns: all of it, a half, a quarter, and again
   (``handler.BACK_OFF_SHARES``).
4. If the way back is blocked, or takes too long, the turn follows at once: the rover does not push.
5. C is the heading gained by the compass, in all phases, not theta: a turn that was blocked half-way counts half.
   Beyond three turns (``handler.COUNTER_MAX_DEG``) it is forgotten, and the rover follows the goal (``OVERWOUND``):
   otherwise a compass that drifts could make it take back turns for ever.
6. A probe begins with a straight piece (``probe_straight_m``), before the arc of line 8.

The *stochastic* and *reactive* families drive straight ahead in the new direction instead (``STRIDE``) and then follow
the goal again. They have no memory and can therefore stay in pockets.

Every phase is bounded in time and in commanded distance. Reaching a bound is an event like any other (``EXHAUSTED``),
so a rover whose way back is blocked, or whose wheels spin, continues with the next manoeuvre.

All transitions are in ``PLEDGE`` and ``STRIDES`` below. The phase that ended and the event that ended it are the
``why`` of the decision and of the log: ``probe.unwound``, ``turn_away.exhausted``.
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
    REALIGNED = "realigned"  # the heading came back to the goal heading; whole turns are ignored
    EXHAUSTED = "exhausted"  # out of time or distance
    OVERWOUND = "overwound"  # the counter is beyond three turns, which cannot be true


Transitions = Mapping[tuple[Phase, PhaseEvent], Phase]

_SHARED: Final[Transitions] = {
    **{(phase, PhaseEvent.OVERWOUND): Phase.FOLLOW for phase in (Phase.FOLLOW, Phase.BACK_OFF, Phase.TURN_AWAY)},
    (Phase.FOLLOW, PhaseEvent.ANOMALY): Phase.BACK_OFF,
    # FOLLOW is exhausted when the rover cannot turn to the goal: something holds its rear or its side.
    (Phase.FOLLOW, PhaseEvent.EXHAUSTED): Phase.BACK_OFF,
    (Phase.BACK_OFF, PhaseEvent.DONE): Phase.TURN_AWAY,
    # Blocked behind as well: continue with the turn, do not push.
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

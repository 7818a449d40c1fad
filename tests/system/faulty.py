"""A third party's algorithm with a bug: it raises when it has to decide, and that is only once armed."""

from __future__ import annotations

from collections.abc import Mapping

from wayfarer.escape.api import Decision, Observation
from wayfarer.escape.catalogue import Algorithm


class Faulty:
    """A handler that cannot decide."""

    def decide(self, observation: Observation) -> Decision:
        raise ZeroDivisionError("the bug of a third party")

    def reset(self) -> None:
        pass

    def memory(self) -> Mapping[str, float | str]:
        return {"counter_deg": 0.0, "episodes": 0.0}


FAULTY = Algorithm("faulty", "test", "raises at its first decision", lambda settings, vehicle, rng: Faulty())

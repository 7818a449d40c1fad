"""``make_handler``: an escape algorithm for another robot's own loop. Needs no simulator and no drivers."""

from __future__ import annotations

from random import Random

from wayfarer.config.registry import find_algorithm
from wayfarer.escape.api import EscapeHandler
from wayfarer.escape.settings import EscapeSettings, Vehicle


def make_handler(
    algorithm: str = "forest-pledge",
    *,
    vehicle: Vehicle,
    settings: EscapeSettings | None = None,
    seed: int | None = None,
) -> EscapeHandler:
    """Return an escape algorithm that is ready for its first tick.

    Call its ``decide`` once a control tick with an ``Observation``, and give the wheel duties of the decision, left and
    right, each -1 to 1 of ``vehicle.max_speed_m_s``, to your motors. Or let a ``FailSafe`` call it.

    Args:
        algorithm: a name that ``wayfarer list`` prints, or one of your own as ``"module:attribute"``.
        vehicle: the measures of the body, metres, and its top speed, metres a second.
        settings: distances, angles and speeds of the manoeuvres; the paper's by default.
        seed: of the algorithms that draw at random. Without it each handler draws differently.

    Raises:
        BadInput: no such algorithm; the text offers the nearest names.

    >>> vehicle = Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2)
    >>> handler = make_handler("forest-pledge", vehicle=vehicle)
    >>> seen = Observation(0.0, 10.0, 0.0, 0.0, (Anomaly.IMMOBILISED,), None, goal_heading_deg=10.0, travelled_m=0.0)
    >>> decision = handler.decide(seen)
    >>> decision.phase.value, decision.wheels.left < 0.0
    ('back_off', True)
    """
    return find_algorithm(algorithm).make(settings or EscapeSettings(), vehicle, Random(seed))

"""``make_handler``: an escape algorithm for another robot's own loop. Needs no simulator and no drivers."""

from __future__ import annotations

from operator import index
from random import Random
from typing import SupportsIndex

from wayfarer.config.registry import find_algorithm
from wayfarer.errors import BadInput, MissingPart
from wayfarer.escape.api import EscapeHandler
from wayfarer.escape.catalogue import BUILT_IN, CONTACT, NOTHING
from wayfarer.escape.settings import EscapeSettings, Vehicle


def make_handler(
    algorithm: str = "forest-pledge",
    *,
    vehicle: Vehicle,
    settings: EscapeSettings | None = None,
    seed: SupportsIndex | None = None,
    contact: bool = False,
) -> EscapeHandler:
    """Return an escape algorithm that is ready for its first tick.

    Call its ``decide`` once per control tick with an ``Observation``, and give the wheel duties of the decision, left
    and right, each -1 to 1 of ``vehicle.max_speed_m_s``, to your motors. Or let a ``FailSafe`` call it.

    Args:
        algorithm: a name that ``wayfarer list`` prints, or one of your own as ``"FILE.py:NAME"`` or
            ``"module:attribute"``.
        vehicle: the measures of the body, metres, and its top speed, metres per second.
        settings: distances, angles and speeds of the manoeuvres; the paper's by default.
        seed: of the algorithms that draw at random. Without it each handler draws differently.
        contact: whether your observations have a ``contact``, which some algorithms need. Those of a ``FailSafe`` have
        none.

    Raises:
        BadInput: no such algorithm (the text offers the nearest names), or something else that is none of these.
        MissingPart: the algorithm needs a contact sensor, or another part that ``Observation`` does not have.

    >>> vehicle = Vehicle(length_m=0.6, width_m=0.5, track_m=0.6, max_speed_m_s=1.2)
    >>> handler = make_handler("forest-pledge", vehicle=vehicle)
    >>> seen = Observation(0.0, 10.0, 0.0, 0.0, (Anomaly.IMMOBILISED,), None, goal_heading_deg=10.0, travelled_m=0.0)
    >>> decision = handler.decide(seen)
    >>> decision.phase.value, decision.wheels.left < 0.0
    ('back_off', True)
    """
    for name, value, kind in (("algorithm", algorithm, str), ("vehicle", vehicle, Vehicle)):
        if not isinstance(value, kind):
            raise BadInput(f"make_handler: {name} = {value!r:.80} is not a {kind.__name__}")
    if not isinstance(settings, EscapeSettings | None):
        raise BadInput(f"make_handler: settings = {settings!r:.80} is not an EscapeSettings")
    try:
        rng = Random(seed if seed is None else index(seed))
    except TypeError:
        raise BadInput(f"make_handler: seed = {seed!r:.80} is not a whole number") from None
    found = find_algorithm(algorithm)
    if missing := sorted(found.requires - (CONTACT if contact else NOTHING)):
        others = ", ".join(name for name, row in BUILT_IN.items() if not row.requires)
        hint = "pass contact=True if your observations have one, or choose" if missing == ["contact"] else "choose"
        raise MissingPart(f"algorithm '{algorithm}' needs a {missing[0]} sensor: {hint} one of {others}")
    return found.make(settings or EscapeSettings(), vehicle, rng)

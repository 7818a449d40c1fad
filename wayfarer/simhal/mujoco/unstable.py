"""Turns warnings of the engine into errors."""

from __future__ import annotations

from typing import Any

import mujoco


class Unstable(ArithmeticError):
    """The engine could not work the motion out; the trial says nothing. The text has what the engine warned of."""


def refuse(data: Any, t_s: float) -> None:
    """End a trial whose motion could not be worked out up to this time.

    Raises:
        Unstable: always.
    """
    warned = (each for each in enumerate(data.warning) if each[1].number)
    texts = [mujoco.mju_warningText(kind, trouble.lastinfo) for kind, trouble in warned]
    said = " ".join(texts) or "the rover's place is not a number"
    raise Unstable(f"MuJoCo could not work out the motion up to {t_s:.3f} s: {said}")

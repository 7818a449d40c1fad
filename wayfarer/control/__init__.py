"""The control loop of the rover: control tick, sensor tasks, supervisor, and shutdown (``shutdown.py``)."""

from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec


def is_compiled() -> bool:
    """Return whether the control tick runs as C, which does the same faster; see ``hatch_build.py``."""
    controller = find_spec("wayfarer.control.controller")
    return controller is not None and str(controller.origin).endswith(tuple(EXTENSION_SUFFIXES))

"""What is installed: the version, and whether its core is compiled."""

from __future__ import annotations

from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec

from wayfarer import __version__


def version_text() -> str:
    """Return the version in words, such as ``wayfarer 0.1.0 (compiled)``."""
    return f"wayfarer {__version__} ({'compiled' if is_compiled() else 'pure Python'})"


def is_compiled() -> bool:
    """Return whether the control tick runs as C, which does the same faster; see ``hatch_build.py``."""
    controller = find_spec("wayfarer.control.controller")
    return controller is not None and str(controller.origin).endswith(tuple(EXTENSION_SUFFIXES))

"""The version of a checkout: the newest release in its changelog, marked as changed since then.

A wheel or a source distribution has its exact version in place of this file (``hatch_build.py``). A checkout has no
file that stays true from commit to commit, and asking git would start a process on a rover.
"""

from __future__ import annotations


def _of_checkout() -> str:
    """Return such as ``0.2.0+dev``; ``0+unknown`` without a changelog that has a release."""
    changelog = __file__.removesuffix("wayfarer/version.py") + "CHANGELOG.md"
    try:
        with open(changelog, encoding="utf-8") as lines:  # noqa: PTH123 - pathlib is slower to import than all this
            releases = (line[4:].partition("]")[0] for line in lines if line.startswith("## [") and line[4].isdigit())
            return f"{next(releases, '0')}+dev"
    except (OSError, UnicodeError):
        return "0+unknown"


__version__ = _of_checkout()

"""What the pages of campaigns and of sweeps share: where they go, their style, the names of their figures."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

from wayfarer.views.run_report import page
from wayfarer.views.run_report.drawing import house_style


def write_drawn(folder: Path, out: Path | None, title: str, body_of: Callable[[Path], Iterable[str]]) -> Path:
    """Write a page, its figures in the house style, and return its path: ``out``, or ``report.html`` in ``folder``.

    Raises:
        BadInput: it cannot be written there.
    """
    with house_style():
        return page.write_page(folder / page.PAGE if out is None else out, title, body_of)


def file_name(*parts: object) -> str:
    """Return a name for the file of a figure, whatever an algorithm is called."""
    return re.sub(r"[^\w.-]", "_", "-".join(map(str, parts)))

"""Style of all figures, and their output as files and as part of a page.

Text stays text, so that it can be searched, read aloud and edited. It is laid out in DejaVu Sans, which every
matplotlib brings along and which is wide: where a browser puts another font, the text takes less room, not more.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

WIDTH_IN = 6.3  # between margins on A4; also 605 px on a screen
PNG_DPI = 300
EDGE = 1.08  # room beside the first and the last value on a logarithmic axis

BLACK, GREY, PALE = "#222222", "#767676", "#d0d0d0"
# M. Okabe, K. Ito, "Color Universal Design", 2008: told apart by colour-blind readers.
BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00"

Style = dict[str, Any]  # keyword arguments of matplotlib

STYLE: dict[Any, Any] = {
    "axes.edgecolor": GREY,
    "axes.labelcolor": BLACK,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.use": True,
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Arial", "sans-serif"],
    "font.size": 8.5,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "wayfarer",  # without it every file would differ
    "text.parse_math": False,  # an algorithm may have a dollar in its name
    "xtick.color": GREY,
    "xtick.labelcolor": BLACK,
    "ytick.color": GREY,
    "ytick.labelcolor": BLACK,
}
NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))  # a date would make each page another


class Drawing(NamedTuple):
    """A figure that was saved: the name of its files, and what stands in the page."""

    name: str
    svg: str


@contextmanager
def house_style() -> Iterator[None]:
    """Draw as this module says, whatever the user's own settings of matplotlib are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def save(figure: Figure, folder: Path, name: str, alt: str) -> Drawing:
    """Write a figure as SVG and PNG, and return it for the page; ``alt`` says in words what it shows."""
    figure.savefig(folder / f"{name}.png", dpi=PNG_DPI, metadata={"Software": None})
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata=NO_METADATA)
    svg = buffer.getvalue()
    (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    return Drawing(name, _inline(svg, name, alt))


def _inline(svg: str, name: str, alt: str) -> str:
    """Return an SVG file as part of a page: it scales, is described, and its ids are its own."""
    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>\n?|<!--.*?-->\n?", "", body, flags=re.DOTALL)
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>\n?", "", body, count=1, flags=re.DOTALL)
    body = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), body)  # 0.01 pt is fine enough
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{name}-", body)
    body = re.sub(r"\n\s*", "\n", body)
    view_box = re.search(r'viewBox="[^"]*"', body)
    assert view_box is not None
    opening = f'<svg {view_box[0]} role="img" aria-label="{escape(alt)}" xmlns:xlink="http://www.w3.org/1999/xlink">'
    return opening + body[body.index(">") + 1 :]


def log_axis(axes: Axes, ticks: Sequence[float], unit: str = "") -> None:
    """Make x logarithmic, with these ticks and no other."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}" + unit))


def log_distances(axes: Axes, values: Sequence[float]) -> None:
    """Make x logarithmic with room for these values, above 0, and ticks at 1, 2, 5, 10, ..."""
    low, high = min(values, default=10.0) / EDGE, max(values, default=100.0) * EDGE
    series = [factor * 10.0**power for power in range(-3, 7) for factor in (1, 2, 5)]
    if sum(low <= tick <= high for tick in series) < 2:
        low = max([tick for tick in series if tick <= low], default=low)
        high = min([tick for tick in series if tick >= high], default=high)
    log_axis(axes, [tick for tick in series if low <= tick <= high])
    axes.set_xlim(low, high)

"""Writes the report of one field run: a page beside its log, and its figures as files."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import matplotlib

from wayfarer.errors import BadForest
from wayfarer.fieldlog.reader import Record
from wayfarer.simhal.world.forest import Forest
from wayfarer.simhal.world.forest_file import from_row
from wayfarer.views.run_report import page, words
from wayfarer.views.run_report.data import RunData
from wayfarer.views.run_report.drawing import house_style, save
from wayfarer.views.run_report.panels import panels_of
from wayfarer.views.run_report.reading import read_run
from wayfarer.views.run_report.tables import anomalies_table, episodes_table, events_list, sensors_table
from wayfarer.views.run_report.timeline import timeline_figure
from wayfarer.views.run_report.track import forest_track_figure, track_figure


def write_run_report(run: Path, out: Path | None = None) -> Path:
    """Write the report of the run in a folder, and return the page's path: ``out``, or ``report.html`` in the folder.

    The figures stand in ``figures`` beside the page. The same log gives the same bytes. A log that is damaged or cut
    off gives a page that says what is not there.

    Raises:
        BadInput: there is no log in the folder, nothing in it can be read, or the report cannot be written.
    """
    data = read_run(run)

    def body(figures: Path) -> list[str]:
        with house_style(), matplotlib.rc_context({"figure.constrained_layout.use": False}), warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"Glyph .* missing from font")  # of a mark; the page has it
            return list(_body(data, run.resolve().name, figures))

    return page.write_page(run / page.PAGE if out is None else out, words.title(data), body)


def _body(data: RunData, folder: str, figures: Path) -> Iterator[str]:
    yield page.facts(words.facts(data, folder))
    yield page.section("Track", *_tracks(data, figures))
    yield page.section("Time lines", _timeline(data, figures))
    yield page.section("Anomalies and episodes", anomalies_table(data), episodes_table(data))
    yield page.section("Events", events_list(data))
    yield page.section("Sensors", sensors_table(data))


def _tracks(data: RunData, figures: Path) -> Iterator[str]:
    """Yield the map by dead reckoning, and that of the forest where the run was simulated."""
    if data.has_way:
        drawing = save(track_figure(data), figures, "track", words.track_alt(data))
        yield page.figure(drawing, words.track_caption(data))
    else:
        yield page.paragraph(words.NO_WAY)
    forest = _forest_of(data.header)
    if forest is not None and data.truth["x_m"].size:
        drawing = save(forest_track_figure(data, forest), figures, "track-in-forest", words.forest_alt(data))
        yield page.figure(drawing, words.forest_caption(data))
    elif data.summary.simulated:
        yield page.paragraph(words.NO_FOREST)


def _forest_of(header: Record) -> Forest | None:
    """Return the forest that a simulated run was in; None where the header has none that can be read."""
    try:
        return from_row(header["world"])
    except (BadForest, LookupError, TypeError):
        return None


def _timeline(data: RunData, figures: Path) -> str:
    if not panels_of(data):
        return page.paragraph(words.NO_TICKS)
    figure, unplaced = timeline_figure(data)
    drawing = save(figure, figures, "time-lines", words.timeline_alt(data))
    return page.figure(drawing, words.timeline_caption(unplaced))

"""The report of one field run: a page beside its log, and its figures as files."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import matplotlib

from wayfarer.errors import BadForest
from wayfarer.fieldlog.reader import Record
from wayfarer.report import page, run_words
from wayfarer.report.drawing import house_style, save
from wayfarer.report.run_data import RunData
from wayfarer.report.run_panels import panels_of
from wayfarer.report.run_reading import read_run
from wayfarer.report.run_tables import anomalies_table, episodes_table, events_list, sensors_table
from wayfarer.report.run_timeline import timeline_figure
from wayfarer.report.run_track import forest_track_figure, track_figure
from wayfarer.simhal.forest import Forest
from wayfarer.simhal.forest_file import from_row


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

    return page.write_page(run / page.PAGE if out is None else out, run_words.title(data), body)


def _body(data: RunData, folder: str, figures: Path) -> Iterator[str]:
    yield page.facts(run_words.facts(data, folder))
    yield page.section("Track", *_tracks(data, figures))
    yield page.section("Time lines", _timeline(data, figures))
    yield page.section("Anomalies and episodes", anomalies_table(data), episodes_table(data))
    yield page.section("Events", events_list(data))
    yield page.section("Sensors", sensors_table(data))


def _tracks(data: RunData, figures: Path) -> Iterator[str]:
    """Yield the map by dead reckoning, and that of the forest where the run was simulated."""
    if data.has_way:
        drawing = save(track_figure(data), figures, "track", run_words.track_alt(data))
        yield page.figure(drawing, run_words.track_caption(data))
    else:
        yield page.paragraph(run_words.NO_WAY)
    forest = _forest_of(data.header)
    if forest is not None and data.truth["x_m"].size:
        drawing = save(forest_track_figure(data, forest), figures, "track-in-forest", run_words.forest_alt(data))
        yield page.figure(drawing, run_words.forest_caption(data))
    elif data.summary.simulated:
        yield page.paragraph(run_words.NO_FOREST)


def _forest_of(header: Record) -> Forest | None:
    """Return the forest that a simulated run was in; None where the header has none that can be read."""
    try:
        return from_row(header["world"])
    except (BadForest, LookupError, TypeError):
        return None


def _timeline(data: RunData, figures: Path) -> str:
    if not panels_of(data):
        return page.paragraph(run_words.NO_TICKS)
    figure, unplaced = timeline_figure(data)
    drawing = save(figure, figures, "time-lines", run_words.timeline_alt(data))
    return page.figure(drawing, run_words.timeline_caption(unplaced))

"""Tables of one run's report."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import isnan

from wayfarer.fieldlog.fields import span
from wayfarer.fieldlog.sensor_status import SensorStatus
from wayfarer.fieldlog.vocabulary import ANOMALIES, because
from wayfarer.fieldlog.wording import event_text
from wayfarer.views.page import html
from wayfarer.views.run_report import words
from wayfarer.views.run_report.data import LoggedEvent, RunData
from wayfarer.views.run_report.events import is_trouble, mark_text

ROWS = 500  # of a table; the log has all of them


def anomalies_table(data: RunData) -> str:
    """Return the anomalies by cause."""
    counts = data.summary.anomalies
    if not counts:
        return html.paragraph("There were no anomalies.")
    total, hundred_m = sum(counts.values()), data.summary.reckoned_m / 100.0
    rows = [
        (
            "",
            (
                ANOMALIES.get(kind, kind),
                f"{count}",
                f"{count / total:.0%}",
                f"{count / hundred_m:.1f}" if hundred_m > 0.0 else "",
            ),
        )
        for kind, count in sorted(counts.items(), key=lambda item: -item[1])
    ]
    caption = "Anomalies by cause. Each is counted when it begins."
    return html.table(caption, ("cause", "times", "share", "in 100 m"), rows)


def episodes_table(data: RunData) -> str:
    """Return the episodes, in their order."""
    if not data.episodes:
        return html.paragraph(words.NO_EPISODE)
    rows = [
        (
            "",
            (
                f"{number}",
                span(episode.start_s, 1),
                episode.side,
                f"{episode.turns}",
                f"{episode.end_s - episode.start_s:.1f}",
                f"{episode.metres:.1f}",
                because(episode.ended_by or "the end of the log", ()).replace("_", " "),
            ),
        )
        for number, episode in enumerate(data.episodes, start=1)
    ]
    caption = "Episodes: from an anomaly until the goal was followed again."
    head = ("no.", "began", "first turn", "turns", "lasted, s", "way, m", "how it ended")
    return "\n".join([html.table(caption, head, rows[:ROWS]), *_rest(rows)])


def events_list(data: RunData) -> str:
    """Return everything that was reported, in its order; trouble is set in bold."""
    if not data.events:
        return html.paragraph(words.NO_EVENT)
    items = [f"<li>{escape(span(event.t_s, 1))} {_event(event)}</li>" for event in data.events[:ROWS]]
    return "\n".join(
        [
            html.paragraph("What people asked for, and what the rover reported."),
            "<ul>",
            *items,
            "</ul>",
            *_rest(data.events),
        ]
    )


def _event(event: LoggedEvent) -> str:
    if event.mark:
        return escape(mark_text(event))
    text = escape(event_text(event.record))
    return f"<strong>{text}</strong>" if is_trouble(event) else text


def sensors_table(data: RunData) -> str:
    """Return how well each sensor spoke."""
    if not data.sensors:
        return html.paragraph(words.NO_SENSOR)
    rows = [("", (sensor, *_health(data, sensor, health))) for sensor, health in data.sensors.items()]
    caption = (
        "Sensors, as the control loop saw them: it looks at each once a tick. Unsure: readings of motion whose quality "
        "is too low to be used."
    )
    return html.table(
        caption, ("sensor", "readings", "rate, Hz", "set, Hz", "longest gap, s", "unsure", "failures"), rows
    )


def _health(data: RunData, sensor: str, health: SensorStatus) -> Sequence[str]:
    rate_hz, set_hz = health.rate_hz, data.setting("rates", f"{sensor}_hz")
    unsure = f"{health.doubtful / health.readings:.1%}" if sensor == "motion" and health.readings else ""
    return (
        f"{health.readings}",
        "" if isnan(rate_hz) else f"{rate_hz:.1f}",
        "" if isnan(set_hz) else f"{set_hz:g}",
        f"{health.longest_gap_s:.2f}" if health.readings else "",
        unsure,
        f"{health.failures}",
    )


def _rest(rows: Sequence[object]) -> list[str]:
    """Say how many rows are left out, if any."""
    return [html.paragraph(f"{len(rows) - ROWS} more are in the log: wayfarer logs show.")] if len(rows) > ROWS else []

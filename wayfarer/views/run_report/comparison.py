"""Tables of two runs: their figures beside each other, and what changed in the rover file between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wayfarer.views.page import html
from wayfarer.views.run_report import words
from wayfarer.views.run_report.data import RunData

NOTHING = "not there"


def facts_table(runs: Sequence[RunData], names: Sequence[str]) -> str:
    """Return the facts of all runs, one column each; rows that differ are set in bold."""
    told = [dict(words.facts(data, name)) for data, name in zip(runs, names, strict=True)]
    keys = dict.fromkeys(key for facts in told for key in facts)
    return html.table(
        "What differs is bold.", ["", *names], (_row(key, [each.get(key) for each in told]) for key in keys)
    )


def settings_table(runs: Sequence[RunData], names: Sequence[str]) -> str:
    """Return the keys of the rover file that have another value, or are in one of the runs only."""
    flat = [dict(_flat(data.header.get("config"))) for data in runs]
    changed = sorted(key for key in flat[0].keys() | flat[1].keys() if flat[0].get(key) != flat[1].get(key))
    if not changed:
        return html.paragraph(words.SAME_SETTINGS)
    return html.table(words.SETTINGS, ["key", *names], (_row(key, [each.get(key) for each in flat]) for key in changed))


def _row(key: str, values: Sequence[str | None]) -> tuple[str, list[str]]:
    kind = "same" if len(set(values)) == 1 else "differs"
    return kind, [key, *(NOTHING if value is None else value for value in values)]


def _flat(part: object, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield each value of a rover file under its whole key, as ``detector.tilt_deg``."""
    if isinstance(part, dict):
        for name, value in part.items():
            yield from _flat(value, f"{key}.{name}" if key else str(name))
    elif key:
        yield key, f"{part}"

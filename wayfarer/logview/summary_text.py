"""The summary of a run as text, the most important line first. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from wayfarer.escape.phases import PhaseEvent
from wayfarer.fieldlog.clock import duration_text, local_time
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.wording import place_text, plural
from wayfarer.logview.summary import LastPosition, RangeBearing, RunSummary
from wayfarer.logview.verdict import NO_OUTCOME
from wayfarer.vocabulary import in_words, outcome_in_words, whole_deg


def summary_text(run: str, summary: RunSummary, damage: Damage) -> str:
    """Return the summary of a run as lines, without empty parts."""
    return "\n".join(
        f"{title if first else '':<11}{text}"
        for title, texts in summary_facts(run, summary, damage)
        for first, text in zip([True, *[False] * len(texts)], texts, strict=False)
    )


def summary_facts(run: str, summary: RunSummary, damage: Damage, *, utc: bool = False) -> list[tuple[str, list[str]]]:
    """Return the titles of what there is to tell of a run, each with its lines; ``utc``: not in the local time."""
    facts: list[tuple[str, Iterable[str]]] = [
        ("run", [run, _about(summary)]),
        ("outcome", [_outcome(summary)]),
        ("where", where_lines(summary.where, damage.missing)),
        ("time", _time(summary, utc=utc)),
        ("distance", [distance_line(summary)]),
        ("anomalies", [counted({in_words(kind): count for kind, count in summary.anomalies.items()})]),
        ("escapes", [_escapes(summary)]),
        ("battery", [_battery(summary)]),
        ("failures", [counted({**_sensors(summary), **summary.failures})]),
        ("operator", _operator(summary)),
        ("clock", [_clock(summary)]),
        ("ticks", [_ticks(summary)]),
        ("log", [_log(summary, damage)]),
    ]
    told = ((title, list(filter(None, lines))) for title, lines in facts)
    return [(title, lines) for title, lines in told if lines]


def _about(summary: RunSummary) -> str:
    if summary.version is None and summary.simulated is None:
        return "unknown rover: the log has no header"
    about = [summary.rover or "unknown rover", summary.algorithm, "simulated" if summary.simulated else None]
    about += [None if summary.trial is None else f"trial {summary.trial}"]
    about += ["dry run" if summary.dry_run else None, f"wayfarer {summary.version}" if summary.version else None]
    return ", ".join(text for text in about if text)


def _outcome(summary: RunSummary) -> str:
    if summary.reason is None:
        return NO_OUTCOME
    word, text = outcome_in_words(summary.reason), summary.text or ""
    return text if text.startswith(word) else ": ".join(filter(None, [word, text]))


def where_lines(where: LastPosition, missing: int) -> Iterator[str]:
    """Say where to search for the rover; the receiver first, if there is one."""
    fix = where.last_fix
    if fix is not None:
        yield f"{place_text(fix)}, {where.fix_age_s:.0f} s before the end"
    if where.by_receiver is not None:
        yield f"{_offset(where.by_receiver)} true from the first position"
    if where.by_reckoning is not None:
        origin = "the start" if where.from_start else "where the log begins"
        yield f"{_offset(where.by_reckoning)} magnetic from {origin} (dead reckoning)"
        if missing:
            yield f"{Damage(missing=missing)}, so the path is only partly known"


def _offset(offset: RangeBearing) -> str:
    return f"{offset.distance_m:.0f} m at bearing {whole_deg(offset.bearing_deg)} degrees"


def _time(summary: RunSummary, *, utc: bool) -> Iterator[str]:
    lasted, armed = duration_text(summary.lasted_s), duration_text(summary.armed_s)
    yield f"{lasted} in all{_began(summary, utc=utc)}; armed for {armed}"
    for how, times_s in (("held", summary.held_s), ("drove with limits", summary.limited_s)):
        yield from (f"{how} for {duration_text(for_s, 1)}: {in_words(cause)}" for cause, for_s in times_s.items())


def _began(summary: RunSummary, *, utc: bool) -> str:
    if summary.began_wall_s is not None:
        return f" from {local_time(summary.began_wall_s, '%Y-%m-%d %H:%M:%S', utc=utc)}{' UTC' if utc else ''}"
    return "" if summary.trial is not None else " (start time unknown: the clock was not set)"


def distance_line(summary: RunSummary) -> str:
    """Say how far the rover went."""
    if summary.commanded_m is None:
        return ""
    driven = "" if summary.driven_m is None else f"{summary.driven_m:.1f} m driven, "
    return f"{driven}{summary.commanded_m:.1f} m commanded, {summary.reckoned_m:.1f} m by dead reckoning"


def counted(counts: Mapping[str, int]) -> str:
    """Return names with how often each was counted, the most frequent first."""
    told = [f"{what} {count}" for what, count in sorted(counts.items(), key=lambda item: -item[1]) if count]
    return ", ".join(told)


def _escapes(summary: RunSummary) -> str:
    if not summary.ticks:
        return ""
    ended = {in_words(f"{phase}.{PhaseEvent.EXHAUSTED.value}"): count for phase, count in summary.exhausted.items()}
    return "; ".join(filter(None, [f"episodes {summary.episodes}, backed off {summary.recoveries}", counted(ended)]))


def _battery(summary: RunSummary) -> str:
    lowest = summary.low_battery
    if lowest is None:
        return ""
    at = duration_text(lowest.at_s)
    return f"lowest {lowest.battery_v:.1f} V, at {at}, with the wheels at {lowest.duty:.0%}"


def _sensors(summary: RunSummary) -> dict[str, int]:
    return {f"{sensor} did not answer": count for sensor, count in summary.sensor_failures.items()}


def _operator(summary: RunSummary) -> Iterator[str]:
    marks, drives = len(summary.marks), summary.manual
    yield counted({"marks": marks, "holds": summary.holds, "new goals": summary.goals, "drives by hand": drives})
    yield from (f"{duration_text(mark.at_s)} {mark.text}" for mark in summary.marks)


def _clock(summary: RunSummary) -> str:
    return ", ".join(f"set by {step_s:+.0f} s" for step_s in summary.clock_steps_s)


def _ticks(summary: RunSummary) -> str:
    period = summary.period
    if period is None:
        return ""
    p50_ms, p99_ms, max_ms = (1e3 * period_s for period_s in (period.p50_s, period.p99_s, period.max_s))
    return f"{summary.ticks}, every {p50_ms:.1f} ms (p99 {p99_ms:.1f}, longest {max_ms:.1f}); {summary.late_ticks} late"


def _log(summary: RunSummary, damage: Damage) -> str:
    told = [str(damage)] if damage else []
    if summary.dropped and damage.missing:
        told = [f"{damage}, {min(summary.dropped, damage.missing)} of them could not be written"]
    elif summary.dropped:
        told.append(f"{plural(summary.dropped, 'record')} could not be written")
    if summary.reason is None:
        told.append(NO_OUTCOME)
    return "; ".join(told) or "complete"

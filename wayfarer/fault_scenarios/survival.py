"""``wayfarer faults --missions``: how many faults end a mission, and why each of those must."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

from rich.console import Console

from wayfarer.experiments.commands import INTERRUPTED, make_empty_folder
from wayfarer.experiments.executors import Stopped
from wayfarer.experiments.progress_bar import say
from wayfarer.experiments.rows import rounded_values
from wayfarer.experiments.tables import number_text
from wayfarer.fault_scenarios.command import store_rows
from wayfarer.fault_scenarios.missions import DURATIONS_S, MissionRunner, Strike, Striking
from wayfarer.fault_scenarios.results import section
from wayfarer.fault_scenarios.runner import run_batch
from wayfarer.safety.conditions import Condition
from wayfarer.views.text.scripting import print_json
from wayfarer.views.text.summary_text import counted
from wayfarer.views.text.terminal_table import Column, table

SHOWN_MODES = 2  # of the conditions of a line, the longest first
HELD = "nothing that its wheels do carries it on: it tried and rested until the limit"

# Why a mission must end in this condition, or in this way.
REASONS: Mapping[str, str] = {
    Condition.OVERTURNED.value: "it lies on its side or roof, and its wheels do not carry it; a person stands it up",
    Condition.RUNAWAY.value: "it moves although its wheels are told to stand, so no command is known to be obeyed",
    Condition.DRIVE_WEAK.value: "a dead or weak side: nothing that the other one does carries it on",
    Condition.DRIVE_REVERSED.value: "its sides do the opposite of what they are told: it drives where nobody expects",
    Condition.ENTRAPPED.value: "its rover file has give_up = true",
    Condition.MOTORS_FAILED.value: "the motor board does not answer: what its wheels do is not known",
    Condition.BOARD_FAULT.value: "the motor board reports a short, heat or too little voltage, or has no deadman on",
    Condition.BOARD_DISAGREES.value: "the motor board does not apply what it is told, so no stop is known to be obeyed",
    Condition.BATTERY_CRITICAL.value: "the battery is empty: its cells would be damaged, then the computer fails",
    Condition.DECISION_INVALID.value: "the algorithm has a bug, and its next command may be any",
    Condition.COMPASS_LOST.value: "without a compass nothing tells where it drives, and it was set to hold then",
    Condition.NO_PROGRESS.value: HELD,
    Condition.RESTING.value: HELD,
    Condition.CANNOT_TURN.value: HELD,
    "error": "a bug ended the run: what a program with a bug does next is not known",
    "tipped": "it fell over",
}
NO_REASON = "no reason is known why it must: a limit of its time, path or radius was reached on the way"


class MissionLine(NamedTuple):
    """What a fault did that lasted so long: the missions with it beside the same missions without it.

    ``lasts_s`` is None for good. ``also`` names scenarios with the same fault. ``out`` counts missions that got out
    with the fault and without it, and the mean paths are over these. ``mode_s`` is for how many seconds of a mission,
    on average, each condition of level S1 or worse was there while the fault lasted. ``ended`` counts how the others
    ended, with the worst condition at that time. ``reason`` is why so many must, empty unless ``ends_missions``.
    """

    fault: str
    rows: tuple[int, ...]
    also: tuple[str, ...]
    about: str
    rover: str
    depth: str
    lasts_s: float | None
    missions: int
    out_without: int
    out: int
    path_without_m: float | None
    path_m: float | None
    mode_s: Mapping[str, float]
    ended: Mapping[str, int]
    ends_missions: bool
    reason: str


def modes(line: MissionLine) -> str:
    """Return the conditions that were there longest while the fault lasted."""
    return ", ".join(list(line.mode_s)[:SHOWN_MODES])


COLUMNS: tuple[tuple[int, Column[MissionLine]], ...] = (
    (0, Column("row", lambda each: ", ".join(map(str, each.rows)))),
    (0, Column("fault", lambda each: each.fault, left=True)),
    (0, Column("lasts\ns", lambda each: "" if each.lasts_s is None else f"{each.lasts_s:g}")),
    (0, Column("out\nwithout", lambda each: str(each.out_without))),
    (0, Column("out\nwith", lambda each: str(each.out))),
    (90, Column("path m\nwithout", lambda each: number_text(each.path_without_m))),
    (0, Column("path m\nwith", lambda each: number_text(each.path_m))),
    (120, Column("conditions meanwhile", modes, left=True, wraps=True)),
    (0, Column("failures", lambda each: counted(each.ended), left=True, wraps=True)),
)  # fmt: skip


def run_missions(
    faults: Sequence[Striking], missions: int, seed: int, jobs: int | None, out: Path | None, left_out: Sequence[str],
    *, as_json: bool,
) -> int:  # fmt: skip
    """Have each fault strike so many missions, print the table, and return 0, or 130 where a signal asked to stop.

    ``left_out`` says which faults do not strike missions, and why. With ``out`` the table is stored there.

    Raises:
        BadInput: ``out`` is not new or empty.
        WayfarerError: a worker died.
    """
    aside = Console(stderr=True)
    if out is not None:
        make_empty_folder(out, "what comes of the missions")
    tasks = [(trial, number) for trial in range(missions) for number in range(len(faults))]
    try:
        strikes = sorted(run_batch(MissionRunner(faults, seed), tasks, jobs, "strikes"), key=lambda each: each.trial)
    except Stopped:
        say(aside, "interrupted: no table")
        return INTERRUPTED
    lines = list(summed_up(faults, strikes))
    rows = [rounded_values(line._asdict()) for line in lines]
    if as_json:
        print_json({"missions": rows, "left_out": left_out})
    else:
        _print(Console(), lines, left_out)
    if out is not None:
        store_rows(out, MissionLine._fields, rows)
        say(aside, f"the results are in {out}")
    return 0


def summed_up(faults: Sequence[Striking], strikes: Sequence[Strike]) -> Iterator[MissionLine]:
    """Yield a line for each fault and duration."""
    for number, fault in enumerate(faults):
        mine = [strike for strike in strikes if strike.fault == number]
        for index, lasts_s in enumerate(DURATIONS_S):
            yield _line(fault, mine, index, None if lasts_s == inf else lasts_s)


def _line(fault: Striking, strikes: Sequence[Strike], index: int, lasts_s: float | None) -> MissionLine:
    pairs = [(strike.well, strike.struck[index]) for strike in strikes]
    both = [(well, struck) for well, struck in pairs if not (well.ended or struck.ended)]
    ended = Counter(struck.ended for _, struck in pairs if struck.ended)
    mode_s: Counter[str] = Counter()
    for _, struck in pairs:
        mode_s.update(struck.mode_s)
    out_without = sum(not well.ended for well, _ in pairs)
    ends_missions = 2 * len(both) < out_without
    scenario = fault.scenario
    return MissionLine(
        scenario.name,
        fault.rows,
        fault.names[1:],
        scenario.about,
        scenario.rover,
        scenario.depth.value,
        lasts_s,
        len(pairs),
        out_without,
        len(both),
        fmean(well.path_m for well, _ in both) if both else None,
        fmean(struck.path_m for _, struck in both) if both else None,
        {name: round(total_s / len(pairs), 2) for name, total_s in mode_s.most_common()},
        dict(ended.most_common()),
        ends_missions,
        _reason(ended) if ends_missions else "",
    )


def _reason(ended: Counter[str]) -> str:
    """Return why missions must end as most of these did."""
    ((most, _),) = ended.most_common(1)
    how, _, cause = most.partition(": ")
    return REASONS.get(cause) or REASONS.get(how, NO_REASON)


def headline(lines: Sequence[MissionLine]) -> Iterator[str]:
    """Say how many faults end a mission, and why each of those must: a line for each reason."""
    for_good, for_a_while = ([each for each in lines if (each.lasts_s is None) is lasts] for lasts in (True, False))
    ending = [each for each in for_good if each.ends_missions]
    yield (
        f"{len(ending)} of {len(for_good)} faults that last end a mission: fewer than half of the missions that get"
        " out without the fault get out with it"
    )
    if rows := _rows(for_good):
        yield f"They are in {len(_rows(ending))} of the {len(rows)} rows of the fault catalogue that can strike"
    brief = sum(each.ends_missions for each in for_a_while)
    yield f"Of the same faults for {DURATIONS_S[1]:g} s {brief} of {len(for_a_while)} end a mission"
    names: dict[str, list[str]] = {}
    for each in ending:
        names.setdefault(each.reason, []).append(each.fault)
    for reason, faults in names.items():
        yield f"{', '.join(faults)}: {reason}"


def _rows(lines: Iterable[MissionLine]) -> set[int]:
    return {row for each in lines for row in each.rows}


def _print(console: Console, lines: Sequence[MissionLine], left_out: Sequence[str]) -> None:
    console.print(table([column for from_width, column in COLUMNS if from_width <= console.width], lines))
    say(console, f"{lines[0].missions} missions of each fault and duration; a fault without a duration lasts for good")
    say(console, "paths: means over the missions that get out with the fault and without it")
    section(console, "Left out", left_out)
    section(console, "Faults that end a mission", headline(lines))

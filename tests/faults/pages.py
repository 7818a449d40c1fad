"""The tables of ``docs/reference/faults.md``, and that of stops in ``docs/explanation/what-stops-the-wheels.md``.

``python -m tests.faults.pages`` writes them again; it runs each scenario for that, which takes a minute.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields
from math import inf
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from annotated_types import Interval

from tests.faults.catalogue import catalogue
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.fault_kind import FaultKind
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.process import ProcessFault
from wayfarer.simhal.faults.world import WorldFault
from wayfarer.testing.faults import ResponseLevel, Result, Scenario, run_fault_scenario

DOCS = Path(__file__).parents[2] / "docs"
FAULTS, STOPS = DOCS / "reference" / "faults.md", DOCS / "explanation" / "what-stops-the-wheels.md"
LAYERS: dict[str, type] = {"world": WorldFault, "bus": BusFault, "process": ProcessFault}
KINDS_HEAD = ("kind", "what happens", "to", "parameters")
CATALOGUE_HEAD = ("row", "fault", "what happens", "asked for", "level", "bound s")
STOPS_HEAD = ("row", "fault", "what happens", "level", "by", "stopped after s", "bound s")


def part(page: str, name: str) -> tuple[str, str, str]:
    """What stands before the marks of a part, the part, and what stands after it."""
    before, begin, rest = page.partition(f"<!-- {name} -->\n")
    within, end, after = rest.partition(f"<!-- /{name} -->\n")
    assert begin and end, f"the page has no marks of {name}"
    return before + begin, within, end + after


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "".join(f"|{'|'.join(cells)}|\n" if cells[0] == "---" else f"| {' | '.join(cells)} |\n" for cells in lines)


def kinds(layer: str) -> str:
    """The kinds of a layer: ``world``, ``bus``, ``process`` or ``reading``."""
    return table(KINDS_HEAD, (_kind_row(name, kind) for name, kind in KINDS.items() if _layer(kind) == layer))


def catalogue_table() -> str:
    """The scenarios of the catalogue."""
    return table(
        CATALOGUE_HEAD,
        (
            (str(each.row), f"`{each.name}`", each.about, each.asked, each.expect.level, f"{each.expect.within_s:.2f}")
            for each in catalogue()
        ),
    )


def stops(results: Iterable[tuple[Scenario, Result]]) -> str:
    """What stopped the wheels, in the order of the catalogue."""
    return table(
        STOPS_HEAD,
        (
            (
                str(scenario.row), f"`{scenario.name}`", scenario.about, result.reached, f"`{result.cause}`",
                "" if result.stopped_s is None else f"{result.stopped_s:.2f}", f"{scenario.expect.within_s:.2f}",
            )
            for scenario, result in results
            if scenario.expect.level in {ResponseLevel.HOLD, ResponseLevel.FAULT, ResponseLevel.DEADMAN}
        ),
    )  # fmt: skip


def held_by_tests() -> dict[str, int]:
    """The tests that the page names for the rows that no simulated run can show, with the row."""
    _, section, _ = part(FAULTS.read_text(encoding="utf-8"), "tests")
    return {test: int(row) for row, test in re.findall(r"^\| (\d+) \|.*`(tests/[^`]*)` \|$", section, re.MULTILINE)}


def _layer(kind: type[FaultKind]) -> str:
    return next((name for name, base in LAYERS.items() if issubclass(kind, base)), "reading")


def _kind_row(name: str, kind: type[FaultKind]) -> tuple[str, ...]:
    about = (kind.__doc__ or "").replace("``", "`").removesuffix(".")
    return f"`{name}`", f"{about[:1].lower()}{about[1:]}", ", ".join(kind.targets), "; ".join(_params(kind))


def _params(kind: type[FaultKind]) -> Iterator[str]:
    hints = get_type_hints(kind, include_extras=True)
    for each in fields(kind):
        yield f"`{each.name}` = {_value(each.default)}{_range(hints[each.name])}"


def _range(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return f" ({', '.join(get_args(hint))})"
    for interval in (each for each in getattr(hint, "__metadata__", ()) if isinstance(each, Interval)):
        low, high = _bound(interval.ge, interval.gt, "above "), _bound(interval.le, interval.lt, "below ")
        if high:
            return f" ({low} to {high})"
        return f" ({low})" if interval.ge is None else f" ({low} at least)"
    return ""


def _bound(closed: Any, opened: Any, word: str) -> str:
    if closed is None and opened is None:
        return ""
    return f"{closed:g}" if opened is None else f"{word}{opened:g}"


def _value(value: Any) -> str:
    if isinstance(value, float | int):
        return "without end" if value == inf else f"{value:g}"
    return str(value)


def _write(page: Path, name: str, made: str) -> None:
    before, _, after = part(page.read_text(encoding="utf-8"), name)
    page.write_text(before + made + after, encoding="utf-8")


if __name__ == "__main__":
    for each_layer in (*LAYERS, "reading"):
        _write(FAULTS, each_layer, kinds(each_layer))
    _write(FAULTS, "catalogue", catalogue_table())
    with ProcessPoolExecutor() as pool:
        _write(STOPS, "stops", stops(zip(catalogue(), pool.map(run_fault_scenario, catalogue()), strict=True)))

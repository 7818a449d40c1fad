"""The tables of ``docs/reference/faults.md``: ``python -m tests.fault_scenarios.kinds_page`` prints them again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from math import inf
from typing import Any, Literal, get_args, get_origin, get_type_hints

from annotated_types import Interval

from wayfarer.fault_scenarios.catalogue import covered_by_tests
from wayfarer.simhal.faults.bus import BusFault
from wayfarer.simhal.faults.fault_kind import FaultKind
from wayfarer.simhal.faults.kinds import KINDS
from wayfarer.simhal.faults.process import ProcessFault
from wayfarer.simhal.faults.world import WorldFault

LAYERS: dict[str, type] = {"world": WorldFault, "bus": BusFault, "process": ProcessFault}
HEAD = "| kind | what happens | to | parameters |\n|---|---|---|---|"
HELD_HEAD = "| row | fault | what happens | level | bound s | test |\n|---|---|---|---|---|---|"


def rows(layer: str) -> list[str]:
    return [_row(name, kind) for name, kind in KINDS.items() if _layer(kind) == layer]


def _layer(kind: type[FaultKind]) -> str:
    return next((name for name, base in LAYERS.items() if issubclass(kind, base)), "reading")


def held() -> list[str]:
    return [
        f"| {each.row} | `{each.name}` | {each.about} | {each.level} | {seconds(each.within_s)} | `{each.test}` |"
        for each in covered_by_tests().values()
    ]


def seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _row(name: str, kind: type[FaultKind]) -> str:
    about = (kind.__doc__ or "").replace("``", "`").removesuffix(".")
    return f"| `{name}` | {about[:1].lower()}{about[1:]} | {', '.join(kind.targets)} | {'; '.join(_params(kind))} |"


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


if __name__ == "__main__":
    for each_layer in (*LAYERS, "reading"):
        print(f"\n### `{each_layer}`\n", HEAD, *rows(each_layer), sep="\n")
    print("\n## Faults covered by tests\n", HELD_HEAD, *held(), sep="\n")

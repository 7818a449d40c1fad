"""The table of ``docs/explanation/what-stops-the-wheels.md``.

``python -m tests.fault_scenarios.stops_page RESULTS`` prints it again, from what ``wayfarer faults --out
RESULTS`` kept.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.fault_scenarios.kinds_page import seconds

STOPPING = ("S2", "S3", "S4")
STOPS_HEAD = "| row | fault | what happens | level | by | stopped after s | bound s |\n|---|---|---|---|---|---|---|"


def stops(results: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The lines of what stopped the wheels, in the order of the catalogue."""
    for each in sorted(results, key=lambda each: each["row"]):
        if each["reached"] in STOPPING:
            yield _line(
                str(each["row"]), f"`{each['name']}`", each["about"], each["reached"], _code(each["cause"]),
                seconds(each["stopped_s"]), seconds(each["within_s"]),
            )  # fmt: skip


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _code(text: str) -> str:
    return f"`{text.partition(':')[0]}`" if text else ""


if __name__ == "__main__":
    (faults,) = (Path(argument) for argument in sys.argv[1:])
    print(STOPS_HEAD, *stops(json.loads((faults / "results.json").read_text())), sep="\n")

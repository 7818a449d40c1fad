"""The tables of ``docs/what-stops-the-wheels.md``.

``python -m tests.fault_scenarios.stops_page RESULTS DETECTOR`` prints them again, from what ``wayfarer faults --out
RESULTS`` and ``wayfarer faults --detector --out DETECTOR`` kept.
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
DETECTOR_HEAD = (
    "| anomaly | slip mean m | noise | episodes | recall | claims | precision | delay s | p95 s |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def stops(results: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The lines of what stopped the wheels, in the order of the catalogue."""
    for each in sorted(results, key=lambda each: each["row"]):
        if each["reached"] in STOPPING:
            yield _line(
                str(each["row"]), f"`{each['name']}`", each["about"], each["reached"], _code(each["cause"]),
                seconds(each["stopped_s"]), seconds(each["within_s"]),
            )  # fmt: skip


def detector(rows: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The lines of how well anomalies are noticed."""
    for each in rows:
        delay_s = each["delay_s"] or (None, None)
        yield _line(
            f"`{each['anomaly']}`", f"{each['slip_mean_m']:g}", f"{each['noise']:g}x", str(each["episodes"]),
            _share(each["found"], each["episodes"]), str(each["claims"]), _share(each["right"], each["claims"]),
            *map(seconds, delay_s),
        )  # fmt: skip


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _code(text: str) -> str:
    return f"`{text.partition(':')[0]}`" if text else ""


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else ""


if __name__ == "__main__":
    faults, measured = (Path(argument) for argument in sys.argv[1:])
    print(STOPS_HEAD, *stops(json.loads((faults / "results.json").read_text())), sep="\n")
    print()
    print(DETECTOR_HEAD, *detector(json.loads((measured / "detector.json").read_text())), sep="\n")

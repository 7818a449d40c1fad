"""The part of ``docs/faults.md`` on missions.

``python -m tests.fault_scenarios.missions_page RESULTS`` writes it again, from what ``wayfarer faults --missions 100
--out RESULTS`` kept.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from wayfarer.fault_scenarios.survival import MissionLine, headline, modes

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
BEGIN, END = "<!-- missions -->\n", "<!-- /missions -->\n"
HEAD = (
    "| row | fault | rover | out without | out | path m | conditions | failures | 10 s: out | path m |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def section(lines: Sequence[MissionLine]) -> Iterator[str]:
    """The headline with its reasons as a list, and a table with a line for each fault."""
    ending, rows, brief, *reasons = headline(lines)
    yield f"**{ending}** ({lines[0].missions} missions of each)."
    yield f"{rows}. {brief}. Why the missions must end:\n"
    for each in reasons:
        names, _, reason = each.partition(": ")
        yield f"* {_names(names)}: {reason}"
    yield f"\n{HEAD}"
    for_good = [each for each in lines if each.lasts_s is None]
    for_a_while = [each for each in lines if each.lasts_s is not None]
    yield from (_row(*pair) for pair in zip(for_good, for_a_while, strict=True))


def _row(good: MissionLine, brief: MissionLine) -> str:
    failures = ", ".join(f"`{how}` {count}" for how, count in good.ended.items())
    cells = (
        ", ".join(map(str, good.rows)), f"`{good.fault}`", good.rover, str(good.out_without), str(good.out),
        _path(good), _names(modes(good)), failures, str(brief.out), _path(brief),
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _names(text: str) -> str:
    return ", ".join(f"`{name}`" for name in text.split(", ") if name)


def _path(line: MissionLine) -> str:
    return "" if line.path_m is None else f"{line.path_m:.1f} ({line.path_without_m:.1f})"


if __name__ == "__main__":
    results = json.loads((Path(sys.argv[1]) / "results.json").read_text(encoding="utf-8"))
    told = "\n".join(section([MissionLine(**row) for row in results]))
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}{told}\n{END}{rest.partition(END)[2]}", encoding="utf-8")

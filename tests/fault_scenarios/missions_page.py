"""The part of ``docs/reference/faults.md`` on missions.

``python -m tests.fault_scenarios.missions_page RESULTS`` writes it again, from what ``wayfarer faults --missions 100
--out RESULTS`` kept.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from wayfarer.fault_scenarios.survival import MissionLine, headline, modes

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "faults.md"
HEADLINE, TABLE = "missions", "missions-table"  # the names of both parts in their marks
HEAD = (
    "| row | fault | rover | out without | out | path m | conditions | failures | 10 s: out | path m |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)


def told(lines: Sequence[MissionLine]) -> Iterator[str]:
    """The headline, and a list of the reasons."""
    ending, rows, brief, *reasons = headline(lines)
    yield f"**{ending}**"
    yield f"({lines[0].missions} missions of each). {rows}."
    yield f"{brief}. Why the missions must end:\n"
    for each in reasons:
        names, _, reason = each.partition(": ")
        yield f"* {_names(names)}: {reason}"


def table(lines: Sequence[MissionLine]) -> Iterator[str]:
    """A line for each fault."""
    yield HEAD
    for_good = [each for each in lines if each.lasts_s is None]
    for_a_while = [each for each in lines if each.lasts_s is not None]
    yield from (_row(*pair) for pair in zip(for_good, for_a_while, strict=True))


def part(page: str, name: str) -> tuple[str, str, str]:
    """What stands before a part, the part, and what stands after it."""
    before, begin, rest = page.partition(f"<!-- {name} -->\n")
    within, end, after = rest.partition(f"<!-- /{name} -->\n")
    assert begin and end, f"docs/reference/faults.md has no marks of {name}"
    return before + begin, within, end + after


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
    kept = json.loads((Path(sys.argv[1]) / "results.json").read_text(encoding="utf-8"))
    results, text = [MissionLine(**row) for row in kept], PAGE.read_text(encoding="utf-8")
    for name, made in ((HEADLINE, told(results)), (TABLE, table(results))):
        before, _, after = part(text, name)
        text = before + "".join(f"{line}\n" for line in made) + after
    PAGE.write_text(text, encoding="utf-8")

"""Conditions in ``docs/explanation/what-stops-the-wheels.md``: ``python -m tests.safety.conditions_page`` prints it."""

from __future__ import annotations

from wayfarer.fieldlog.wording import sentence
from wayfarer.safety.conditions import Condition
from wayfarer.safety.responses import RESPONSES, Response

HEAD = "| condition | level | kind | what is wrong | what the rover does | until |\n|---|---|---|---|---|---|"


def rows() -> list[str]:
    return [_row(*item) for item in RESPONSES.items()]


def _row(condition: Condition, row: Response) -> str:
    people = "" if row.among_people is None else f"; among people S{row.among_people.value}"
    by_hand = "" if row.manual is None else f"; by hand S{row.manual.value}"
    cells = (f"`{condition.value}`", f"S{row.level.value}{people}{by_hand}", row.kind.value,
             *map(sentence, (row.what, row.does, row.ends_when)))  # fmt: skip
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    print(HEAD, *rows(), sep="\n")

"""``wayfarer list --conditions``: what can be wrong with the rover itself, what it does about it, and what ends it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wayfarer.safety.conditions import Condition
    from wayfarer.safety.responses import Response


def print_conditions(*, as_json: bool) -> None:
    """Print the table of conditions, the dangers first."""
    from rich.console import Console

    from wayfarer.safety.responses import RESPONSES, Kind
    from wayfarer.views.text.scripting import print_json
    from wayfarer.views.text.terminal_table import Column, table

    if as_json:
        print_json({"conditions": [_described(*item) for item in RESPONSES.items()]})
        return
    columns: list[Column[Mapping[str, Any]]] = [
        Column("condition", lambda row: row["condition"], left=True),
        Column("level", lambda row: row["level"], left=True),
        Column("among people", lambda row: row["among_people"], left=True, wraps=True),
        Column("what is wrong, what the rover does, and until when", _sentences, left=True, wraps=True),
    ]
    console = Console()
    for kind in Kind:
        rows = (_described(*item) for item in RESPONSES.items() if item[1].kind is kind)
        console.print(f"{kind.value}: {kind.meaning}", highlight=False)
        console.print(table(columns, rows))
        console.print()


def _described(condition: Condition, row: Response) -> dict[str, str]:
    return {
        "condition": condition.value,
        "level": row.level.name.lower(),
        "among_people": row.level_among_people.name.lower(),
        "kind": row.kind.value,
        "what": row.what,
        "does": row.does,
        "ends_when": row.ends_when,
    }


def _sentences(row: Mapping[str, Any]) -> str:
    from wayfarer.fieldlog.wording import sentence

    return f"{sentence(row['what'])}. The rover {row['does']}. Until: {row['ends_when']}."

"""The tables of ``docs/json.md`` as a schema: reading them, and holding values against them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[2] / "docs" / "json.md"
Table = dict[str, str]
PLAIN: Mapping[str, tuple[type, ...]] = {
    "string": (str,), "integer": (int,), "number": (int, float), "boolean": (bool,), "object": (dict,), "list": (list,),
}  # fmt: skip
EACH = "*"  # the key that stands for each key of another table


def read_tables() -> dict[str, Table]:
    """Return the types of the keys by table, as they stand under the page's headings."""
    tables: dict[str, Table] = {}
    heading = ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("#"):
            heading = line.lstrip("# ").replace("`", "")
        elif found := re.match(r"\| `([^`]+)` \| ([^|]+) \| \S", line):
            table = tables.setdefault(heading, {})
            assert found[1] not in table, f"{heading} has {found[1]} twice"
            table[found[1]] = re.sub(r"\[(\w+)\]\(#(\w+)\)", r"\1", found[2].strip())
    return tables


def wrong(value: Any, wanted: str, tables: Mapping[str, Table], where: str = "") -> Iterator[str]:
    """Say what of a value is not as the page has it."""
    options = wanted.removesuffix(" or absent").split(" or ")
    if value is None:
        if "null" not in options and wanted != "anything":
            yield f"{where}: null, not {wanted}"
        return
    wanted = options[0]
    if wanted == "anything":
        return
    outer, _, inner = wanted.partition(" of ")
    if wanted in tables:
        yield from _wrong_object(value, wanted, tables, where)
    elif type(value) not in PLAIN[outer]:
        yield f"{where}: {value!r} is not {wanted}"
    elif inner:
        members: Any = value if isinstance(value, dict) else dict(enumerate(value))
        for key, each in members.items():
            yield from wrong(each, inner, tables, f"{where}.{key}")


def _wrong_object(value: Any, name: str, tables: Mapping[str, Table], where: str) -> Iterator[str]:
    if not isinstance(value, dict):
        yield f"{where}: {value!r} is not {name}"
        return
    keys = keys_of(name, tables)
    for key in sorted(value.keys() - keys.keys()):
        yield f"{where}.{key} is not in the table {name}"
    for key, wanted in keys.items():
        if key in value:
            yield from wrong(value[key], wanted, tables, f"{where}.{key}")
        elif not wanted.endswith(" or absent"):
            yield f"{where}.{key} is missing"


def keys_of(name: str, tables: Mapping[str, Table]) -> Table:
    """Return the keys of a table, with those of the table that it includes."""
    own = dict(tables[name])
    return (keys_of(own.pop(EACH), tables) if EACH in own else {}) | own

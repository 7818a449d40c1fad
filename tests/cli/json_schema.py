"""``docs/reference/json.md`` as a schema: reading its tables, holding values and annotations against them."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "json.md"
Table = dict[str, str]
PLAIN: Mapping[str, tuple[type, ...]] = {
    "string": (str,), "integer": (int,), "number": (int, float), "boolean": (bool,), "object": (dict,), "list": (list,),
}  # fmt: skip
NAMES = {str: "string", int: "integer", float: "number", bool: "boolean", Any: "anything", object: "anything"}
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


def keys_of_class(cls: type) -> Table:
    """Return the keys that an object of a dataclass, named tuple or record has, with types as the page words them."""
    hints = get_type_hints(cls)
    names = getattr(cls, "_fields", getattr(cls, "__struct_fields__", None)) or [field.name for field in fields(cls)]
    return {name: wording(hints[name]) for name in names}


def wording(annotation: Any) -> str:
    """Return how the page words a type."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return " or ".join("null" if each is type(None) else wording(each) for each in inner)
    if origin is Literal:
        return wording(type(inner[0]))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return f"object of {wording(inner[1])}"
    if isinstance(origin, type) and issubclass(origin, Sequence):
        return f"list of {wording(inner[0])}"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return "string"
    return NAMES.get(annotation) or str(annotation.__name__)

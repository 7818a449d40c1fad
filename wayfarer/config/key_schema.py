"""What a key of a rover file is: meaning, type, default and range, from the JSON Schema that comes with wayfarer."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from wayfarer.config.rover_path import SCHEMA

BOUNDS = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}


@cache
def shipped_schema() -> dict[str, Any]:
    """Return the schema of rover files."""
    schema: dict[str, Any] = json.loads(SCHEMA.read_text(encoding="utf-8"))
    return schema


def table_schema(table: str, driver: str | None = None) -> dict[str, Any]:
    """Return the schema of a table, such as ``vehicle``, or "parts.motors" with a driver; empty of an unknown one."""
    schema = shipped_schema()
    if not table:
        return schema
    section, _, part = table.partition(".")
    found: dict[str, Any] = schema["properties"].get(section, {})
    if not part:
        return schema["$defs"].get(reference(found), {})  # type: ignore[no-any-return]
    choices = found["properties"].get(part, {}).get("anyOf", [])
    return next((each for each in choices if each["title"] == driver), {})


def key_schema(key: str, driver: str | None = None) -> dict[str, Any]:
    """Return the schema of a dotted key, of a part's key with that driver; empty of an unknown one."""
    table, _, name = key.rpartition(".")
    found: dict[str, Any] = table_schema(table, driver).get("properties", {}).get(name, {})
    return found


def reference(schema: dict[str, Any]) -> str:
    """Return the name of the definition that a schema refers to, empty where it refers to none."""
    return str(schema.get("$ref", "")).rpartition("/")[2]


def kinds(schema: dict[str, Any]) -> set[str]:
    """Return the JSON types that a key may have, such as ``{"number", "null"}``."""
    return {each["type"] for each in schema.get("anyOf", [schema]) if "type" in each}


def allowed(schema: dict[str, Any], *, code: bool = False) -> str:
    """Say in words what a schema allows, values as code in Markdown or plain."""
    choices = [each for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return " or ".join(_allowed_one(each, code) for each in choices)


def _allowed_one(schema: dict[str, Any], code: bool) -> str:
    if "enum" in schema or "const" in schema:
        values = schema.get("enum") or [schema["const"]]
        return ", ".join(f"`{json.dumps(each)}`" if code else str(each) for each in values)
    if schema["type"] == "array":
        return f"a list: {allowed(schema.get('items') or schema.get('prefixItems', [{}])[0], code=code)}"
    if schema["type"] == "boolean":
        return "`true` or `false`" if code else "true or false"
    if schema["type"] == "string":
        return f"text, at most {schema['maxLength']} characters" if "maxLength" in schema else "text"
    bounds = [f"{words} {schema[bound]:g}" for bound, words in BOUNDS.items() if bound in schema]
    return " ".join([{"number": "number", "integer": "whole number"}[schema["type"]], *bounds])

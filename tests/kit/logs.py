"""Logs as tests look at them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from wayfarer.fieldlog.reader import RunReader
from wayfarer.fieldlog.record import AnyRecord


def keys_of(record: AnyRecord) -> dict[str, Any]:
    """Return all keys of a record with their values, those of an event's data beside them."""
    keys: dict[str, Any] = {"record": record.__struct_config__.tag, **msgspec.structs.asdict(record)}
    data: dict[str, Any] = keys.pop("data", {})
    return keys | data


def read_log(run: Path) -> list[dict[str, Any]]:
    """Return the records of a run, each as its keys."""
    return [keys_of(record) for record in RunReader(run)]

"""Exports read back by what knows nothing of the writer: files by the mcap library, messages by their descriptors.

Protobuf messages travel with the descriptors of their types; to decode by these takes the lines below, and no library.
"""

from __future__ import annotations

import json
import struct
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap.records import Schema

MESSAGE, REPEATED = 11, 3
FIXED = {1: "<d", 2: "<f", 6: "<Q", 7: "<I", 15: "<i", 16: "<q"}
DEFAULTS: dict[int, Any] = {1: 0.0, 2: 0.0, 8: False, 9: "", 12: b""}


class Message(NamedTuple):
    """One message: its time in nanoseconds, and what it says."""

    time_ns: int
    value: dict[str, Any]


class Exported(NamedTuple):
    """A file: the messages of each topic, in their order, and the topics' schemas."""

    messages: dict[str, list[Message]]
    schemas: dict[str, Schema]
    all: list[tuple[str, Message]]


def read(path: Path) -> Exported:
    messages: dict[str, list[Message]] = defaultdict(list)
    schemas: dict[str, Schema] = {}
    in_order: list[tuple[str, Message]] = []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            assert schema is not None
            schemas[channel.topic] = schema
            if channel.message_encoding == "json":
                value = json.loads(message.data)
            else:
                value = descriptors(schema.data).decode(f".{schema.name}", message.data)
            found = Message(message.log_time, value)
            messages[channel.topic].append(found)
            in_order.append((channel.topic, found))
    return Exported(dict(messages), schemas, in_order)


class Descriptors:
    """The message types of a serialised FileDescriptorSet."""

    def __init__(self, data: bytes) -> None:
        self._types: dict[str, list[tuple[str, int, int, int, str]]] = {}
        for file in all_of(data, 1):
            package = b"".join(all_of(file, 2)).decode()
            for message in all_of(file, 4):
                self._add(f".{package}", message)

    def decode(self, name: str, data: bytes) -> dict[str, Any]:
        """A message as a dict, what is not in it as protobuf's defaults; an unknown field is an error."""
        declared = self._types[name]
        values: dict[str, Any] = {
            field: [] if label == REPEATED else None if kind == MESSAGE else DEFAULTS.get(kind, 0)
            for field, _, label, kind, _ in declared
        }
        by_number = {number: each for each in declared if (number := each[1])}
        for number, value in parts(data):
            field, _, label, kind, type_name = by_number[number]
            for item in self._values(kind, type_name, value):
                if label == REPEATED:
                    values[field].append(item)
                else:
                    values[field] = item
        return values

    def _add(self, scope: str, message: bytes) -> None:
        name = f"{scope}.{first(message, 1).decode()}"
        self._types[name] = [
            (
                first(field, 1).decode(),
                first(field, 3),
                first(field, 4),
                first(field, 5),
                b"".join(all_of(field, 6)).decode(),
            )
            for field in all_of(message, 2)
        ]
        for nested in all_of(message, 3):
            self._add(name, nested)

    def _values(self, kind: int, type_name: str, value: Any) -> Iterator[Any]:
        if kind == MESSAGE:
            yield self.decode(type_name, value)
        elif kind in FIXED:  # a packed list is several, one after another
            yield from (item for (item,) in struct.iter_unpack(FIXED[kind], value))
        elif kind == 9:
            yield value.decode()
        else:
            yield bool(value) if kind == 8 else value


def parts(data: bytes) -> Iterator[tuple[int, Any]]:
    """The fields of a message as they are on the wire: numbers with whole numbers or bytes."""
    at = 0
    while at < len(data):
        key, at = varint(data, at)
        match key & 7:
            case 0:
                value, at = varint(data, at)
                yield key >> 3, value
                continue
            case 2:
                length, at = varint(data, at)
            case wire:
                length = {1: 8, 5: 4}[wire]
        assert at + length <= len(data), "cut short"
        yield key >> 3, data[at : at + length]
        at += length


def varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        shift += 7
        at += 1
        if data[at - 1] < 0x80:
            return value, at


def all_of(data: bytes, number: int) -> list[Any]:
    return [value for found, value in parts(data) if found == number]


def first(data: bytes, number: int) -> Any:
    return all_of(data, number)[0]


descriptors = cache(Descriptors)  # the same few come with thousands of messages

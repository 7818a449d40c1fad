"""Reading an exported file back with the mcap library, which knows nothing of the writer."""

from __future__ import annotations

import json
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from mcap.records import Schema

from tests.views.foxglove.protobuf import Descriptors

descriptors = cache(Descriptors)  # the same few come with thousands of messages


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

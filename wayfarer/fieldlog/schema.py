"""What values the keys of a log may have, as types: a class that is annotated with them describes a kind of record.

Each kind is one dataclass (in ``typed`` and ``run_events``), and each key one line of it, such as
``heading_deg: Angle``. From that line follow the attribute that views read, what the reader accepts, and the columns of
tables and plots (``lines``). ``docs/reference/log.md`` says what the keys mean; a test compares it with the classes.

Ranges are far wider than any run needs: in a log of schema 2, which has no checksums, a value outside of them was
changed after it was written. What a sensor said has no range. A failing part may say anything, and the log keeps it as
it came. Nor is there one for the duties that a third party's algorithm wanted.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple, get_type_hints

from wayfarer.fieldlog.fields import escape_control_chars

Record = dict[str, Any]
SCHEMA = 3  # each line has a checksum; schema 2 had none, and is read
OLDEST = 2

NUMBER = (float, int)  # exactly: in Python a bool is an int, in a log it is not


class Values(NamedTuple):
    """The types that a value may have, and for numbers the range. None, for "not known", may be but in ``STAMP``."""

    types: tuple[type, ...]
    least: float | None = None
    most: float | None = None


TEXT, LIST, TABLE, ANY_NUMBER, FLAG = (Values(types) for types in ((str,), (list,), (dict,), NUMBER, (bool,)))
COUNT = Values((int,), 0, 2**53)
METRES = Values(NUMBER, -1e6, 1e6)
ANGLE = Values(NUMBER, -360.0, 360.0)
SINCE_BOOT = Values(NUMBER, 0.0, 1e9)  # seconds of a loop's clock: 31 years
SINCE_1970 = Values(NUMBER, 0.0, 1e10)  # seconds: up to the year 2286

Text = Annotated[str | None, TEXT]
Texts = Annotated[tuple[str, ...], LIST]
Table = Annotated[Mapping[str, Any] | None, TABLE]
AnyNumber = Annotated[float | None, ANY_NUMBER]
Flag = Annotated[bool | None, FLAG]
Count = Annotated[int | None, COUNT]
Duty = Annotated[float | None, Values(NUMBER, -1.01, 1.01)]  # a driver may round
Angle = Annotated[float | None, ANGLE]
Metres = Annotated[float | None, METRES]
SinceBoot = Annotated[float | None, SINCE_BOOT]
Since1970 = Annotated[float | None, SINCE_1970]
Lasting = Annotated[float | None, Values(NUMBER, 0.0, 1e9)]  # seconds

# In each record; ``run`` and ``log_gap`` have no number.
STAMP: Mapping[str, Values] = {"n": COUNT, "t_s": SINCE_BOOT, "t_wall": SINCE_1970}


@cache
def keys_of(kind: type) -> dict[str, Values]:
    """Return the keys that a class describes: its attributes that are annotated with ``Values``."""
    hints = get_type_hints(kind, include_extras=True).items()
    return {key: hint.__metadata__[0] for key, hint in hints if hasattr(hint, "__metadata__")}


def fields_of(kind: type, record: Record) -> dict[str, Any]:
    """Return what a record says under the keys of a class, fit for a terminal; what is not known is left out."""
    found = {}
    for key in keys_of(kind):
        value = record.get(key)
        if value is not None:
            found[key] = value if type(value) is float else _fit(value)
    return found


def _fit(value: Any) -> Any:
    if isinstance(value, str):
        return escape_control_chars(value)
    if isinstance(value, list | tuple):  # from a file, or from the log that writes it
        return tuple(escape_control_chars(each) for each in value if isinstance(each, str)) if value else ()
    return value

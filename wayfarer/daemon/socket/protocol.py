"""Protocol of the control socket: requests and answers, one JSON object a line, in UTF-8.

::

    {"do": "arm", "asked_s": 5214.061, "heading_deg": 12.5}    ->  {"ok": true, ...details}
    {"do": "hold"}                                             ->  {"ok": false, "why": "what is wrong, what to do"}

What starts wheels (``STARTING``) says when the person asked, as ``asked_s``, in seconds of the rover's
``CLOCK_BOOTTIME`` (Python: ``time.clock_gettime(time.CLOCK_BOOTTIME)``). It is refused if that is too long ago, and
if the client closes its side before it has the answer (``safety.permission.Asked``). What stops them needs no time.

A key that is ``null`` counts as left out. Requests are checked by the client, for a quick answer, and again by the
server, because any program can write to the socket. Pure: no clock, no loop, no files.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import msgspec

from wayfarer.angles import wrap360
from wayfarer.errors import BadInput, UnknownName, WayfarerError
from wayfarer.safety.permission import Asked

TEXT_CHARACTERS = 500
DRIVER_CHARACTERS = 20
NAME_CHARACTERS = 40  # of an unknown name that is looked at: comparing a very long one would delay the control tick
WHOLE_MAX = 2**53  # up to here JavaScript knows whole numbers from each other
# Of one line, without its end. The longest request there is, a text of escaped characters, has 6,100 bytes; parsing
# 64 KiB of brackets would hold up the control tick for milliseconds.
REQUEST_BYTES = 8_192
REPLY_BYTES = 65_536
NORTHS = ("magnetic", "true")
_DRIVER = re.compile(rf"[a-z]{{1,{DRIVER_CHARACTERS}}}").fullmatch

Details = Mapping[str, object]


class RequestRefused(WayfarerError):
    """The daemon refuses a request, and nothing has changed; the text says why and what to do."""


class Commands(Protocol):
    """What the daemon can do, a method for each verb.

    Each returns details for the reply (plain JSON values), or raises ``RequestRefused`` or another error that says why.
    Headings are in degrees clockwise from magnetic north, 0 <= heading < 360. Only what starts the wheels may wait for
    something. Meanwhile others run, so that ``stop`` never waits for ``arm``. ``asked`` is the permission to start the
    wheels: fresh, or refused.
    """

    @property
    def being_checked(self) -> bool:
        """Whether somebody has asked to start the wheels, and the checks before that are under way."""

    async def status(self) -> Details:
        """Return the state of the rover."""

    async def arm(self, asked: Asked, heading_deg: float | None = None, *, without_log: bool = False) -> Details:
        """Begin to arm, towards a heading or, if None, the rover's own at the end of the start delay.

        ``without_log``: also if the log cannot be written.
        """

    async def disarm(self) -> Details:
        """Stop the wheels until the rover is re-armed."""

    async def hold(self) -> Details:
        """Stop the wheels until ``resume``; the mission continues."""

    async def resume(self, asked: Asked) -> Details:
        """Let the wheels turn again after ``hold``."""

    async def goal(self, heading_deg: float) -> Details:
        """Set a new goal heading."""

    async def manual_begin(self, asked: Asked, driver: str) -> Details:
        """Let a person drive by hand; ``driver`` says in a word by what ("page"), for the log.

        Returns ``lease``, which the other two need, ``deadman_s``, and ``mode``. The rover was disarmed, or its mission
        waits. Two seconds without a sample, or ``hold`` or ``disarm`` of anybody, end it. One client at a time.
        """

    async def manual_drive(self, lease: int, seq: int, forward: float, turn: float, sent_s: float) -> Details:
        """Take a sample of what a person wants; the wheels turn while the newest one is younger than the deadman.

        Args:
            lease: of ``manual_begin``.
            seq: grows with each sample taken of keys, stick or finger; a relay that repeats a sample repeats it.
            forward: share of full speed, -1 to 1, ahead positive.
            turn: share of full turn rate, -1 to 1, clockwise positive.
            sent_s: when it was taken, on the daemon's loop clock; on the same computer that is ``CLOCK_BOOTTIME``.

        Returns ``wheels`` as applied last, and ``why_not``: why they are not asked to turn, empty if they are.
        """

    async def manual_end(self, lease: int) -> Details:
        """Stop the wheels: the rover is disarmed as before, or its mission is held until ``resume``."""

    async def mark(self, text: str, *, keep: bool = True) -> Details:
        """Write a person's note into the log; ``keep``: no daemon deletes this run any more."""

    async def link_lost(self, text: str) -> Details:
        """Write into the log that a viewer has lost its connection. No client can ask for it; it is not a mark."""

    async def stop(self) -> Details:
        """End the run."""


class Verb(NamedTuple):
    """The keys that a request must have beside ``do``, and those that it may have."""

    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


VERBS: Mapping[str, Verb] = {
    "status": Verb(),
    "arm": Verb(needs=("asked_s",), takes=("heading_deg", "north", "without_log")),
    "disarm": Verb(),
    "hold": Verb(),
    "resume": Verb(needs=("asked_s",)),
    "goal": Verb(needs=("heading_deg",), takes=("north",)),
    "manual_begin": Verb(needs=("asked_s", "driver")),
    "manual_drive": Verb(needs=("lease", "seq", "forward", "turn", "sent_s")),
    "manual_end": Verb(needs=("lease",)),
    "mark": Verb(needs=("text",)),
    "stop": Verb(),
}
STARTING = frozenset(do for do, verb in VERBS.items() if "asked_s" in verb.needs)
STOPPING = frozenset({"stop", "hold", "disarm"})


class Request(NamedTuple):
    """A checked request: a verb, and only keys that it takes, each with a valid value."""

    do: str
    keys: dict[str, Any]


def read_line(line: bytes) -> dict[str, object]:
    """Return the JSON object of a line.

    Raises:
        BadInput: it is something else.
    """
    try:
        fields = msgspec.json.decode(line)
    except (ValueError, RecursionError):  # no JSON, no UTF-8, NaN, nested without end
        fields = None
    if not isinstance(fields, dict):
        raise BadInput('this line is not a JSON object: send one such as {"do": "status"}')
    return fields


def is_stop(line: bytes) -> bool:
    """Return whether a line asks to stop the wheels; it may still be refused."""
    try:
        do = read_line(line).get("do")
    except BadInput:
        return False
    return isinstance(do, str) and do in STOPPING


def check(fields: Mapping[str, object]) -> Request:
    """Return the request that these fields make.

    Raises:
        UnknownName: no such verb, or the verb takes no such key.
        BadInput: a key is missing, or its value is invalid.
    """
    keys = {key: value for key, value in fields.items() if value is not None}
    do = keys.pop("do", None)
    if not isinstance(do, str):
        raise BadInput(f'the request does not say what to "do": one of {", ".join(VERBS)}')
    if do not in VERBS:
        raise UnknownName("verb", do[:NAME_CHARACTERS], VERBS)
    needs, takes = VERBS[do]
    for key in keys:
        if key not in needs + takes:
            raise UnknownName(f"key of {do}", key[:NAME_CHARACTERS], ("do", *needs, *takes))
    for key in needs:
        if key not in keys:
            raise BadInput(f"{do} needs {key}: {_CHECKS[key][0]}")
    if "north" in keys and "heading_deg" not in keys:
        raise BadInput(f"{do} got north without heading_deg: north says which north the heading counts from, give both")
    return Request(do, {key: _checked(key, value) for key, value in keys.items()})


async def perform(
    request: Request, commands: Commands, declination_deg: float | None, is_there: Callable[[], bool]
) -> Details:
    """Carry out a request and return the details for the reply.

    ``declination_deg`` is the angle from true north to magnetic north at this place, east positive; None is not known.
    ``is_there`` returns whether who asked still waits for the reply.

    Raises:
        RequestRefused: the daemon refuses; its commands may raise other errors, too.
    """
    arguments = dict(request.keys)
    if request.do in STARTING:
        arguments["asked"] = Asked(arguments.pop("asked_s"), is_there)
    if arguments.pop("north", "magnetic") == "true":
        if declination_deg is None:
            raise RequestRefused(
                "a heading from true north needs the magnetic declination, which this rover's configuration does not"
                " give: set it, or give the heading from magnetic north"
            )
        arguments["heading_deg"] = wrap360(arguments["heading_deg"] - declination_deg)
    details: Details = await getattr(commands, request.do)(**arguments)  # the verbs are the names of the methods
    return details


def ok_reply(details: Details) -> bytes:
    """Return the line of a successful reply.

    Raises:
        RequestRefused: the line with the details is too long.
    """
    line = msgspec.json.encode({"ok": True, **details})
    if len(line) > REPLY_BYTES:
        raise RequestRefused(f"it was done, but the answer has {len(line)} bytes and {REPLY_BYTES} is the limit")
    return line + b"\n"


def error_reply(why: str) -> bytes:
    """Return the line of a reply that says why the request failed."""
    return msgspec.json.encode({"ok": False, "why": why}) + b"\n"


def _is_number(value: object, low: float, high: float) -> bool:
    """Return whether this is a number within bounds; NaN is not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high


_TIME = "a time in seconds of the rover's CLOCK_BOOTTIME, when the person asked"
# Of each key what its value must be, and whether one is.
_CHECKS: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    "heading_deg": (
        "a number of degrees clockwise from north, 0 <= heading < 360",
        lambda value: _is_number(value, 0, 360) and value != 360,
    ),
    "driver": (
        f"a word of at most {DRIVER_CHARACTERS} letters",
        lambda value: isinstance(value, str) and _DRIVER(value) is not None,
    ),
    "north": (" or ".join(NORTHS), lambda value: value in NORTHS),
    "without_log": ("true or false", lambda value: isinstance(value, bool)),
    "text": (
        f"a text of 1 to {TEXT_CHARACTERS} characters",
        lambda value: isinstance(value, str) and bool(value.strip()) and len(value) <= TEXT_CHARACTERS,
    ),
    **dict.fromkeys(("asked_s", "sent_s"), (_TIME, lambda value: _is_number(value, 0.0, 1e12))),
    **dict.fromkeys(("forward", "turn"), ("a number from -1 to 1", lambda value: _is_number(value, -1.0, 1.0))),
    **dict.fromkeys(
        ("lease", "seq"),
        ("a whole number from 0 to 2^53", lambda value: isinstance(value, int) and _is_number(value, 0, WHOLE_MAX)),
    ),
}


def _checked(key: str, value: object) -> object:
    wanted, fits = _CHECKS[key]
    if not fits(value):
        raise BadInput(f"{key} must be {wanted}, not {reprlib.repr(value)}")
    return value

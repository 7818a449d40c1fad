"""All errors that wayfarer raises on purpose.

::

    WayfarerError                 the base: its text is meant for the person holding the wires
    ├── BadInput                  the user gave something that cannot be used (exit code 2)
    │   ├── BadConfig             a configuration file: names file and key
    │   ├── OutOfRange            a number that a program gave: names it and its range
    │   ├── BadForest             a forest file: names file, line and reason
    │   ├── NothingReadable       a log without a record that can be read
    │   └── UnknownName           no such algorithm, driver or rover: offers the nearest names
    ├── NotThereYet               a port, name or address that this computer may have later (exit code 1)
    ├── DriverError               a part did not do what was asked
    │   ├── NotResponding         no answer from the part
    │   │   └── NotInstalled      a library that it needs cannot be imported
    │   ├── PowerLost             the part lost its power for a moment, and has forgotten its commands
    │   ├── WrongPart             something answered, but it is another part
    │   └── BadReading            an answer that cannot be true (range, NaN, checksum)
    ├── NotArmed                  a start of the wheels was refused; nothing has changed
    ├── MissingPart               an algorithm needs a part that this rover does not have
    ├── MissingPackage            something needs a package that is not installed
    ├── TrialNotRun               a simulated trial could not be run: no failure of its rover
    └── NothingScheduled          virtual time cannot continue: every task waits for an event that cannot occur

The control socket's own (``RequestRefused``, ``NoDaemon``, ``AlreadyRunning``) stand beside its code.

Texts say what happened, where, the likely cause and what to do, in one line.

Exit codes of the ``wayfarer`` command, and where each is decided:

====  =================================================================================================================
code  meaning
====  =================================================================================================================
0     done, and nothing is wrong; a run that a signal or ``wayfarer stop`` ended also has it
1     any other ``WayfarerError``, such as ``NotThereYet``, or the system refused something (``cli``); or the result is
      negative: a check failed (``cli.commissioning``), a replay differs (``cli.replay``), a log is
      unreadable (``logview.summary``), a board was not stopped (``daemon.stop_motors``)
2     input that cannot be used: ``BadInput``, ``MissingPart``, ``MissingPackage``, or a wrong option (``cli``)
3     records are missing: ``wayfarer logs check`` (``logview.summary``), ``wayfarer replay`` (``cli.replay``)
75    another daemon runs already, or drives these motors: ``AlreadyRunning`` (``daemon.socket.paths``)
129+  128 and the number of the signal that ended the command: 130 after Ctrl-C (``cli.run_trials``, Typer); 129,
      130 or 143 of ``wayfarer check`` and ``calibrate`` (``cli.terminal``)
141   nobody reads the output any more, as with ``| head -1`` (``cli``)
====  =================================================================================================================
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches

NEAR = 0.6  # how alike two names have to be, 0 to 1: "lunix" is like "linux"
MOST_LISTED = 20


class WayfarerError(Exception):
    """Base of all errors raised on purpose; ``exit_code`` is what a command that ends by it returns.

    Its text is one line: what happened, where, and what to do.

    >>> try:
    ...     load_rover("minrover")
    ... except WayfarerError as error:
    ...     print(error)
    unknown rover 'minrover': did you mean minirover?
    """

    exit_code = 1


class BadInput(WayfarerError):
    """The user gave something that cannot be used."""

    exit_code = 2


class BadConfig(BadInput):
    """A configuration that cannot be used; the text names the file and the key."""


class OutOfRange(BadInput, ValueError):
    """A number that a program gave is not a number, or outside of its range; the text names both."""


class BadForest(BadInput):
    """A forest that cannot be used; the text names the file, the line and the reason."""


class NothingReadable(BadInput):
    """A log without a record that can be read: it is empty, or all of it is damaged."""


class UnknownName(BadInput):
    """No such algorithm, driver or rover."""

    def __init__(self, kind: str, name: str, known: Iterable[str], end: str = "") -> None:
        known = sorted(known)
        near = near_names(name, known)
        hint = f"did you mean {' or '.join(near)}?" if near else f"known: {', '.join(_in_short(name, known))}"
        super().__init__(f"unknown {kind} '{one_line(name)}': {hint}{end}")


class NotThereYet(WayfarerError):
    """A device file, the name of a host, an address or a port that is missing now, and may come later.

    A slow boot may be the cause. So the exit code is not that of bad input, and systemd starts the daemon again.
    """


class DriverError(WayfarerError):
    """A part did not do what was asked of it.

    ``what`` is what happened. ``remedy`` is what to do, if the driver knows better than to look at wiring and power.
    """

    def __init__(self, what: str, remedy: str = "") -> None:
        super().__init__(f"{what}; {remedy}" if remedy else what)
        self.what, self.remedy = what, remedy


class NotResponding(DriverError):
    """No answer from the part; with a ``remedy`` if the computer is the reason, such as a missing permission."""


class NotInstalled(NotResponding):
    """A library that a part needs is not there, or cannot be imported; ``remedy`` is how to install it."""

    def __init__(self, where: str, error: ImportError, remedies: Mapping[str, str]) -> None:
        module = (error.name or "").partition(".")[0]
        remedy = remedies.get(module) or f"install {module or 'it'} for {sys.executable}"
        missing = isinstance(error, ModuleNotFoundError)
        what = f"the Python library {module} is not installed" if missing else f"{module or 'a library'} does not load"
        super().__init__(f"{where}: {what}" + ("" if missing else f" ({one_line(error)})"), remedy)


class PowerLost(DriverError):
    """The part lost its power for a moment, and has forgotten its commands."""

    def __init__(self, where: str) -> None:
        super().__init__(f"{where}: lost its power for a moment; if that happens again, check its plugs and battery")


class WrongPart(DriverError):
    """Something answered, but it is not the part that was expected."""

    def __init__(self, where: str, expected: str, got: str) -> None:
        super().__init__(f"{where}: expected {expected}, got {got}; another part at this address, or bad wiring")
        self.expected = expected
        self.got = got


class BadReading(DriverError):
    """The part answered with a value that cannot be true; the sample is dropped."""


class NotArmed(WayfarerError):
    """A start of the wheels was refused, and nothing has changed; the text says why."""


class MissingPart(WayfarerError):
    """An algorithm needs a part that this rover's configuration does not give."""

    exit_code = 2


def how_to_install(extra: str) -> str:
    """Return the command that adds an extra to an installation; by its name, nothing is built again."""
    return f"pip install 'wayfarer-rover[{extra}]'"


class MissingPackage(WayfarerError):
    """Something needs a package that is not installed; the text says how to get it."""

    exit_code = 2


class TrialNotRun(WayfarerError):
    """A simulated trial could not be run: its algorithm, a driver, the disk or a worker process failed, not its rover.

    The error that ended it is the cause (``__cause__``); one from another process has its traceback as a note.
    """

    def __init__(self, text: str, exit_code: int = 1) -> None:
        super().__init__(text)
        self.exit_code = exit_code


class NothingScheduled(WayfarerError):
    """Virtual time cannot continue: every task waits for an event that cannot occur."""


def near_names(name: str, known: Iterable[str]) -> list[str]:
    """Return which known names a mistyped one may mean, the nearest first and three at most; none if none is alike.

    Of dotted names the last parts are compared, so that the same section, such as ``escape.``, does not make two names
    alike.
    """
    last = {each: each.rpartition(".")[2].casefold() for each in known}
    near = get_close_matches(name.rpartition(".")[2].casefold(), set(last.values()), cutoff=NEAR)
    return [each for word in near for each in last if last[each] == word][:3]


def _in_short(name: str, known: Sequence[str]) -> Sequence[str]:
    """Return names to be listed: of many, those in the section that was typed, or the sections as ``escape.*``."""
    section = name[: name.rfind(".") + 1]
    known = [each for each in known if each.startswith(section)] or known
    if len(known) <= MOST_LISTED:
        return known
    sections = dict.fromkeys(f"{each.partition('.')[0]}.*" if "." in each else each for each in known)
    short = known if len(sections) == 1 else list(sections)
    return short if len(short) <= MOST_LISTED else [*short[:MOST_LISTED], f"and {len(short) - MOST_LISTED} more"]


def one_line(text: object) -> str:
    """Return a text, or that of an error, without its line breaks."""
    return " ".join(str(text).split())


def kind_and_text(error: BaseException) -> str:
    """Return kind and text of an error that was not raised on purpose, in one line."""
    return one_line(f"{type(error).__name__}: {error}").removesuffix(":")

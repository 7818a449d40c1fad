"""What decides the results of a campaign: one description for the command line, Python, ``campaign.json`` and the docs.

``CampaignSettings`` says it all: a field's name, type and default, and what it is in the string below it. Commands get
their options of it (``cli.trial_options``), ``run_campaign`` and others their arguments (``describe``), and a
results folder its ``campaign.json``. What people give is checked in ``experiments.checks``, for commands and Python.

Commands import this module when ``sim`` or ``sweep`` is asked for; it imports neither pydantic nor numpy.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, make_dataclass
from decimal import Decimal
from enum import Enum
from functools import cache
from itertools import pairwise
from operator import index
from textwrap import TextWrapper, dedent
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar, cast, get_type_hints

from annotated_types import Interval

from wayfarer import __version__
from wayfarer.errors import BadConfig, BadInput
from wayfarer.setting_ranges import Metres
from wayfarer.simhal.world.physics import Depth, GroundName, PhysicsName

if TYPE_CHECKING:
    from wayfarer.config.own_file import OwnFile
    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.simhal.world.forest_file import ForestFile

MOST_TRIALS = 1_000_000
MOST_DIGITS = 15  # of a number, before or after the point
NO_NUMBER_REACHES = 10 ** (MOST_DIGITS + 1)
Value = bool | int | float | str
Setting = Value | tuple[float, float]
"""The value of a key, or the bounds between which a number is drawn for each trial."""
NOTHING: dict[str, Any] = {}
F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class CampaignSettings:
    """All that decides the results of a campaign: the same settings give the same rows, on any computer."""

    algorithms: tuple[str, ...] = ("forest-pledge",)
    """Escape algorithms: names that ``wayfarer list`` prints, or your own as ``FILE.py:NAME`` or ``module:attribute``;
    ``paper`` means all ten of the paper. A name given twice runs once."""
    trials: Annotated[int, Interval(ge=1, le=MOST_TRIALS)] = 1000
    """Trials of each algorithm."""
    rover: RoverConfig = "sim"  # type: ignore[assignment]  # a name, until it is checked
    """Name of a built-in rover, or a rover file (TOML)."""
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1)] = 0
    """Random seed of the layouts and of all chance in the trials."""
    forests: ForestFile | None = None
    """Forest file, used in file order; ``reference``: the 500 of the paper's released simulator. Without it layouts are
    generated, another one in each trial."""
    site: str | None = None
    """A site of the paper's field trials instead of a forest, with another layout in each trial: extended-maze,
    dense-obstruction or forest-escape."""
    physics: PhysicsName = PhysicsName.light
    """light: fast built-in physics; mujoco: rigid bodies, wheels that grip and slip (slower)."""
    depth: Depth = Depth.DEVICE
    """device: simulated parts; bus: the real drivers over simulated chips (slower)."""
    ground: GroundName = GroundName.ideal
    """Ground in physics-light. The rover turns as commanded on ``ideal``; the wheels slip on leaf-litter, dry-soil and
    mud."""
    slip_mean_m: Metres = 10.0
    """Mean distance between slip events, metres."""
    budget_m: Annotated[float, Interval(gt=0, le=1e6)] = 1000.0
    """Path length after which a rover counts as entrapped, metres."""
    set: Mapping[str, Setting] = field(default_factory=dict)
    """A number of the simulated world, or any key of the rover file: ``KEY=VALUE``, or ``KEY=LOW:HIGH`` to draw one for
    each trial, such as sim.slope_deg=0:15 or senses=field. Another driver of a part begins with its own
    defaults. ``wayfarer list --keys`` names all keys."""
    faults: tuple[str, ...] = ()
    """A fault on purpose, S seconds after arming (default: 5) and for S seconds (default: to the
    end), such as silent:compass@20+5. ``wayfarer list --faults`` names the kinds."""
    spl: bool = False
    """Compute unknown shortest paths, for SPL (success weighted by path length); slower."""
    go_on: bool = False
    """Let a rover in a forest that has tried the whole ladder without progress rest and try again, as on a mission
    and at a site; slower. Without it its trial ends there, entrapped."""
    version: str = __version__
    """Of the software: not asked for, but kept with the results."""
    files: Mapping[str, OwnFile] = field(default_factory=dict)
    """The files of one's own that algorithms and drivers are in, by their names: kept with the results, too."""

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The keys that are drawn for each trial, with their bounds."""
        return {key: value for key, value in self.set.items() if isinstance(value, tuple)}

    @property
    def fixed_values(self) -> dict[str, Value]:
        """The keys that have one value in all trials."""
        return {key: value for key, value in self.set.items() if not isinstance(value, tuple)}


NAMES = tuple(each.name for each in fields(CampaignSettings) if each.name not in {"version", "files"})


class Form(NamedTuple):
    """How people write a setting that is not one number or one of a few words."""

    metavar: str
    python: str
    option: str | None = None  # if its name is not the field's
    default: str = ""  # as it is written


FORMS = {
    "algorithms": Form("NAME[,NAME...]", "str | Sequence[str]", "--algorithm", "forest-pledge"),
    "rover": Form("NAME|FILE", "str | Path | RoverConfig", None, "sim"),
    "forests": Form("FILE|reference", "str | Path | None"),
    "site": Form("SITE", "str | None"),
    "set": Form("KEY=VALUE|LOW:HIGH", "Mapping[str, float | str | tuple[float, float]]"),
    "faults": Form("KIND[:PART][@S[+S]]", "Sequence[str]", "--fault"),
}


def option_of(name: str) -> str:
    """Return a setting's option on the command line."""
    return (name in FORMS and FORMS[name].option) or f"--{name.replace('_', '-')}"


# -- values as people write them ---------------------------------------------------------------------------------------


@cache
def plain_kind() -> Any:
    """Return a dataclass of the settings that are a number, a switch or one of a few words: what pydantic checks."""
    unchecked = {"RoverConfig": object, "ForestFile": object, "OwnFile": object}
    types = get_type_hints(CampaignSettings, None, unchecked, include_extras=True)
    plain = [each for each in fields(CampaignSettings) if each.name in NAMES and each.name not in FORMS]
    return make_dataclass("Plain", [(each.name, types[each.name], field(default=each.default)) for each in plain])


def checked_plain(asked: Mapping[str, Any], spell: Callable[[str], str] = str) -> dict[str, Any]:
    """Return the values of those settings that are a number, a switch or one of a few words.

    Args:
        asked: some of them by name; numbers of NumPy are numbers too.
        spell: says how the person who is to read an error writes a setting.

    Raises:
        BadInput: a value is none of those that are allowed, or out of its range.
    """
    from wayfarer.config.messages import validated

    plain = {name: value for name, value in asked.items() if name in plain_kind().__dataclass_fields__}
    try:
        found = validated(plain_kind(), {name: as_plain(value) for name, value in plain.items()})
    except BadConfig as error:
        before, key, said = re.split(r"^key '(\w+)' = ", str(error))
        written = spell(key)
        raise BadInput(f"{before}{written}{' ' if written.startswith('--') else ' = '}{said}") from None
    return {name: getattr(found, name) for name in plain}


def as_plain(value: Any) -> Any:
    """Return any kind of number as Python's own, since settings are kept as JSON. Anything else stays as it is."""
    value = value.tolist() if hasattr(value, "tolist") else value  # NumPy's own; of an array a list
    if isinstance(value, bool | int | float | str | bytes | bytearray):
        return value
    for number in (index, float):
        with suppress(TypeError, ValueError, OverflowError):
            return number(value)
    return value


def value_of(text: str) -> Value:
    """Return a text of the command line as the value that it stands for: a number, true or false, else the text."""
    if text in {"true", "false"}:
        return text == "true"
    try:
        return as_number(as_decimal(text))
    except (ArithmeticError, ValueError):
        return text


def as_decimal(text: str) -> Decimal:
    """Return a number that can be a setting.

    Raises:
        ArithmeticError: it is not a number.
        ValueError: it is not finite, or so large or small that a whole number of it would fill the memory.
    """
    value = Decimal(text.strip())
    if not value.is_finite() or (value and abs(value.adjusted()) > MOST_DIGITS):
        raise ValueError(text)
    return value


def as_number(value: Decimal) -> int | float:
    """Return a whole number as an int, which a key that counts something needs."""
    return int(value) if value == value.to_integral_value() else float(value)


# -- the sentences, for help and documentation -------------------------------------------------------------------------


def sentences(table: type) -> dict[str, str]:
    """Return the string below each field of a class, which Python itself drops, as one line; inherited ones too."""
    found: dict[str, str] = {}
    own = [each for each in table.__mro__ if each.__module__ not in {"builtins", "pydantic.main"}]
    for kind in reversed(own):
        body = cast(ast.ClassDef, ast.parse(dedent(inspect.getsource(kind))).body[0]).body
        found |= {
            name.target.id: " ".join(below.value.value.split())
            for name, below in pairwise(body)
            if isinstance(name, ast.AnnAssign) and isinstance(name.target, ast.Name)
            and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        }  # fmt: skip
    return found


def describe(without: Sequence[str] = (), **defaults: Any) -> Callable[[F], F]:
    """Describe all settings of a function with ``**settings``: in its signature, and in the ``Args`` of its docstring.

    Args:
        without: settings that it has in another form.
        defaults: its own, if they differ.
    """

    def described(function: F) -> F:
        signature = inspect.signature(function)
        own = [each for each in signature.parameters.values() if each.kind is not each.VAR_KEYWORD]
        usual: dict[str, Any] = {each.name: each.default for each in fields(CampaignSettings)} | {"set": {}} | defaults
        others = [name for name in NAMES if name not in {*without, *signature.parameters}]
        settings = [_parameter(name, usual[name]) for name in others]
        last = [each for each in own if each.kind is each.KEYWORD_ONLY]
        parameters = [*(each for each in own if each not in last), *settings, *last]
        cast(Any, function).__signature__ = signature.replace(parameters=parameters)
        about, doc = sentences(CampaignSettings), function.__doc__ or ""
        if line := re.search(rf"^( +){re.escape(SETTINGS_LINE)}", doc, re.MULTILINE):
            indent = line[1]  # Python 3.13 removes that of the function
            wrap = TextWrapper(120, indent, indent + "    ", break_on_hyphens=False)
            names = [name for name in NAMES if name not in without and f"\n{indent}{name}: " not in doc]
            lines = [wrap.fill(f"{name}: {about[name]}") for name in names]
            function.__doc__ = doc[: line.start()] + "\n".join(lines) + "\n" + doc[line.end() :]
        return function

    return described


SETTINGS_LINE = "settings: those of a campaign, in the page of that name.\n"


def _parameter(name: str, default: Any) -> inspect.Parameter:
    if isinstance(default, Enum):
        kind, default = " | ".join(repr(each.value) for each in type(default)), default.value
    else:
        kind = FORMS[name].python if name in FORMS else type(default).__name__
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)

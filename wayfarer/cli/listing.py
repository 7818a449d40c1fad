"""``wayfarer list``: algorithms, rovers and drivers; what can be wrong with a rover; faults; keys of ``--set``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from wayfarer.cli.options import AsJson, check_together
from wayfarer.errors import BadInput
from wayfarer.extras import require

if TYPE_CHECKING:
    from rich.table import Table

    from wayfarer.safety.conditions import Condition
    from wayfarer.simhal.faults.fault_kind import FaultKind


class Described(NamedTuple):
    """An algorithm in words."""

    name: str
    family: str
    needs: tuple[str, ...]
    summary: str


def list_names(
    ctx: typer.Context,
    *,
    conditions: Annotated[
        bool, typer.Option("--conditions", help="List what can be wrong with a rover, and what it does about it.")
    ] = False,
    faults: Annotated[
        bool, typer.Option("--faults", help="List the kinds of --fault of wayfarer sim and run --sim.")
    ] = False,
    keys: Annotated[
        bool, typer.Option("--keys", help="List the keys of --set and wayfarer sweep, with their values on rover sim.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List all algorithms, rovers and drivers, also those of installed third-party packages."""
    from rich.console import Console

    from wayfarer.config.registry import algorithm_names, driver_names
    from wayfarer.config.rover_file import rover_names
    from wayfarer.logview.terminal import print_json

    check_together(ctx, excludes=(("conditions", "faults"), ("conditions", "keys"), ("faults", "keys")))
    if keys:
        _print_keys(as_json=as_json)
        return
    if faults:
        _print_faults(as_json=as_json)
        return
    if conditions:
        _print_conditions(as_json=as_json)
        return
    algorithms = list(map(_algorithm_in_words, algorithm_names()))
    if as_json:
        print_json({"algorithms": algorithms, "rovers": rover_names(), "drivers": driver_names()})
        return
    console = Console()
    console.print(_algorithm_table(algorithms))
    console.print()
    console.print("rovers: ", ", ".join(rover_names()) or "none", highlight=False)
    console.print("drivers:", ", ".join(driver_names()) or "none", highlight=False)
    console.print(
        "your own: FILE.py:NAME, looked for beside the rover file, then here; or module:NAME", highlight=False
    )


def _algorithm_table(algorithms: Iterable[Described]) -> Table:
    from wayfarer.logview.terminal_table import Column, table

    columns: list[Column[Described]] = [
        Column("algorithm", lambda each: each.name, left=True),
        Column("family", lambda each: each.family, left=True),
        Column("needs", lambda each: ", ".join(each.needs), left=True),
        Column("what it does", lambda each: each.summary, left=True, wraps=True),
    ]
    return table(columns, algorithms)


def _algorithm_in_words(name: str) -> Described:
    """Say what an algorithm is; a third party's that cannot be loaded must not hide the others."""
    from wayfarer.config.registry import find_algorithm

    try:
        found = find_algorithm(name)
    except BadInput as error:
        return Described(name, "", (), f"cannot be loaded: {error}")
    origin = "" if found.origin == "wayfarer" else f" (from {found.origin})"
    return Described(name, found.family, tuple(sorted(found.requires)), found.summary + origin)


def _print_conditions(*, as_json: bool) -> None:
    """Print the table of conditions, the dangers first."""
    from rich.console import Console

    from wayfarer.logview.terminal import print_json
    from wayfarer.logview.terminal_table import Column, table
    from wayfarer.safety.conditions import TABLE, Condition
    from wayfarer.vocabulary import KIND_TEXTS

    if as_json:
        print_json({"conditions": [*map(_condition_in_words, Condition)]})
        return
    columns: list[Column[Mapping[str, Any]]] = [
        Column("condition", lambda row: row["condition"], left=True),
        Column("level", lambda row: row["level"], left=True),
        Column("among people", lambda row: row["among_people"], left=True, wraps=True),
        Column("by hand", lambda row: row["by_hand"], left=True, wraps=True),
        Column("what is wrong, what the rover does, and until when", _sentences, left=True, wraps=True),
    ]
    console = Console()
    for kind, meaning in KIND_TEXTS.items():
        rows = (_condition_in_words(each) for each in Condition if TABLE[each].kind is kind)
        console.print(f"{kind.value}: {meaning}", highlight=False)
        console.print(table(columns, rows))
        console.print()


def _condition_in_words(condition: Condition) -> dict[str, str]:
    from wayfarer.safety.conditions import HOLDING_LEVELS, LEVELS, MANUAL_LEVELS, TABLE
    from wayfarer.vocabulary import WORDS

    words = WORDS[condition]
    return {
        "condition": condition.value,
        "level": LEVELS[condition].name.lower(),
        "among_people": HOLDING_LEVELS[condition].name.lower(),
        "by_hand": MANUAL_LEVELS[condition].name.lower(),
        "kind": TABLE[condition].kind.value,
        "what": words.what,
        "does": words.does,
        "ends_when": words.ends_when,
    }


def _sentences(row: Mapping[str, Any]) -> str:
    from wayfarer.fieldlog.wording import sentence

    return f"{sentence(row['what'])}. The rover {row['does']}. Until: {row['ends_when']}."


def _print_keys(*, as_json: bool) -> None:
    """Print the keys of ``--set``: those of the simulated world with what they are, then those of a rover file.

    Raises:
        MissingPackage: the extra that simulates is not installed.
    """
    require("simulating")
    from rich.console import Console

    from wayfarer.config.rover_file import load_rover
    from wayfarer.experiments.campaign import Campaign
    from wayfarer.experiments.keys import current, descriptions
    from wayfarer.logview.terminal import print_json
    from wayfarer.logview.terminal_table import Column, table
    from wayfarer.simhal.world.physics import PhysicsName

    about = {key: text.replace("``", "") for key, text in descriptions().items()}
    now = current(Campaign(rover=load_rover("sim"), physics=PhysicsName.mujoco))
    rows = [{"key": key, "value": value, "what": about.get(key)} for key, value in now.items()]
    if as_json:
        print_json({"keys": rows})
        return
    columns: list[Column[Mapping[str, Any]]] = [
        Column("key", lambda row: row["key"], left=True),
        Column("value", lambda row: "" if row["value"] is None else str(row["value"]), left=True),
        Column("what it is", lambda row: str(row["what"]), left=True, wraps=True),
    ]
    console = Console()
    console.print("the simulated world and the campaign", highlight=False)
    console.print(table(columns, [row for row in rows if row["what"]]))
    console.print("\nthe rover file; its page in the documentation says what each key is", highlight=False)
    console.print(table(columns[:2], [row for row in rows if not row["what"]]))


def _print_faults(*, as_json: bool) -> None:
    """Print the kinds of faults, what each can happen to, and what ``--fault`` makes of it.

    Raises:
        MissingPackage: the extra that simulates is not installed.
    """
    require("simulating")
    from rich.console import Console

    from wayfarer.logview.terminal import print_json
    from wayfarer.logview.terminal_table import Column, table
    from wayfarer.simhal.faults.kinds import KINDS
    from wayfarer.simhal.faults.process import PROCESS

    kinds = [_fault_in_words(*item) for item in KINDS.items()]
    if as_json:
        print_json({"faults": kinds})
        return
    columns: list[Column[Mapping[str, Any]]] = [
        Column("kind", lambda row: row["kind"], left=True),
        Column("part", lambda row: ", ".join(row["parts"]), left=True, wraps=True),
        Column("what happens, and with which numbers", _with_params, left=True, wraps=True),
    ]
    console = Console()
    for depth, of_process, where in (
        (None, False, "at any depth"), ("bus", False, "with --depth bus"), (None, True, "with wayfarer sim only"),
    ):  # fmt: skip
        rows = [row for row in kinds if row["depth"] == depth and (PROCESS in row["parts"]) is of_process]
        console.print(f"--fault KIND[:PART][@SECONDS[+SECONDS]], {where}", highlight=False, markup=False)
        console.print(table(columns, rows))
        console.print()


def _with_params(row: Mapping[str, Any]) -> str:
    params = ", ".join(f"{key} = {value}" for key, value in row["params"].items())
    return f"{row['what']} {params}".strip()


def _fault_in_words(name: str, kind: type[FaultKind]) -> dict[str, Any]:
    from wayfarer.simhal.faults.bus import BusFault
    from wayfarer.simhal.faults.kinds import parts_of

    params = kind(**kind.typical)
    return {
        "kind": name,
        "parts": parts_of(params),
        "depth": "bus" if issubclass(kind, BusFault) else None,
        "what": (kind.__doc__ or "").replace("``", ""),
        "params": asdict(params),
    }

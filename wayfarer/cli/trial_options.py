"""Options of the commands that run trials: one for each setting of a campaign, and those of the run itself."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from wayfarer.cli.options import (
    complete_algorithms,
    complete_faults,
    complete_rovers,
    complete_settings,
    complete_sites,
)
from wayfarer.extras import import_structlog

RUNNING = "Running"
REPEATED = {"set", "faults"}
COMPLETE: dict[str, Callable[..., list[str]]] = {
    "algorithms": complete_algorithms, "rover": complete_rovers, "site": complete_sites, "set": complete_settings,
    "faults": complete_faults,
}  # fmt: skip

Jobs = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Number of processes. (default: one per core)", rich_help_panel=RUNNING),
]
ClusterAddress = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Run on the workers of this Dask scheduler instead of local processes.",
        rich_help_panel=RUNNING,
    ),
]
Out = Annotated[Path, typer.Option(metavar="DIR", help="New or empty folder for the results.", rich_help_panel=RUNNING)]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue what was interrupted in --out.", rich_help_panel=RUNNING)
]


Command = Callable[..., None]


def with_settings(command: Command, **defaults: Any) -> Command:
    """Return a command with an option for each setting of a campaign, as ``CampaignSettings`` describes it.

    It gets those that were given as a dict, ``asked``. A value is checked with all others (``experiments.checks``).
    The options are made when the command is asked for: no other command needs the simulator's settings, and what an
    option means is in their source.

    Args:
        command: a function with an argument ``asked``.
        defaults: of this command, if they differ.
    """
    own = [each for each in inspect.signature(command, eval_str=True).parameters.values() if each.name != "asked"]
    first = [each for each in own if each.kind is not each.KEYWORD_ONLY]
    last = [each for each in own if each.kind is each.KEYWORD_ONLY]

    def without_options() -> None:
        """Stand for the command in the list of all."""

    without_options.__doc__ = command.__doc__
    cast(Any, without_options).complete = lambda: _complete(command, first, last, defaults)
    return without_options


def _complete(
    command: Command, first: list[inspect.Parameter], last: list[inspect.Parameter], defaults: dict[str, Any]
) -> Command:
    from wayfarer.experiments.settings import FORMS, NAMES, CampaignSettings, sentences, value_of

    usual: dict[str, Any] = {each.name: each.default for each in fields(CampaignSettings)} | {"set": None} | defaults
    about = sentences(CampaignSettings)
    options = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=False if usual[name] is False else None,
            annotation=_option(name, usual[name], about[name].replace("``", "")),
        )
        for name in NAMES
    ]  # fmt: skip

    def run(**values: Any) -> None:
        import_structlog()
        asked = {name: values.pop(name) for name in NAMES}
        given = {name: value for name, value in asked.items() if value not in (None, False, [], ())}
        plain = {name: value_of(value) for name, value in given.items() if name not in FORMS and isinstance(value, str)}
        command(**values, asked=defaults | given | plain)

    run.__doc__ = command.__doc__
    cast(Any, run).__signature__ = inspect.Signature([*first, *options, *last])
    run.__annotations__ = {each.name: each.annotation for each in [*first, *options, *last]}
    return run


def _option(name: str, default: Any, about: str) -> Any:
    """Return the type of a setting's option for Typer."""
    from wayfarer.experiments.settings import FORMS, option_of

    if isinstance(default, bool):
        return Annotated[bool, typer.Option(option_of(name), help=about)]
    if name in FORMS:
        metavar = FORMS[name].metavar
    elif isinstance(default, Enum):
        metavar = "|".join(each.value for each in type(default))
    else:
        metavar = "M" if isinstance(default, float) else "N"
    text = ",".join(default) if isinstance(default, tuple) else "" if default is None else f"{default}"
    about += " May be given again." if name in REPEATED else f" (default: {text})" if text else ""
    info = typer.Option(option_of(name), metavar=metavar, autocompletion=COMPLETE.get(name), help=about)
    return Annotated[list[str] | None if name in REPEATED else str | None, info]

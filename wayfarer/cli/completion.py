"""``--install-completion`` and ``--show-completion``, for the shell that is named after them, or else for this one.

Typer's own options are switches, which take no name.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer
from typer.completion import get_completion_inspect_parameters, install_callback, show_callback

OPTIONS = ("--install-completion", "--show-completion")
THIS = "this"
Shell = Literal["bash", "zsh", "fish", "powershell", "pwsh", "this"]


def _install(ctx: typer.Context, param: typer.CallbackParam, shell: str | None) -> None:
    install_callback(ctx, param, shell == THIS or shell)


def _show(ctx: typer.Context, param: typer.CallbackParam, shell: str | None) -> None:
    show_callback(ctx, param, shell == THIS or shell)


def _option(name: str, callback: Any, help_text: str) -> Any:
    help_text = f"{help_text} (default: this shell)"
    return typer.Option(name, callback=callback, is_eager=True, metavar="SHELL", help=help_text)


Install = Annotated[Shell | None, _option(OPTIONS[0], _install, "Install completion for bash, zsh, fish or pwsh.")]
Show = Annotated[Shell | None, _option(OPTIONS[1], _show, "Print what --install-completion installs.")]


def with_shell(arguments: list[str]) -> list[str]:
    """Return the arguments of ``wayfarer`` with a shell after an option of completion that stands alone."""
    return [*arguments, THIS] if arguments[-1:] in ([OPTIONS[0]], [OPTIONS[1]]) else arguments


def register_shells() -> None:
    """Make the shells known for which Typer completes a word that a person is typing."""
    get_completion_inspect_parameters()  # it does so beside what its name says

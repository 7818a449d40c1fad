"""Commands as Typer makes them, in this program's words: help without the notation of types."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

from wayfarer.errors import near_names

NO_BRACES = str.maketrans("", "", "{}")
HELP_OPTIONS = {"help_option_names": ["-h", "--help"]}  # settings of the root, which all commands inherit


class _Option(TyperOption):
    def display_type_rich(self, ctx: Any) -> str | None:
        """Return what stands for the value: ``light|mujoco``, not ``<light|mujoco>``; nothing for a switch."""
        return None if self.is_flag else self.metavar or self.display_type(ctx).strip("<>")


class _Argument(TyperArgument):
    def display_type_rich(self, ctx: Any) -> str | None:  # noqa: ARG002
        """Return nothing: the name says what the value is."""
        return None

    def get_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the name for the usage line: ``RESULTS``, or ``[RUN]`` if it may be left out."""
        return [piece.translate(NO_BRACES) for piece in super().get_usage_pieces(ctx)]


def _plain(param: Any) -> Any:
    """Give a parameter its plain notation. Typer makes its parameters itself, so that a class cannot be passed in."""
    if type(param) is TyperOption:
        param.__class__ = _Option
    elif type(param) is TyperArgument:
        param.__class__ = _Argument
    return param


class HelpCommand(TyperCommand):
    """A command whose help is plain."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return options and arguments, in plain notation."""
        return [_plain(param) for param in super().get_params(ctx)]


class HelpGroup(TyperGroup):
    """A group of commands whose help is plain."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, in plain notation."""
        return [_plain(param) for param in super().get_params(ctx)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; one with the settings of a campaign gets its options now (``with_settings``)."""
        found: Any = super().get_command(ctx, cmd_name)
        if complete := getattr(getattr(found, "callback", None), "complete", None):
            app = typer.Typer(add_completion=False)
            app.command(cmd_name, cls=HelpCommand, epilog=found.epilog)(complete())
            self.commands[cmd_name] = found = typer.main.get_command(app)
        return found

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return a command by its name, or offer the nearest ones."""
        try:
            return super().resolve_command(ctx, args)
        except typer.TyperException as error:
            error.message = error.message.rstrip(".") + _suggestion(args[0], self.commands)
            raise


def error_text(error: typer.TyperException) -> str:
    """Return what is wrong with a command line, and the nearest option, or an example of the command."""
    problem: Any = error  # Typer does not export the classes that differ
    if hasattr(problem, "possibilities") and problem.ctx:  # no such option
        params = problem.ctx.command.get_params(problem.ctx)
        return error.message + _suggestion(problem.option_name, [option for param in params for option in param.opts])
    text = error.format_message().replace("Value error, ", "", 1)  # the name of a class
    if hasattr(problem, "param_type"):  # something is missing
        for line in (problem.ctx.command.epilog or "").splitlines():  # which may be about exit codes only
            if line.startswith("wayfarer "):
                return f"{text.rstrip('.')}, for example: {line}"
    return text


def _suggestion(typed: str, known: Iterable[str]) -> str:
    names = {name.lstrip("-"): name for name in known}
    near = [names[each] for each in near_names(typed.lstrip("-"), names)]
    return f"; did you mean {' or '.join(near)}?" if near else ""

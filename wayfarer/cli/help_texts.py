"""Help of the commands: as Typer draws it, without the types and braces of its notation."""

from __future__ import annotations

from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

NO_BRACES = str.maketrans("", "", "{}")


class _Option(TyperOption):
    def display_type_rich(self, ctx: Any) -> str | None:
        """Return what stands for the value: ``light|mujoco``, not ``<light|mujoco>``; nothing for a switch."""
        return None if self.is_flag else self.metavar or self.display_type(ctx).strip("<>")


class _Argument(TyperArgument):
    def display_type_rich(self, ctx: Any) -> str | None:  # noqa: ARG002
        """Return nothing: the name says what the value is."""
        return None

    def get_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the name for the usage line: ``RESULTS``, or ``[RUN]`` where it may be left out."""
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

"""A command that must succeed, or must refuse in one line."""

from __future__ import annotations

from tests.conftest import Run


def succeed(run: Run, *arguments: object) -> str:
    """Return what it prints."""
    code, out, err = run(*arguments)
    assert code == 0, err
    return out


def refusal(run: Run, *arguments: object) -> str:
    """Return the one line that it prints instead of anything else."""
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    return err

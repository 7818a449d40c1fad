"""The bar on a terminal; the lines elsewhere are tested with the command (``tests/cli/test_cli.py``)."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from wayfarer.logview.progress_bar import shown_progress


def test_terminal_shows_how_many_are_done_and_is_left_clean() -> None:
    shown = StringIO()
    console = Console(file=shown, force_terminal=True, color_system=None, width=80)
    with shown_progress(console, 3, 10) as advance:
        advance("a trial")
    said = shown.getvalue()
    assert " 4/10 trials" in said
    assert "of 10 trials" not in said, "no lines beside the bar"
    assert said.endswith("\x1b[2K"), "the bar's line is erased"

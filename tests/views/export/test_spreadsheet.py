from __future__ import annotations

import pytest

from wayfarer.views.export.spreadsheet import without_formulas


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ('=HYPERLINK("http://x")', '\'=HYPERLINK("http://x")'),
        ("+1+1", "'+1+1"),
        ("-1+1", "'-1+1"),
        ("@SUM(1)", "'@SUM(1)"),
        ("\uff1d1", "'\uff1d1"),
        (" =1", "' =1"),
        ("\t=1", "'\t'=1"),  # some begin a cell after a tab
        ("a\t=1", "a\t'=1"),
        ("\ttext", "'\ttext"),
        ("\rtext", "'\r" + "text"),
        ("blocked;=1", "blocked;'=1"),
        ("blocked; @x; -y", "blocked;' @x;' -y"),
        ("blocked\n=1", "blocked\n'=1"),
        ("-1.5\n=1", "'-1.5\n'=1"),
    ],
)
def test_what_a_spreadsheet_would_run_is_quoted(text: str, shown: str) -> None:
    assert without_formulas(text) == shown


@pytest.mark.parametrize(
    "text",
    ["", "blocked", "nose_up; touched", "a=b", "Mark: =1", "-1.5", "+2", "-1e-05", "-inf", "-1.5; -2", "wheels; -0.5"],
)
def test_other_texts_and_numbers_stay(text: str) -> None:
    assert without_formulas(text) == text

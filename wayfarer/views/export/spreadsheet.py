"""Texts for CSV tables that a spreadsheet opens.

A spreadsheet runs a cell that begins with ``=``, ``+``, ``-`` or ``@``: ``=HYPERLINK(...)`` sends what is in the table
to its author. Logs and scenarios may come from somebody else, so an apostrophe goes before such a text, as OWASP
recommends (https://owasp.org/www-community/attacks/CSV_Injection). A number, which may begin with a sign, is none.
"""

from __future__ import annotations

import re
from functools import lru_cache

_NUMBER = r"[+-](?:[0-9]+\.?[0-9]*(?:e[+-]?[0-9]+)?|inf)"
# Where the decimal separator is a comma, spreadsheets begin a cell after each semicolon, some after a tab. Full-width
# signs count too.
_FORMULA = re.compile(
    rf"(?:^|(?<=[;\t\r\n]))(?=[\t\r\n]|\s*[=+\-@\uff1d\uff0b\uff0d\uff20])(?!\s*{_NUMBER}\s*(?:;|\Z))"
)


@lru_cache(maxsize=1000)
def without_formulas(text: str) -> str:
    """Return the text of a cell, or of a column's title, so that a spreadsheet shows it and runs nothing."""
    return _FORMULA.sub("'", text)

"""For the pages of the API: a doctest in a docstring is code, also if no heading stands above it."""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

# From the first prompt of a block to the empty line after it.
DOCTEST = re.compile(r"^>>> .*?(?=\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)


class FencedDoctests(Extension):
    """Puts a Markdown fence around each doctest that mkdocstrings reads."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change the docstring of a module, class, function or attribute."""
        if obj.docstring:
            obj.docstring.value = DOCTEST.sub(r"```pycon\n\g<0>\n```", obj.docstring.value)

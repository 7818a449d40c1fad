"""On which line of a file a key is."""

from __future__ import annotations

import pytest

from wayfarer.config.messages import line_of

TEXT = """\
# a comment
name = "x"

places = [
    1,
    2,
]
text = '''
[parts]
'''
"quoted" = 1\r
dotted.key = 1
[parts.motors]
address = { bus = 1, pins = [1, 2] }
[[scenario]]
[[scenario.fault]]
kind = "nack"
[[scenario]]
fault = [
    { kind = "jump" },
    { kind = "slip" },
]
"""


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("name", 2),
        ("places", 4),
        ("text", 8),
        ("quoted", 11),
        ("dotted.key", 12),
        ("parts", 13),
        ("parts.motors.address", 14),
        ("parts.motors.address.pins.1", 14),
        ("scenario", 15),
        ("scenario.0.fault.0.kind", 17),
        ("scenario.1", 18),
        ("scenario.1.fault.1.kind", 19),
        ("scenario.2", None),
        ("parts.compass", None),
        ("name.x", None),
    ],
)
def test_key_is_on_the_line_where_it_begins(key: str, line: int | None) -> None:
    assert line_of(TEXT, key) == line


def test_value_of_very_many_lines_hides_the_lines_after_it_only() -> None:
    text = "first = 1\nvalues = [\n" + "1,\n" * 1000 + "]\nlast = 1\n"
    assert [line_of(text, key) for key in ("first", "values", "last")] == [1, None, None]

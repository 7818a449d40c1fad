"""The tuned rover file: the text of the rover's own file with the tuned values, and the evidence for them above it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from textwrap import wrap

from wayfarer.config.rover_file import RoverConfig, laid_over, load_rover, parse_rover, rover_text
from wayfarer.config.rover_path import SCHEMA_ELSEWHERE
from wayfarer.errors import BadConfig
from wayfarer.experiments.sweep import nested
from wayfarer.fieldlog.fields import escape_control_chars

WIDTH = 100  # of a comment
SCHEMA = "#:schema"  # of the first line
HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(#.*)?$")


def overlaid(where: str, values: Mapping[str, tuple[float, float]], evidence: Iterable[str] = ()) -> str:
    """Return a rover's file with these keys changed.

    Args:
        where: the rover's file, or the name of a shipped one.
        values: the present and the tuned value of each dotted key.
        evidence: lines of plain text that stand above it, as comments.

    Raises:
        BadConfig: its file is written in a way in which the keys cannot be changed.
    """
    lines = rover_text(where).lstrip("\ufeff").splitlines()
    if lines[0].startswith(SCHEMA):
        del lines[0]
    for key, (before, after) in values.items():
        lines = _with(lines, key, f"{after}  # tuned; before: {before:g}")
    told = [
        part for text in evidence for part in wrap(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False) or [""]
    ]
    top = [f"# {escape_control_chars(part)}".rstrip() for part in told]
    text = SCHEMA_ELSEWHERE + "\n".join([*top, *lines]) + "\n"
    _check(where, text, laid_over(load_rover(where), nested({key: after for key, (_, after) in values.items()})))
    return text


def _check(where: str, text: str, expected: RoverConfig) -> None:
    try:
        right = parse_rover(where, text) == expected
    except BadConfig:
        right = False
    if not right:
        raise BadConfig(
            f"{where}: its keys cannot be changed by tune; write each on a separate line below its [section], without "
            "inline tables or dotted keys"
        )


def _with(lines: Sequence[str], key: str, value: str) -> list[str]:
    """Return the lines of a file with a key's line replaced or added."""
    section, _, name = key.rpartition(".")
    line, own = f"{name} = {value}", re.compile(rf"\s*{re.escape(name)}\s*=")
    sections = list(_sections(lines))
    within = [number for number, at in enumerate(sections) if at == section]
    for number in within:
        if own.match(lines[number]):
            return [*lines[:number], line, *lines[number + 1 :]]
    if section and not within:
        return [*lines, "", f"[{section}]", line]
    below_name = next((number + 1 for number in within if lines[number].startswith("name")), 0)
    after = within[0] + 1 if section else below_name
    return [*lines[:after], line, *lines[after:]]


def _sections(lines: Sequence[str]) -> Iterator[str]:
    """Yield the section of each line; a header belongs to its own."""
    section = ""
    for line in lines:
        if header := HEADER.match(line):
            section = header[1].strip()
        yield section

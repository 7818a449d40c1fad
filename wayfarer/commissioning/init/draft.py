"""A rover file that comes to be, key by key: what an answers file says, else what a person says, else the default.

An answer is checked by what checks rover files, so each range stands in one place, beside the code that uses it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from wayfarer.commissioning.init.rover_writer import toml_value
from wayfarer.config.key_schema import allowed, key_schema, kinds
from wayfarer.config.messages import validated
from wayfarer.config.rover_file import RoverConfig
from wayfarer.errors import BadConfig

NONE = "none"
_YES, _NO = {"true", "yes", "y"}, {"false", "no", "n"}

Table = dict[str, Any]


class Person(Protocol):
    """Who answers: a person at a terminal, or nobody, who takes every default."""

    patient: bool  # asks again after a wrong answer

    def say(self, text: str) -> None:
        """Show a line."""

    def ask(self, question: str, default: str) -> str:
        """Return the answer to a question, the default if it is Enter alone.

        Raises:
            BadInput: the input has ended.
        """


class Draft:
    """The tables of a rover file.

    Args:
        answers: what is not asked: tables as in a rover file.
        person: answers the rest.

    Raises:
        BadConfig: what should be a table is none.
    """

    def __init__(self, answers: Mapping[str, Any], person: Person) -> None:
        self.table: Table = {}
        self.person = person
        self._answers = answers
        parts = answers.get("parts", {})
        tables = {key: value for key, value in answers.items() if "$ref" in key_schema(key) or key == "parts"}
        tables |= {f"parts.{part}": value for part, value in parts.items()} if isinstance(parts, dict) else {}
        for key, value in tables.items():
            if not isinstance(value, dict):
                raise BadConfig(f"key '{key}' = {value!r}: input should be a table")

    def given(self, table: str) -> Table:
        """Return what the answers file says of a table, such as "parts.motors"."""
        found: Any = self._answers
        for section in filter(None, table.split(".")):
            found = found.get(section, {})
        return dict(found)

    def ask(self, key: str, default: Any) -> Any:
        """Set a dotted key, and return its value.

        Raises:
            BadConfig: the answers file, or the default, is not allowed; the text names the key and what is.
            BadInput: the input has ended.
        """
        section, _, name = key.rpartition(".")
        table = self._section(section)
        given = self.given(section).get(name)
        schema = key_schema(key, table.get("driver"))
        asked = given is None
        while True:
            answer = self.person.ask(_question(key, schema), _shown(name, default, schema)) if asked else ""
            try:
                _set(table, name, _value(answer, schema) if asked else given)
                problem = self._problem(key)
            except ValueError:
                problem = f"key '{key}' = '{answer}': it is no {allowed(schema)}"
            if problem is None:
                return table.get(name)
            if not (asked and self.person.patient):
                raise BadConfig(problem)
            self.person.say(problem)

    def take_answers(self) -> None:
        """Take what the answers file says of keys that were not asked."""
        for key, value in self._answers.items():
            if key != "parts":
                self.table[key] = {**self.table.get(key, {}), **value} if isinstance(value, dict) else value
        for part, table in self._answers.get("parts", {}).items():
            if table.get("driver") != NONE:
                self.table["parts"][part] = {**self.table["parts"].get(part, {}), **table}

    def _section(self, name: str) -> Table:
        table = self.table
        for section in filter(None, name.split(".")):
            table = table.setdefault(section, {})
        return table

    def _problem(self, key: str) -> str | None:
        """Return what is wrong with a key; what is wrong with others is found at their own turn."""
        try:
            validated(RoverConfig, self.table)
        except BadConfig as error:
            return str(error) if f"'{key}'" in str(error) else None
        return None


def _question(key: str, schema: Table) -> str:
    """Return the question for a key: what it means, its name, what is allowed."""
    meaning = schema.get("description", "").partition(". ")[0].rstrip(".")
    range_text = f" ({allowed(schema)})" if schema else ""
    return "\n".join(filter(None, [meaning, f"  {key}{range_text}"]))


def _shown(name: str, value: Any, schema: Table) -> str:
    """Return a default as a person types it; empty where a key has none."""
    if value is None:
        return NONE if "null" in kinds(schema) else ""
    return value if isinstance(value, str) else toml_value(name, value)


def _value(answer: str, schema: Table) -> Any:
    """Return what a person typed as a value of a key; None for ``none``.

    Raises:
        ValueError: it is none of the types that the key may have.
    """
    types = kinds(schema)
    if "null" in types and answer == NONE:
        return None
    if "boolean" in types:
        if answer.lower() not in _YES | _NO:
            raise ValueError(answer)
        return answer.lower() in _YES
    if "integer" in types:
        return int(answer, 0)
    return float(answer) if "number" in types else answer


def _set(table: Table, name: str, value: Any) -> None:
    """Set a key, or leave it out where it has no value."""
    table[name] = value
    if value is None:
        del table[name]

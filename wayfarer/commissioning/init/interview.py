"""The questions of ``wayfarer init``: what nothing on the buses shows, each with its default and its range.

The draft of the rover file begins as the shipped rover with the same motor board. A question changes one key, and what
follows from the body is computed as in the shipped files. An answer is checked by what checks rover files, so a range
stands in one place. What an answers file says is not asked.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields
from typing import Any, Protocol

from wayfarer.commissioning.init.probe import FoundPart, Inventory
from wayfarer.config.factory import NEEDED
from wayfarer.config.key_schema import allowed, key_schema, kinds
from wayfarer.config.messages import validated
from wayfarer.config.registry import driver_names, find_driver
from wayfarer.config.rover_file import RoverConfig, part_settings, rover_text
from wayfarer.errors import BadConfig, BadInput

PARTS = ("compass", "motion", "motors", "contact", "light", "position")
NONE = "none"
WHERE = ("bus", "port", "address", "camera")  # settings that say where a part is
LIKE = {"thunderborg": "minirover"}  # the shipped rover with a motor board
LIKE_OTHERS = "forestrover"
# As the released field code drives: 0.3 of full duty (the shipped rover files).
CRUISE_SHARE = 0.3
TRACK_OF_WIDTH = 1.25  # effective, for turning: sim.toml, 0.5 m of a body of 0.4 m
STALL_M = 0.25  # commanded until the rover is immobilised, as of the shipped rovers

Table = dict[str, Any]


class Person(Protocol):
    """Who answers: a person at a terminal, or nobody, who takes every default."""

    patient: bool

    def say(self, text: str) -> None:
        """Show a line."""

    def ask(self, question: str, default: str) -> str:
        """Return the answer to a question, the default if it is Enter alone.

        Raises:
            BadInput: the input has ended.
        """


def interview(inventory: Inventory, answers: Mapping[str, Any], person: Person) -> Table:
    """Return the tables of a rover file.

    Args:
        inventory: what is on the buses.
        answers: what is not asked: tables as in a rover file; the driver of a part may be ``none``.
        person: answers the rest.

    Raises:
        BadConfig: the answers contradict each other; the text names the key and what is allowed.
        BadInput: the input has ended.
    """
    return _Interview(inventory, answers, person).draft()


class _Interview:
    def __init__(self, inventory: Inventory, answers: Mapping[str, Any], person: Person) -> None:
        self._inventory, self._answers, self._person = inventory, answers, person
        self._parts: Table = {}
        self._table: Table = {}

    def draft(self) -> Table:
        """Ask for the parts, then for the body, then for what follows from them."""
        motors = self._driver_of("motors")
        like: Table = tomllib.loads(rover_text(LIKE.get(motors, LIKE_OTHERS)))
        self._table = {**like, "parts": {}}
        self._choose_parts(like, motors)
        self._ask("name", "my-rover")
        self._ask_body(like)
        if "board" in like:
            for key in like["board"]:
                self._ask(f"board.{key}", like["board"][key])
        if not hasattr(part_settings("motors", self._table["parts"]["motors"])[1], "deadman_s"):
            self._ask("safety.allow_no_deadman", False)
        self._ask("safety.start_delay_s", self._table["safety"]["start_delay_s"])
        self._take_other_answers()
        validated(RoverConfig, self._table)
        return self._table

    # -- parts -----------------------------------------------------------------------------------------------------

    def _choose_parts(self, like: Table, motors: str) -> None:
        for part in PARTS:
            driver = motors if part == "motors" else self._driver_of(part)
            if driver != NONE:
                self._describe_part(part, driver, like["parts"].get(part, {}))
        if "motion" not in self._table["parts"]:
            self._table["anomaly_source"] = "contact"
        elif self._table["parts"]["motion"]["driver"] != like["parts"]["motion"]["driver"]:
            self._table.pop("rates", None)  # the other sensor's

    def _driver_of(self, part: str) -> str:
        """Return which driver a part has, ``none`` for a part that there is not."""
        drivers = [name for name in driver_names() if _is_for(name, part)]
        choices = drivers if part in NEEDED else [*drivers, NONE]
        given = self._answers.get("parts", {}).get(part, {}).get("driver")
        if given is not None:
            return str(given)
        default = self._likely_driver(part)
        while (answer := self._person.ask(f"{part}: its driver ({', '.join(choices)})", default)) not in choices:
            if ":" in answer:
                break
            self._person.say(f"'{answer}' is none of them; a driver of your own is module:Class")
        return answer

    def _likely_driver(self, part: str) -> str:
        if found := self._found(part):
            return found[0].driver
        if part == "motion" and self._inventory.cameras:
            return "camera_motion"
        return {"compass": "cmps14", "motion": "pmw3901", "motors": "sabertooth"}.get(part, NONE)

    def _found(self, part: str, driver: str | None = None) -> list[FoundPart]:
        return [each for each in self._inventory.parts if each.part == part and driver in (None, each.driver)]

    def _describe_part(self, part: str, driver: str, like: Table) -> None:
        """Put a part into the draft: where it was found, as in the shipped rover, and what a person says of it."""
        found = self._found(part, driver)[:1]
        table = {**(like if like.get("driver") == driver else {}), "driver": driver}
        for each in found:
            table |= each.settings
        self._table["parts"][part] = table
        asked = [f"parts.{part}.{key}" for key in _to_ask(driver, found=bool(found))]
        while True:
            for key in asked:
                self._ask(key, self._default(key))
            try:
                part_settings(part, table | self._given(f"parts.{part}"))
                return
            except ValueError as error:
                if not (self._person.patient and asked):
                    raise BadConfig(str(error)) from None
                self._person.say(str(error))

    # -- the body --------------------------------------------------------------------------------------------------

    def _ask_body(self, like: Table) -> None:
        before = dict(like["vehicle"])
        self._ask("vehicle.length_m", before["length_m"])
        width_m = self._ask("vehicle.width_m", before["width_m"])
        same = width_m == before["width_m"]
        track_m = self._ask("vehicle.track_m", before["track_m"] if same else round(width_m * TRACK_OF_WIDTH, 2))
        speed_m_s = self._ask("vehicle.max_speed_m_s", before["max_speed_m_s"])
        cruise_m_s = self._ask("escape.cruise_m_s", round(speed_m_s * CRUISE_SHARE, 2))
        escape, detector = self._table["escape"], self._table["detector"]
        escape["reverse_m_s"] = cruise_m_s
        # The same wheel speeds on another track.
        escape["probe_radius_m"] = round(like["escape"]["probe_radius_m"] * track_m / before["track_m"], 2)
        detector["immobilised_s"] = min(max(round(STALL_M / cruise_m_s, 1), 0.3), detector.get("nowhere_s", 2.0))
        if self._table["vehicle"] != before:
            self._table.pop("chassis", None)  # of the shipped body
        if "difference_speed_m_s" in self._table["parts"].get("motion", {}):
            self._table["parts"]["motion"]["difference_speed_m_s"] = cruise_m_s

    # -- one key ---------------------------------------------------------------------------------------------------

    def _ask(self, key: str, default: Any) -> Any:
        """Set a key to what the answers file, else the person, says; return that."""
        *sections, name = key.split(".")
        table = self._table
        for section in sections:
            table = table.setdefault(section, {})
        given = self._given(".".join(sections)).get(name)
        schema = key_schema(key, table.get("driver"))
        while True:
            _set(table, name, default if given is None else given)
            if given is None:
                answer = self._person.ask(_question(key, schema), _shown(default))
                try:
                    _set(table, name, _value(answer, schema))
                except (ValueError, KeyError):
                    self._person.say(f"'{answer}' is no {allowed(schema, '')}")
                    continue
            if (problem := self._problem(key)) is None:
                return table.get(name)
            if given is not None or not self._person.patient:
                raise BadConfig(problem)
            self._person.say(problem)

    def _given(self, table: str) -> Table:
        """Return what the answers file says of a table."""
        given: Any = self._answers
        for section in filter(None, table.split(".")):
            given = given.get(section, {})
        return dict(given)

    def _default(self, key: str) -> Any:
        """Return what a key of a part has in the draft, or by its driver; of a serial port the likeliest there is."""
        _, part, name = key.split(".")
        table = self._table["parts"][part]
        value = table.get(name, key_schema(key, table["driver"]).get("default"))
        is_port = name == "port" and isinstance(value, str)
        return next(iter(self._inventory.ports), value) if is_port else value

    def _problem(self, key: str) -> str | None:
        """Return what is wrong with a key; what is wrong with others is found at their own turn."""
        try:
            validated(RoverConfig, self._table)
        except BadConfig as error:
            return str(error) if f"'{key}'" in str(error) else None
        return None

    def _take_other_answers(self) -> None:
        """Take what the answers file says of keys that are never asked."""
        for key, value in self._answers.items():
            if isinstance(value, dict) and key != "parts":
                self._table[key] = self._table.get(key, {}) | value
            elif key != "parts":
                self._table[key] = value
        for part, value in self._answers.get("parts", {}).items():
            if value.get("driver") != NONE:
                self._table["parts"][part] = self._table["parts"].get(part, {}) | value


def _is_for(name: str, part: str) -> bool:
    with suppress(BadInput):  # of a package that cannot be imported
        return getattr(find_driver(name), "part", None) == part
    return False


def _to_ask(name: str, *, found: bool) -> list[str]:
    """Return which settings of a driver are asked: where a part is that was not found, and what nothing shows."""
    driver = find_driver(name)
    asked = {*getattr(driver, "unseen", ()), *(() if found else WHERE)}
    return [
        each.name
        for each in fields(driver.Settings)
        if each.name in asked or (each.default is MISSING and each.default_factory is MISSING)
    ]


def _question(key: str, schema: Table) -> str:
    """Return the question for a key: what it means, its name, what is allowed."""
    meaning = schema.get("description", "").partition(". ")[0].rstrip(".")
    range_text = allowed(schema, "") if schema else ""
    return "\n".join(filter(None, [meaning, f"  {key}{range_text and f' ({range_text})'}"]))


def _shown(value: Any) -> str:
    """Return a value as a person types it."""
    if value is None:
        return NONE
    return str(value).lower() if isinstance(value, bool) else str(value)


def _value(answer: str, schema: Table) -> Any:
    """Return what a person typed as a value of a key; None for ``none``.

    Raises:
        ValueError: it is none of the types that the key may have.
    """
    types = kinds(schema)
    if "null" in types and answer == NONE:
        return None
    if "boolean" in types:
        return {"true": True, "yes": True, "y": True, "false": False, "no": False, "n": False}[answer.lower()]
    if "integer" in types:
        return int(answer, 0)
    return float(answer) if "number" in types else answer


def _set(table: Table, name: str, value: Any) -> None:
    """Set a key, or leave it out where it has no value."""
    table[name] = value
    if value is None:
        del table[name]

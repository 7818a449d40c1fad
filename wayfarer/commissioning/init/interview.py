"""The questions of ``wayfarer init``: what nothing on the buses shows, each with a default.

The defaults are those of the shipped rover with the same motor board. What follows from the body is computed as in the
shipped files.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import MISSING, fields
from typing import Any

from wayfarer.commissioning.init.draft import NONE, Draft, Person, Table
from wayfarer.commissioning.init.probe import FoundPart, Inventory
from wayfarer.config.factory import NEEDED
from wayfarer.config.key_schema import key_schema
from wayfarer.config.messages import validated
from wayfarer.config.registry import driver_names, find_driver
from wayfarer.config.rover_file import RoverConfig, part_settings, rover_text
from wayfarer.errors import BadConfig, BadInput

SHIPPED_ROVERS = ("forestrover", "minirover")  # whose parts and bodies are the defaults; the first where none is alike
PARTS = ("compass", "motion", "motors", "contact", "light", "position")
NAMES = {"motion": "motion sensor", "contact": "bumper", "light": "status light", "position": "receiver"}  # for people
USUAL = {"compass": "cmps14", "motion": "pmw3901", "motors": "sabertooth"}
WHERE = ("bus", "port", "address", "camera")  # settings that say where a part is
CRUISE_SHARE = 0.3  # of full speed, as the released field code drives (shipped rover files)
TRACK_OF_WIDTH = 1.25  # effective, for turning (shipped rover files)
# Commanded in ``immobilised_s``, as in the shipped rover files; the time is within what is tested.
IMMOBILISED_M, IMMOBILISED_MIN_S, IMMOBILISED_MAX_S = 0.25, 0.3, 2.0


def interview(inventory: Inventory, answers: Mapping[str, Any], person: Person) -> Table:
    """Return the tables of a rover file.

    Args:
        inventory: what is on the buses.
        answers: what is not asked: tables as in a rover file; the driver of a part may be ``none``.
        person: answers the rest.

    Raises:
        BadConfig: an answer is not allowed; the text names the key and what is.
        BadInput: the input has ended.
    """
    draft = Draft(answers, person)
    parts = _Parts(inventory, draft)
    motors = parts.driver_of("motors")
    rovers = [tomllib.loads(rover_text(name)) for name in SHIPPED_ROVERS]
    like = next((rover for rover in rovers if rover["parts"]["motors"]["driver"] == motors), rovers[0])
    draft.table = deepcopy(like) | {"parts": {}}
    draft.ask("name", "my-rover")
    for part in PARTS:
        driver = motors if part == "motors" else parts.driver_of(part)
        if driver != NONE:
            alike = next((rover for rover in rovers if rover["parts"].get(part, {}).get("driver") == driver), {})
            parts.describe(part, driver, alike.get("parts", {}).get(part, {}))
            if part == "motion":
                draft.table["rates"] = alike.get("rates", {})
        elif part == "motion":
            draft.table["anomaly_source"] = "contact"
    _ask_body(draft, like)
    for key, value in like.get("board", {}).items():
        draft.ask(f"board.{key}", value)
    if not hasattr(part_settings("motors", draft.table["parts"]["motors"])[1], "deadman_s"):
        draft.ask("safety.allow_no_deadman", False)
    draft.ask("safety.start_delay_s", like["safety"]["start_delay_s"])
    draft.take_answers()
    validated(RoverConfig, draft.table)
    return draft.table


class _Parts:
    """Which parts a rover has, and what its file says of them."""

    def __init__(self, inventory: Inventory, draft: Draft) -> None:
        self._inventory, self._draft = inventory, draft
        self._drivers = driver_names()  # asking installed packages takes time

    def driver_of(self, part: str) -> str:
        """Return which driver a part has, ``none`` for a part that there is not."""
        needed = part in NEEDED or (part == "contact" and self._draft.table.get("anomaly_source") == "contact")
        drivers = [name for name in self._drivers if _is_for(name, part)]
        given = self._draft.given(f"parts.{part}").get("driver")
        if given is None:
            return self._found_driver(part) or self._ask_driver(part, drivers if needed else [*drivers, NONE])
        if given == NONE and needed:
            raise BadConfig(f"key 'parts.{part}.driver' = '{NONE}': the rover needs this part; {', '.join(drivers)}")
        return str(given)

    def describe(self, part: str, driver: str, like: Mapping[str, Any]) -> None:
        """Put a part into the draft: as in a shipped rover, where it was found, and what a person says of it."""
        place = next((each.settings for each in self._found(part) if each.driver == driver), None)
        table = {"driver": driver, **like, **(place or {})}
        self._draft.table["parts"][part] = table
        asked = _to_ask(driver, found=place is not None)
        while True:
            for name in asked:
                self._draft.ask(f"parts.{part}.{name}", self._default(part, name))
            try:
                part_settings(part, table | self._draft.given(f"parts.{part}"))
                return
            except ValueError as error:
                if not (self._draft.person.patient and asked):
                    raise BadConfig(str(error)) from None
                self._draft.person.say(str(error))

    def _found(self, part: str) -> list[FoundPart]:
        return [each for each in self._inventory.parts if each.part == part]

    def _found_driver(self, part: str) -> str | None:
        return next((each.driver for each in self._found(part)), None)

    def _ask_driver(self, part: str, choices: list[str]) -> str:
        likely = "camera_motion" if part == "motion" and self._inventory.cameras else USUAL.get(part, choices[-1])
        question = f"Driver of the {NAMES.get(part, part)}\n  parts.{part}.driver ({', '.join(choices)})"
        while True:
            answer = self._draft.person.ask(question, likely)
            if answer in choices or _is_for(answer, part):
                return answer
            self._draft.person.say(
                f"'{answer}' is no driver for {part}; a driver of another package is given as module:Class"
            )

    def _default(self, part: str, name: str) -> Any:
        """Return what a key has in the draft, or by its driver; of a serial port the likeliest that there is."""
        table = self._draft.table["parts"][part]
        value = table.get(name, key_schema(f"parts.{part}.{name}", table["driver"]).get("default"))
        is_device = name == "port" and isinstance(value, str)
        return next(iter(self._inventory.ports), value) if is_device else value


def _ask_body(draft: Draft, like: Table) -> None:
    """Ask for size and speed, and compute what follows from them."""
    before = like["vehicle"]
    draft.ask("vehicle.length_m", before["length_m"])
    width_m = draft.ask("vehicle.width_m", before["width_m"])
    wide = width_m == before["width_m"]
    track_m = draft.ask("vehicle.track_m", before["track_m"] if wide else round(width_m * TRACK_OF_WIDTH, 2))
    speed_m_s = draft.ask("vehicle.max_speed_m_s", before["max_speed_m_s"])
    cruise_m_s = draft.ask("escape.cruise_m_s", round(speed_m_s * CRUISE_SHARE, 2))
    # A probe's curve has the same wheel speeds on another track.
    radius_m = round(like["escape"]["probe_radius_m"] * track_m / before["track_m"], 2)
    draft.table["escape"] |= {"reverse_m_s": cruise_m_s, "probe_radius_m": radius_m}
    immobilised_s = min(max(round(IMMOBILISED_M / cruise_m_s, 1), IMMOBILISED_MIN_S), IMMOBILISED_MAX_S)
    draft.table["detector"] |= {"immobilised_s": immobilised_s}
    if draft.table["vehicle"] != before:
        del draft.table["chassis"]  # of the shipped body
    if "difference_speed_m_s" in (motion := draft.table["parts"].get("motion", {})):
        motion["difference_speed_m_s"] = cruise_m_s


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

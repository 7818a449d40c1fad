"""A first rover file: ``probe`` sees what is there, ``interview`` asks for the rest, ``rover_writer`` writes it."""

from __future__ import annotations

from wayfarer.commissioning.init.draft import Person
from wayfarer.commissioning.init.interview import interview
from wayfarer.commissioning.init.probe import Inventory, Sighting, Verdict, look, motor_devices
from wayfarer.commissioning.init.rover_writer import rover_toml
from wayfarer.config.rover_file import parse_rover

__all__ = ["Inventory", "Person", "Sighting", "Verdict", "first_rover_file", "look", "motor_devices"]


def first_rover_file(inventory: Inventory, answers: dict[str, object], person: Person) -> str:
    """Return the text of a rover file for what was found, asking a person for the rest; raises as ``interview``."""
    table = interview(inventory, answers, person)
    found = {(each.part, each.driver): each.name for each in inventory.parts}
    remarks = {
        part: f"It answered: {found[key]}."
        if (key := (part, settings["driver"])) in found
        else "Nothing has shown it yet."
        for part, settings in table["parts"].items()
    }
    text = rover_toml(table, remarks)
    parse_rover("rover.toml", text)  # what is written was read
    return text

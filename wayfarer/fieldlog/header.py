"""A log's first record, which says what ran. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from wayfarer.fieldlog.fields import integer, number, setting, table
from wayfarer.fieldlog.schema import COUNT, NUMBER, Count, Flag, Lasting, Metres, Record, Table, Text, Values, fields_of


@dataclass(frozen=True, slots=True)
class Header:
    """What ran; None where the log does not say. ``world`` is the forest of a simulated run, if it can be drawn."""

    record: Record
    schema: Annotated[int | None, Values((int,), 1, 2**53)] = None
    part: Annotated[int, COUNT] = 1
    version: Text = None
    rover: Text = None
    algorithm: Text = None
    config: Table = None
    config_hash: Text = None
    parts: Table = None
    simulated: Flag = None
    dry_run: Flag = None
    log: Text = None
    start_delay_s: Lasting = None
    time_scale: Annotated[float | None, Values(NUMBER, 1e-3, 1e6)] = None
    boot_id: Text = None
    trial: Count = None
    forest: Count = None
    noise: Count = None
    slip_mean_m: Metres = None
    budget_m: Metres = None
    mujoco: Table = None
    ground: Text = None
    slope: Table = None
    sim: Table = None

    @classmethod
    def of(cls, record: Record) -> Header:
        """Return what a ``run`` record says; an empty record says nothing."""
        return cls(record, **fields_of(cls, record))

    @property
    def seed(self) -> int | None:
        """Return the seed, a number of any size."""
        return integer(self.record, "seed")

    @property
    def world(self) -> Record | None:
        """Return what is drawn of a simulated forest, None where that is not all there."""
        return _world(table(self.record, "world"))

    def setting(self, *keys: str) -> float | None:
        """Return a number of the rover file; see ``fields.setting``."""
        return setting(self.record, *keys)


def _world(world: Record) -> Record | None:
    lengths = ("goal_y_m", "trunk_diameter_m", "tree_radius_m")
    if (
        all(number(world, key) is not None for key in lengths)
        and _are_rows([world.get("start_m")], 2)
        and _are_rows(world.get("trunks_m"), 4)
        and _are_rows(world.get("trees_m"), 2)
    ):
        return {key: world[key] for key in ("start_m", *lengths, "trees_m", "trunks_m")}
    return None


def _are_rows(rows: object, numbers: int) -> bool:
    """Return whether something is a list of lists that each begin with so many numbers."""
    return isinstance(rows, list | tuple) and all(
        isinstance(row, list | tuple)
        and len(row) >= numbers
        and all(number({"": value}, "") is not None for value in row[:numbers])
        for row in rows
    )

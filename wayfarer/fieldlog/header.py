"""The typed view of a log's first record: what ran. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from wayfarer.fieldlog.fields import flag, number, safe_text, setting, table, whole
from wayfarer.fieldlog.schema import Record


@dataclass(frozen=True, slots=True)
class Header:
    """What ran; None where the log does not say. ``world`` is the forest of a simulated run, if it can be drawn."""

    record: Record
    rover: str | None
    algorithm: str | None
    version: str | None
    seed: int | None
    trial: int | None
    part: int
    simulated: bool | None
    dry_run: bool | None
    world: Record | None

    @classmethod
    def of(cls, record: Record) -> Header:
        """Return the view of a ``run`` record; one of an empty record knows nothing."""
        return cls(
            record,
            rover=safe_text(record, "rover"),
            algorithm=safe_text(record, "algorithm"),
            version=safe_text(record, "version"),
            seed=whole(record, "seed"),
            trial=whole(record, "trial"),
            part=whole(record, "part") or 1,
            simulated=flag(record, "simulated"),
            dry_run=flag(record, "dry_run"),
            world=_world(table(record, "world")),
        )

    def setting(self, *keys: str) -> float | None:
        """Return a number of the rover file; see ``fields.setting``."""
        return setting(self.record, *keys)


def _world(world: Record) -> Record | None:
    """Return what is drawn of a simulated forest, None where that is not all there."""
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

"""What commands check and prepare before the first trial: algorithms, terrain, slope, senses, rover, site, folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from wayfarer.config.messages import located, validated
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig
from wayfarer.config.settings import CLIMBING_KEYS
from wayfarer.errors import BadConfig, BadInput, MissingPackage, UnknownName, one_line
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.campaign import Campaign
from wayfarer.extras import require
from wayfarer.simhal.drawn_ranges import Range, parse_range
from wayfarer.simhal.world.physics import FIELD, GroundName, Physics, Senses

if TYPE_CHECKING:
    from wayfarer.simhal.mujoco.terrain import Terrains
    from wayfarer.simhal.world.slope import Slopes
    from wayfarer.simhal.world.wheeled_body import WheeledBody

PAPER_SET = "paper"  # stands for the ten of the paper, which are the catalogue
NAMED_SENSES: Mapping[str, Mapping[str, float]] = {"ideal": {}, "field": FIELD}
INTERRUPTED = 130  # as a shell reports a command that SIGINT ended


def algorithms(names: str) -> tuple[str, ...]:
    """Return the algorithms that a comma-separated list names, each once, in the order asked.

    Raises:
        UnknownName: no such algorithm; the text offers the nearest names.
        BadInput: a third party's algorithm cannot be loaded.
    """
    asked = [name.strip() for name in names.split(",")]
    expanded = dict.fromkeys(name for item in asked for name in (CATALOGUE if item == PAPER_SET else [item]))
    for name in expanded:
        find_algorithm(name)
    return tuple(expanded)


def terrains(asked: Mapping[str, float | str | None], physics: str, ground: str) -> Terrains | None:
    """Return the terrains that options ask for, by the names of their fields; the rest as by default.

    Physics-light has none: it has a ``ground``.

    Raises:
        BadInput: an option is no number or range, or out of bounds; or it has no effect in these physics.
        MissingPackage: MuJoCo is not installed.
    """
    from wayfarer.simhal.mujoco.terrain import BOUNDS, Terrains

    ranges = _ranges(asked, BOUNDS._asdict())
    if physics == "light":
        if ranges:
            raise BadInput(f"{_option(next(iter(ranges)))} has an effect only in MuJoCo; add --physics mujoco")
        return None
    if ground != GroundName.ideal:
        raise BadInput(f"--ground {ground} is of physics-light; in MuJoCo use --friction instead")
    require("--physics mujoco")
    return Terrains(**ranges)


def slopes(asked: Mapping[str, float | str | None]) -> Slopes | None:
    """Return the slopes that options ask for, by the names of their fields; None if none asks for any.

    Raises:
        BadInput: an option is no number or range, or out of bounds; or a direction without a slope.
    """
    from wayfarer.simhal.world.slope import BOUNDS, Slopes

    ranges = _ranges(asked, BOUNDS._asdict())
    if ranges and "slope_deg" not in ranges:
        raise BadInput("--slope-direction-deg has an effect only with --slope-deg; add that, or leave it out")
    return Slopes(**ranges) if ranges else None


def _ranges(asked: Mapping[str, float | str | None], allowed: Mapping[str, Range]) -> dict[str, Range]:
    return {
        name: parse_range(_option(name), str(value), allowed[name])
        for name, value in asked.items()
        if value is not None
    }


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def senses(asked: str) -> Physics:
    """Return the simulated world with the senses that an option asks for; of two that set the same the later counts.

    ``asked`` is a comma-separated list of ``ideal``, ``field``, and of fields of ``Senses`` as ``KEY=VALUE``.

    Raises:
        UnknownName: there is no such name or key; the text offers the nearest ones.
        BadInput: a value is no number, or out of its range.
    """
    keys = [field.name for field in fields(Senses)]
    values = dict[str, float]()
    for item in asked.split(","):
        key, equals, text = (part.strip() for part in item.partition("="))
        if not equals and key in NAMED_SENSES:
            values |= NAMED_SENSES[key]
        elif key not in keys or not equals:
            raise UnknownName(
                "name or KEY=VALUE of --senses", f"{key}{equals}", [*NAMED_SENSES, *map("{}=".format, keys)]
            )
        else:
            values[key] = _number(asked, text)
    try:
        return validated(Physics, values)
    except BadConfig as error:
        raise BadInput(f"--senses {asked}: {error}") from None


def faults(asked: Iterable[str], config: RoverConfig, depth: str) -> tuple[str, ...]:
    """Return the values of ``--fault``, all of which can happen to a rover at a depth.

    Raises:
        BadInput: one cannot happen to it, or is none; the text says why, and offers the nearest names.
    """
    from wayfarer.simhal.build_rover import Depth
    from wayfarer.simhal.faults.kinds import misfit, parse_fault

    for each in (texts := tuple(asked)):
        if why := misfit(parse_fault(each), config, Depth(depth)):
            raise BadInput(f"--fault {each}: {why}")
    return texts


def _number(asked: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise BadInput(f"--senses {asked}: '{text}' is not a number") from None


def check_points(points: Iterable[Campaign], where: str) -> None:
    """Make sure that the rover can drive in a campaign, or at each point of a sweep; ``where`` as ``check_rover``.

    Raises:
        BadInput: it cannot, or something that it needs is not installed.
    """
    for point in points:
        check_body(point, where)
        check_rover(point.rover, point.depth, where)


def check_body(campaign: Campaign, where: str) -> None:
    """Make sure that wheels that slip can have this rover's body, before the first trial; ``where`` as ``check_rover``.

    Raises:
        BadConfig: its file does not say enough of the body, or says what cannot be built.
    """
    from wayfarer.simhal.world.wheeled_body import body_of

    if campaign.terrains is None and campaign.ground is GroundName.ideal:
        return
    asked_by = f"--ground {campaign.ground}" if campaign.terrains is None else "--physics mujoco"
    rover = campaign.rover
    try:
        body = body_of(rover.name, rover.vehicle, rover.chassis, asked_by)
    except BadConfig as error:
        raise BadConfig(f"{where}: {error}") from None
    if campaign.terrains is not None:
        _check_model(body, where)


def _check_model(body: WheeledBody, where: str) -> None:
    """Make sure that the engine takes this body.

    Raises:
        BadConfig: it does not.
    """
    from wayfarer.simhal.mujoco.model import build_spec
    from wayfarer.simhal.mujoco.terrain import Terrain

    try:
        build_spec(body, Terrain(0.5, 0.0, 1.0), None, []).compile()
    except ValueError as error:
        raise BadConfig(
            f"{where}: MuJoCo cannot build this rover ({one_line(error)}); correct its vehicle or chassis"
        ) from None


def check_rover(config: RoverConfig, depth: str, where: str) -> None:
    """Build a rover once: what would end every trial in a fault is told before the first.

    Args:
        config: the rover.
        depth: ``device`` or ``bus``.
        where: the rover's file, or the name of a shipped one.

    Raises:
        BadConfig: at bus depth the rover wants a part, or a chip for one; the text names file and key. At device
            depth only a third party's chip can be wrong, which the first trial tells.
        MissingPackage: at bus depth one of its drivers needs a package that is not installed.
    """
    if depth == "device":
        return
    from wayfarer.config.factory import NEEDED
    from wayfarer.simhal.build_rover import Depth, bus_depth, missing_package
    from wayfarer.simhal.buses import ChipMisuse, FakeBuses
    from wayfarer.simhal.random_streams import RandomStreams
    from wayfarer.simhal.world.forest import CLEARING
    from wayfarer.simhal.world.world import World

    if missing := [part for part in NEEDED if part not in config.parts]:
        lacks = f"rover '{config.name}' has no [parts.{missing[0]}], so there is no driver to run; use --depth device"
        raise BadConfig(located(where, f"key 'parts.{missing[0]}' is missing: {lacks}"))
    if why := missing_package(config, Depth.BUS):
        raise MissingPackage(f"{why}; or use --depth device")
    streams = RandomStreams(0)
    world = World(CLEARING, config.vehicle, Physics(), streams)
    try:
        bus_depth(world, streams, config, lambda: 0.0, FakeBuses())
    except BadConfig as error:
        raise BadConfig(located(where, str(error))) from None
    except ChipMisuse as error:
        raise BadConfig(f"{where}: {error}; correct its parts") from None


def at_site(campaign: Campaign, scenario: str) -> Campaign:
    """Return a campaign whose trials take place at the site of a scenario, with a receiver where it logs positions.

    Raises:
        UnknownName: no such site; the text offers the nearest names.
        BadConfig: the rover's file does not say how it meets a branch.
        BadInput: the campaign has its own forests.
    """
    from wayfarer.simhal.world.sites import SITES

    if scenario not in SITES:
        raise UnknownName("site", scenario, SITES)
    if campaign.forests is not None:
        raise BadInput(f"site '{scenario}' draws its own layouts; leave out the site or the forests")
    if missing := campaign.rover.chassis.missing(CLIMBING_KEYS):
        raise BadConfig(
            f"rover '{campaign.rover.name}' has no chassis.{missing[0]}, which --site needs for branches;"
            " use --rover forestrover or minirover, or add the key to [chassis] of its file, as in their files"
        )
    here = replace(campaign, scenario=scenario)
    return replace(here, rover=here.site.equip(campaign.rover)) if here.site else here


def make_empty_folder(path: Path, what: str) -> None:
    """Make a folder, or take an empty one.

    Raises:
        BadInput: it is not empty, or cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        empty = not any(path.iterdir())
    except OSError as error:
        raise BadInput(f"{path} cannot be used for {what}: {error.strerror}") from error
    if not empty:
        raise BadInput(f"{path} is not empty; {what} needs a new or empty folder")

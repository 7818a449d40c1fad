"""What is checked before the first trial: the settings that people ask for, the rover's body, its drivers, folders."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wayfarer.config.messages import located, shown
from wayfarer.config.own_file import forget_changed, used, whole_name
from wayfarer.config.registry import find_algorithm
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.config.rover_path import own_folder
from wayfarer.config.settings import CLIMBING_KEYS
from wayfarer.errors import BadConfig, BadInput, MissingPackage, UnknownName, one_line
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.keys import OWN, PARTS, check_keys, check_ranges, corners, settings_of
from wayfarer.experiments.settings import FORMS, NAMES, checked_plain
from wayfarer.extras import require
from wayfarer.simhal.world.forest_file import read_forest_file
from wayfarer.simhal.world.physics import PHYSICS, Depth, GroundName

if TYPE_CHECKING:
    from wayfarer.simhal.faults.kinds import Fault

PAPER_SET = "paper"  # stands for the ten of the paper, which are the catalogue
# Of which types a setting may be in Python beside a text.
ALSO: Mapping[str, tuple[type, ...]] = {"rover": (Path, RoverConfig), "forests": (Path,), "set": (Mapping,)}
LISTS = {"algorithms", "set", "faults"}  # settings that may be several texts


def make_campaign(asked: Mapping[str, Any], spell: Callable[[str], str] = str, swept: Sequence[str] = ()) -> Campaign:
    """Return the campaign that a command line or a call from Python asks for, with all of it checked.

    Args:
        asked: settings by their names, in the forms in which people write them (``settings.FORMS``).
        spell: says how the reader of an error writes a setting: as an option, or by its name in Python.
        swept: the keys that a sweep of this campaign varies.

    Raises:
        BadInput: a setting is none of those that are allowed, or does not go with the others.
        MissingPackage: shortest paths, a site or MuJoCo need a library that is not installed.
        TypeError: there is no such setting, as of a Python function without that argument.
    """
    if unknown := asked.keys() - set(NAMES):
        raise TypeError(f"unexpected keyword argument {sorted(unknown)[0]!r}; settings are {', '.join(NAMES)}")
    plain = checked_plain(asked, spell)
    texts = {name: _in_form(name, asked[name], spell) for name in FORMS if asked.get(name) is not None}
    rover, forests, site = texts.get("rover", "sim"), texts.get("forests"), texts.get("site")
    where = rover.name if isinstance(rover, RoverConfig) else str(rover)
    if site is not None and forests is not None:  # a site draws its own layouts
        raise BadInput(f"{spell('site')} and {spell('forests')} do not go together: leave one of them out")
    if site is not None and asked.get("go_on"):
        raise BadInput(f"{spell('go_on')} has no effect with {spell('site')}: a rover goes on there; leave it out")
    folder = None if isinstance(rover, RoverConfig) else own_folder(where)
    values = settings_of(texts.get("set", {}), spell("set"))
    for key, value in values.items():
        if key.startswith(PARTS) and key.endswith(".driver"):  # a worker may be in another folder
            values[key] = whole_name("driver", str(value), folder)
    forget_changed()
    names = algorithms(texts.get("algorithms", Campaign.algorithms), folder)
    campaign = Campaign(
        names,
        rover=rover if isinstance(rover, RoverConfig) else load_rover(where),
        forests=None if forests is None else read_forest_file(forests),
        site=site,
        set=values,
        faults=tuple(texts.get("faults", ())),
        **plain,
    )
    check_together(campaign, spell, swept)
    if campaign.field_site:
        campaign = replace(campaign, rover=campaign.field_site.equip(campaign.rover))
    check_keys(campaign, [*campaign.set, *swept], spell)
    # What an option sets as well has one place: a key that is one has gone there, unless it is drawn.
    own = {key: value for key, value in campaign.fixed_values.items() if key in OWN}
    rest = {key: value for key, value in campaign.set.items() if key not in own}
    campaign = check_ranges(replace(campaign, set=rest, **checked_plain(own, "key '{}'".format)))
    check_points([campaign], where)
    checked_faults(campaign.faults, campaign.fixed.rover, campaign.depth)
    drivers = [str(table["driver"]) for table in campaign.fixed.rover.parts.values()]
    return replace(campaign, files=used({name: whole_name("file", name, folder) for name in [*names, *drivers]}))


def _in_form(name: str, value: Any, spell: Callable[[str], str]) -> Any:
    """Return a setting of ``FORMS`` as it was given, if it is of such a kind; one text of a list as a list.

    Raises:
        BadInput: it is of another kind.
    """
    items = [value] if isinstance(value, str) else list(value) if isinstance(value, Iterable) else [None]
    if isinstance(value, ALSO.get(name, ())) or (isinstance(value, str) and name not in LISTS):
        return value
    if name not in LISTS or not all(isinstance(item, str) for item in items):
        raise BadInput(f"{spell(name)} = {shown(value)}: expected {FORMS[name].python}")
    return items


def check_together(campaign: Campaign, spell: Callable[[str], str], swept: Sequence[str] = ()) -> None:
    """Refuse settings that do not go together, or that need what is not installed.

    Raises:
        UnknownName: no such site; the text offers the nearest names.
        BadConfig: the rover's file does not say how it meets a branch.
        BadInput: two settings do not go together.
        MissingPackage: the text says which package, and how to install it.
    """
    for key in OWN:
        if key in {*campaign.set, *swept} and getattr(campaign, key) != getattr(Campaign, key):
            raise BadInput(f"{spell(key)} and the key '{key}' set the same value; leave out one of them")
    if campaign.physics == "mujoco":
        if campaign.ground is not GroundName.ideal:
            raise BadInput(
                f"{spell('ground')} {campaign.ground} is of physics-light; in MuJoCo use {spell('set')} sim.friction"
            )
        require("--physics mujoco")
    if campaign.spl:
        require("--spl")
    if campaign.site is None:
        return
    require("--site")
    from wayfarer.simhal.world.sites import SITES

    if campaign.site not in SITES:
        raise UnknownName("site", str(campaign.site), SITES)
    if missing := campaign.rover.chassis.missing(CLIMBING_KEYS):
        raise BadConfig(
            f"rover '{campaign.rover.name}' has no chassis.{missing[0]}, which {spell('site')} needs for branches; use "
            f"{spell('rover')} forestrover or minirover, or add the key to [chassis] of its file, as in their files"
        )


def algorithms(asked: Iterable[str], folder: Path | None = None) -> tuple[str, ...]:
    """Return the algorithms that texts with commas name, each once, in the order asked; ``folder``: the rover file's.

    Raises:
        UnknownName: no such algorithm; the text offers the nearest names.
        BadInput: a third party's algorithm cannot be loaded.
    """
    names = [name.strip() for name in ",".join(asked).split(",")]
    expanded = dict.fromkeys(name for item in names for name in (CATALOGUE if item == PAPER_SET else [item]))
    for name in expanded:
        find_algorithm(name, folder)
    return tuple(expanded)


def checked_faults(texts: Collection[str], rover: RoverConfig, depth: Depth) -> list[Fault]:
    """Return the faults that ``--fault`` asks for, all of which can happen to a rover at a depth.

    Raises:
        BadInput: one cannot happen to it, or is none; the text says why, and offers the nearest names.
    """
    if not texts:
        return []
    from wayfarer.simhal.faults.kinds import misfit, parse_fault

    faults = {text: parse_fault(text) for text in texts}
    for text, fault in faults.items():
        if why := misfit(fault, rover, depth):
            raise BadInput(f"--fault {text}: {why}")
    return list(faults.values())


def check_points(points: Iterable[Campaign], where: str) -> None:
    """Make sure that the rover can drive in a campaign, or at each point of a sweep; ``where`` as ``check_rover``.

    Raises:
        BadInput: it cannot, or something that it needs is not installed.
    """
    for point in points:
        rovers = [point.conditions(drawn).rover for drawn in corners(point)]
        for rover in {each.model_dump_json(): each for each in rovers}.values():
            check_body(point, rover, where)
            check_rover(rover, point.depth, where)


def check_body(campaign: Campaign, rover: RoverConfig, where: str) -> None:
    """Make sure that wheels that slip can have this rover's body, before the first trial; ``where`` as ``check_rover``.

    Raises:
        BadConfig: its file does not say enough of the body, or MuJoCo does not take it.
    """
    from wayfarer.simhal.world.wheeled_body import body_of

    ground, in_mujoco = campaign.fixed.ground, campaign.physics == "mujoco"
    if not in_mujoco and ground is GroundName.ideal:
        return
    asked_by = "--physics mujoco" if in_mujoco else f"--ground {ground}"
    try:
        body = body_of(rover.name, rover.vehicle, rover.chassis, asked_by)
    except BadConfig as error:
        raise BadConfig(f"{where}: {error}") from None
    if not in_mujoco:
        return
    from wayfarer.simhal.mujoco.model import build_spec
    from wayfarer.simhal.world.physics import Terrain

    try:
        build_spec(body, Terrain(), None, []).compile()
    except ValueError as error:
        raise BadConfig(
            f"{where}: MuJoCo cannot build this rover ({one_line(error)}); correct its vehicle or chassis"
        ) from None


def check_rover(config: RoverConfig, depth: Depth, where: str) -> None:
    """Build a rover once: what would end every trial in a fault is said before the first.

    Args:
        config: the rover.
        depth: of the simulation.
        where: the rover's file, or the name of a shipped one.

    Raises:
        BadConfig: at bus depth the rover wants a part, or a chip for one; the text names file and key. At device depth
            only a third party's chip can be wrong; the first trial shows that.
        MissingPackage: at bus depth one of its drivers needs a package that is not installed.
    """
    if depth is Depth.DEVICE:
        return
    from wayfarer.config.factory import NEEDED
    from wayfarer.simhal.build_rover import bus_depth, missing_package
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
    world = World(CLEARING, config.vehicle, PHYSICS, streams)
    try:
        bus_depth(world, streams, config, lambda: 0.0, FakeBuses())
    except BadConfig as error:
        raise BadConfig(located(where, str(error))) from None
    except ChipMisuse as error:
        raise BadConfig(f"{where}: {error}; correct its parts") from None


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

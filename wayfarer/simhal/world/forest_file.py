"""Forest files: one JSON object a line, in the format of the reference forests (``forests.jsonl``).

Keys: ``forest``, ``noise`` (whole numbers, a pair occurs once), ``start_m`` [x, y], ``heading_deg``,
``goal_y_m``, ``trunk_diameter_m``, ``tree_radius_m``, ``trunks_m`` [[x0, y0, x1, y1, lean], ...], ``trees_m``
[[x, y], ...], ``shortest_path_m`` where it is known, and ``diameters_m`` [d, ...], one a trunk, where they differ.
Blank lines do not count.

One such file comes with wayfarer, beside this module, and has a word for its name: ``reference``. Its 500 forests (250
layouts with 2 noise seeds each) are those that the simulator of the Blind-Wayfarer paper generates
(https://github.com/Xu-Yanran/blind_wayfarer), measured as plain geometry, with shortest paths computed for a body
0.4 m wide. That repository states no licence; the file has measured coordinates only, nothing of its code, and comes
under wayfarer's MIT licence as far as coordinates can have one.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from importlib.resources import files
from math import isfinite
from pathlib import Path
from reprlib import Repr
from typing import NoReturn, TypeVar

from wayfarer.errors import BadForest
from wayfarer.fieldlog.atomic_file import whole_file
from wayfarer.simhal.world.forest import LEANS, Forest, Trunk, check_forest

Value = TypeVar("Value")

REQUIRED_KEYS = (
    "forest",
    "noise",
    "start_m",
    "heading_deg",
    "goal_y_m",
    "trunk_diameter_m",
    "tree_radius_m",
    "trunks_m",
    "trees_m",
)
OPTIONAL_KEYS = ("shortest_path_m", "diameters_m")
TOO_LARGE = 2**31  # a million passes through the file later it still fits a table of results
REFERENCE = "reference"
REFERENCE_FILE = "reference_forests.jsonl.gz"

_brief = Repr()
_brief.maxstring = _brief.maxother = _brief.maxlong = 40


def read_forests(path: Path) -> list[Forest]:
    """Read every forest of a file, in its order.

    Raises:
        BadForest: no such file, nothing in it, or a forest that cannot be used; the text names file, line,
            key, reason and what was expected.
    """
    return forests_in(path, content_of(path))


def content_of(source: str | Path) -> bytes:
    """Return what a file of forests holds; the text ``reference`` is the file that comes with wayfarer.

    A ``Path`` is always a file of the user, and so is the text ``./reference``.

    Raises:
        BadForest: no such file.
    """
    if source == REFERENCE:
        beside_this = files(__name__.rpartition(".")[0])
        return gzip.decompress((beside_this / REFERENCE_FILE).read_bytes())
    try:
        return Path(source).read_bytes()
    except OSError as error:
        raise BadForest(
            f"{source}: cannot be read ({error.strerror}), expected a file of forests, or the word {REFERENCE}"
        ) from None


def write_forests(path: Path, forests: Iterable[Forest]) -> None:
    """Write forests so that ``read_forests`` gives them back; the file appears whole or not at all.

    Raises:
        BadForest: a forest that ``read_forests`` would refuse, or the file cannot be written.
        BadInput: what is there is no ordinary file.
    """
    content = "".join(_line_of(forest) for forest in forests).encode()
    forests_in(path, content)
    try:
        with whole_file(path) as draft:
            draft.write_bytes(content)
    except OSError as error:
        raise BadForest(f"{path}: cannot be written ({error.strerror}); check the folder and its rights") from None


def forests_in(source: str | Path, content: bytes) -> list[Forest]:
    """Return the forests in a file's content, in its order; only a line feed ends a line.

    Raises:
        BadForest: nothing in it, or a forest that cannot be used; the text names ``source``, line, key, reason and what
            was expected.
    """
    forests: list[Forest] = []
    lines: dict[tuple[int, int], int] = {}
    for number, line in enumerate(content.split(b"\n"), start=1):
        if line.strip():
            try:
                forest = _forest_of(line)
                _check_pair_is_new(forest, lines)
            except BadForest as defect:
                raise BadForest(f"{source}, line {number}: {defect}") from None
            lines[forest.forest, forest.noise] = number
            forests.append(forest)
    if not forests:
        raise BadForest(f"{source}: there is no forest in this file, expected one JSON object a line")
    return forests


def _check_pair_is_new(forest: Forest, lines: dict[tuple[int, int], int]) -> None:
    """Refuse a forest that the file already has."""
    first = lines.get((forest.forest, forest.noise))
    if first is not None:
        raise BadForest(
            f"forest, noise: {forest.forest}, {forest.noise} is on line {first} too, expected each pair once"
        )


def _forest_of(line: bytes) -> Forest:
    """Return the forest of one line, checked."""
    return from_row(_object_of(line))


def from_row(row: Mapping[str, object]) -> Forest:
    """Return the forest that ``as_row`` made a JSON object of.

    Raises:
        BadForest: it cannot be used; the text names key, reason and what was expected.
    """
    for key in REQUIRED_KEYS:
        if key not in row:
            raise BadForest(f"{key}: missing, expected each of {', '.join(REQUIRED_KEYS)}")
    for key in row:
        if key not in REQUIRED_KEYS and key not in OPTIONAL_KEYS:
            expected = f"{', '.join(REQUIRED_KEYS)} or {' or '.join(OPTIONAL_KEYS)}"
            raise BadForest(f"{_brief.repr(key)}: unknown key, expected {expected}")
    forest = Forest(
        forest=_whole("forest", row["forest"]),
        noise=_whole("noise", row["noise"]),
        start_m=_point("start_m", row["start_m"]),
        heading_deg=_number("heading_deg", row["heading_deg"]),
        goal_y_m=_number("goal_y_m", row["goal_y_m"]),
        trunk_diameter_m=_number("trunk_diameter_m", row["trunk_diameter_m"]),
        tree_radius_m=_number("tree_radius_m", row["tree_radius_m"]),
        trunks=_each("trunks_m", row["trunks_m"], _trunk),
        trees_m=_each("trees_m", row["trees_m"], _point),
        shortest_path_m=_number("shortest_path_m", row["shortest_path_m"]) if "shortest_path_m" in row else None,
        diameters_m=_each("diameters_m", row.get("diameters_m", []), _number),
    )
    check_forest(forest)
    return forest


def _object_of(line: bytes) -> dict[str, object]:
    """Return the JSON object of a line."""
    try:
        row: object = json.loads(line.decode("utf-8"), object_pairs_hook=_without_duplicates)
    except UnicodeDecodeError as error:
        raise BadForest(f"not UTF-8 at byte {error.start}, expected text") from None
    except json.JSONDecodeError as error:
        raise BadForest(f"not JSON at column {error.colno}: {error.msg}, expected one JSON object") from None
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, thousands of brackets
        raise BadForest(f"not JSON that can be read: {error}, expected one JSON object") from None
    if not isinstance(row, dict):
        _refuse("the line", row, "one JSON object")
    return row


def _without_duplicates(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Return the pairs as a dictionary; JSON itself would let the last of two equal keys win."""
    row: dict[str, object] = {}
    for key, value in pairs:
        if key in row:
            raise BadForest(f"{_brief.repr(key)}: duplicate key, expected each key once")
        row[key] = value
    return row


def _refuse(key: str, value: object, expected: str) -> NoReturn:
    raise BadForest(f"{key}: is {_brief.repr(value)}, expected {expected}")


def _whole(key: str, value: object) -> int:
    """Return a whole number that a table of results can hold; ``true`` is none."""
    if not isinstance(value, int) or isinstance(value, bool):
        _refuse(key, value, "a whole number")
    if abs(value) >= TOO_LARGE:
        _refuse(key, value, "a whole number below 2^31")
    return value


def _number(key: str, value: object) -> float:
    """Return a finite number; a whole number of hundreds of digits is none."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            if isfinite(value):
                return float(value)
        except OverflowError:
            pass
    _refuse(key, value, "a finite number")


def _point(key: str, value: object) -> tuple[float, float]:
    """Return an [x, y] pair."""
    if not isinstance(value, list) or len(value) != 2:
        _refuse(key, value, "[x, y]")
    return _number(key, value[0]), _number(key, value[1])


def _trunk(key: str, value: object) -> Trunk:
    """Return a trunk from [x0, y0, x1, y1, lean]."""
    if not isinstance(value, list) or len(value) != 5:
        _refuse(key, value, "[x0, y0, x1, y1, lean]")
    lean = value[4]
    if lean not in LEANS:
        _refuse(key, lean, "a lean: " + ", ".join(f"'{known}'" for known in LEANS))
    x0_m, y0_m, x1_m, y1_m = (_number(key, coordinate) for coordinate in value[:4])
    return Trunk(x0_m, y0_m, x1_m, y1_m, lean)


def _each(key: str, value: object, read: Callable[[str, object], Value]) -> tuple[Value, ...]:
    """Return what ``read`` makes of each item of a list."""
    if not isinstance(value, list):
        _refuse(key, value, "a list")
    return tuple(read(f"{key}[{index}]", item) for index, item in enumerate(value))


def as_row(forest: Forest) -> dict[str, object]:
    """Return a forest as the JSON object that stands for it in a file, and in the log of a simulated run."""
    row = asdict(forest)
    row["trunks_m"] = [list(trunk) for trunk in row.pop("trunks")]
    for key in OPTIONAL_KEYS:
        if not row[key]:
            del row[key]
    return row


def _line_of(forest: Forest) -> str:
    """Return the line of one forest, with its line feed."""
    return json.dumps(as_row(forest), separators=(",", ":")) + "\n"

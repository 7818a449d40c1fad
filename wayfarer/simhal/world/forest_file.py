"""Forest files: one JSON object a line, in the format of the reference forests (``forests.jsonl``).

Keys: ``forest``, ``noise`` (whole numbers, a pair occurs once), ``start_m`` [x, y], ``heading_deg``,
``goal_y_m``, ``trunk_diameter_m``, ``tree_radius_m``, ``trunks_m`` [[x0, y0, x1, y1, lean], ...], ``trees_m``
[[x, y], ...], ``shortest_path_m`` if it is known, and ``diameters_m`` [d, ...], one per trunk, if they differ.
Blank lines do not count. ``shortest_path_m`` is that of a body 0.4 m wide, as the released simulator of the paper has
it; a campaign uses it for a rover of this width only, and computes the others' own with ``--spl``.

One such file comes with wayfarer, beside this module, and has a word for its name: ``reference``. Its 500 forests (250
layouts with 2 noise seeds each) are those that the simulator of the Blind-Wayfarer paper generates
(https://github.com/Xu-Yanran/blind_wayfarer), measured as plain geometry, with shortest paths computed for a body
0.4 m wide. That repository states no licence; the file has measured coordinates only, nothing of its code, and comes
under wayfarer's MIT licence as far as coordinates can have one.
"""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from hashlib import blake2b
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from annotated_types import Interval
from pydantic import BaseModel, ConfigDict

from wayfarer.config.messages import validated, with_short_keys
from wayfarer.errors import BadConfig, BadForest, one_line
from wayfarer.files import read_regular
from wayfarer.setting_ranges import Metres
from wayfarer.simhal.world.forest import Coordinate, Forest, Trunk, check_forest

REFERENCE = "reference"
REFERENCE_FILE = "reference_forests.jsonl.gz"
MOST_BYTES = 50_000_000  # 40,000 forests such as those of the reference

# A million passes through the file later it still fits a table of results.
Number = Annotated[int, Interval(ge=0, lt=2**31)]
Point = tuple[Coordinate, Coordinate]


class ForestRow(BaseModel):
    """The JSON object of one forest."""

    model_config = ConfigDict(extra="forbid")

    forest: Number
    noise: Number
    start_m: Point
    heading_deg: Annotated[float, Interval(ge=0, lt=360)]
    goal_y_m: Coordinate
    trunk_diameter_m: Metres
    tree_radius_m: Metres
    trunks_m: tuple[Trunk, ...]
    trees_m: tuple[Point, ...]
    shortest_path_m: Metres | None = None
    diameters_m: tuple[Metres, ...] = ()


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
        return read_regular(Path(source), MOST_BYTES)
    except (OSError, ValueError) as error:  # such as of a name that no file can have
        why = error.strerror if isinstance(error, OSError) else error
        raise BadForest(
            f"{source}: cannot be read ({why}), expected a file of forests, or the word {REFERENCE}"
        ) from None


def forests_in(source: str | Path, content: bytes) -> list[Forest]:
    """Return the forests in a file's content, in its order; only a line feed ends a line.

    Raises:
        BadForest: nothing in it, or a forest that cannot be used; the text names ``source``, line, key and reason.
    """
    forests: list[Forest] = []
    lines: dict[tuple[int, int], int] = {}
    for number, line in enumerate(content.split(b"\n"), start=1):
        if line.strip():
            try:
                forest = from_row(_object_of(line))
            except BadForest as defect:
                raise BadForest(f"{source}, line {number}: {defect}") from None
            pair = forest.forest, forest.noise
            if (first := lines.setdefault(pair, number)) != number:
                raise BadForest(
                    f"{source}, line {number}: forest, noise: {pair[0]}, {pair[1]} is on line {first} too, "
                    "expected each pair once"
                )
            forests.append(forest)
    if not forests:
        raise BadForest(f"{source}: there is no forest in this file, expected one JSON object a line")
    return forests


def from_row(row: Mapping[str, object]) -> Forest:
    """Return the forest that ``as_row`` made a JSON object of.

    Raises:
        BadForest: it cannot be used; the text names key and reason.
    """
    try:
        checked = dict(validated(ForestRow, row))
    except (BadConfig, RecursionError) as defect:  # RecursionError: hundreds of brackets
        raise BadForest(one_line(with_short_keys(str(defect)))) from None
    forest = Forest(trunks=checked.pop("trunks_m"), **checked)
    check_forest(forest)
    return forest


def _object_of(line: bytes) -> Mapping[str, object]:
    try:
        row: Mapping[str, object] = json.loads(line.decode("utf-8"))
    except json.JSONDecodeError as error:
        raise BadForest(f"not JSON at column {error.colno}: {error.msg}, expected one JSON object") from None
    except (ValueError, RecursionError) as error:  # no UTF-8, a number of thousands of digits, thousands of brackets
        raise BadForest(f"not JSON that can be read: {error}, expected one JSON object") from None
    return row


def as_row(forest: Forest) -> dict[str, object]:
    """Return a forest as the JSON object that stands for it in a file, and in the log of a simulated run."""
    row = asdict(forest)
    row["trunks_m"] = [list(trunk) for trunk in row.pop("trunks")]
    return {key: value for key, value in row.items() if key not in {"shortest_path_m", "diameters_m"} or value}


@dataclass(frozen=True, slots=True)
class ForestFile:
    """The forests of a file, in its order, and what identifies its content."""

    name: str
    blake2b: str
    forests: tuple[Forest, ...]

    @property
    def noise_span(self) -> int:
        """How far apart the noise numbers of two passes through the file are."""
        noises = [forest.noise for forest in self.forests]
        return max(noises) - min(noises) + 1


def read_forest_file(source: str | Path) -> ForestFile:
    """Read a file of forests; the text ``reference`` is the one that comes with wayfarer.

    Raises:
        BadForest: no such file, nothing in it, or a forest that cannot be used; the text names file, line and
            reason.
    """
    content = content_of(source)
    checksum = blake2b(content, digest_size=16).hexdigest()
    return ForestFile(Path(source).name, checksum, tuple(forests_in(source, content)))

"""Files of forests: what is read, what is refused and in which words, and what is written."""

from __future__ import annotations

import json
from dataclasses import replace
from math import atan2, cos, degrees, radians, sin
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.angles import axis_offset_deg
from wayfarer.errors import BadForest, BadInput
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest, Trunk, lean_of
from wayfarer.simhal.world.forest_file import REFERENCE, content_of, forests_in, read_forests, write_forests

ROW: dict[str, Any] = {
    "forest": 3,
    "noise": 2025,
    "start_m": [25.0, 12.5],
    "heading_deg": 0.0,
    "goal_y_m": 50.0,
    "trunk_diameter_m": 0.3,
    "tree_radius_m": 0.25,
    "trunks_m": [[6.0, 30.0, 28.0, 31.0, "across"], [30.0, 5.0, 31.0, 15.0, "right"]],
    "trees_m": [[33.3, 6.9], [24.7, 1.3]],
    "shortest_path_m": 37.61,
}


def line_with(**changes: object) -> str:
    return json.dumps(ROW | changes)


def refusal(path: Path, content: str | bytes) -> str:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(BadForest) as refused:
        read_forests(path)
    return str(refused.value)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "forests.jsonl"


def test_reference_file_is_read_and_survives_writing(path: Path) -> None:
    forests = forests_in(REFERENCE, content_of(REFERENCE))
    assert forests[0].trunks[0] == Trunk(6.375, 30.128, 27.736, 31.514, "across")
    assert forests[0].trees_m[0] == (33.3, 6.9)
    assert forests[0].shortest_path_m == 37.61
    write_forests(path, forests)
    assert read_forests(path) == forests


def test_whole_numbers_are_read_as_lengths(path: Path) -> None:
    path.write_text(line_with(start_m=[25, 12], goal_y_m=50))
    (forest,) = read_forests(path)
    assert forest.start_m == (25.0, 12.0)
    assert isinstance(forest.goal_y_m, float)


def test_shortest_path_may_be_absent(path: Path) -> None:
    path.write_text(json.dumps({key: value for key, value in ROW.items() if key != "shortest_path_m"}))
    assert read_forests(path)[0].shortest_path_m is None


def test_blank_lines_count_only_as_lines(path: Path) -> None:
    path.write_text(f"\n{line_with()}\r\n  \n{line_with(noise=7)}\n\n", newline="")
    assert [forest.noise for forest in read_forests(path)] == [2025, 7]
    assert "line 5" in refusal(path, f"\n{line_with()}\n  \n{line_with(noise=7)}\nnonsense")


@pytest.mark.parametrize("key", [key for key in ROW if key != "shortest_path_m"])
def test_missing_key_is_named(path: Path, key: str) -> None:
    row = {other: value for other, value in ROW.items() if other != key}
    assert refusal(path, json.dumps(row)).startswith(f"{path}, line 1: {key}: missing, expected each of forest, ")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ('{"forest": 1,', "not JSON at column 14: "),
        ("[1, 2]", "the line: is [1, 2], expected one JSON object"),
        ("[" * 100_000, "not JSON that can be read: "),
        (line_with(goal_y_m=1).replace(": 1,", ": 1" + "0" * 5000 + ",", 1), "not JSON that can be read: "),
        (line_with()[:-1] + ', "noise": 1}', "'noise': duplicate key, expected each key once"),
        (line_with(noize=1), "'noize': unknown key, expected forest, noise, "),
        (line_with(forest="3"), "forest: is '3', expected a whole number"),
        (line_with(forest=True), "forest: is True, expected a whole number"),
        (line_with(forest=-1), "forest: is -1, expected a whole number from 0 up"),
        (line_with(noise=1.5), "noise: is 1.5, expected a whole number"),
        (line_with(noise=2**31), "noise: is 2147483648, expected a whole number below 2^31"),
        (line_with(heading_deg=None), "heading_deg: is None, expected a finite number"),
        (line_with(heading_deg=float("nan")), "heading_deg: is nan, expected a finite number"),
        (line_with(goal_y_m=float("inf")), "goal_y_m: is inf, expected a finite number"),
        (line_with(goal_y_m=10**400), "goal_y_m: is 1000"),
        (line_with(goal_y_m=False), "goal_y_m: is False, expected a finite number"),
        (line_with(start_m=[1, 2, 3]), "start_m: is [1, 2, 3], expected [x, y]"),
        (line_with(start_m=["1", 2]), "start_m: is '1', expected a finite number"),
        (line_with(start_m=[51, 2]), "start_m: (51, 2) is outside the world, expected 0 to 50 m"),
        (line_with(trees_m={"x": 1}), "trees_m: is {'x': 1}, expected a list"),
        (line_with(trees_m=[[1, 2], [3, 50.1]]), "trees_m[1]: (3, 50.1) is outside the world"),
        (line_with(tree_radius_m=0), "tree_radius_m: is 0, expected more than 0 m"),
        (line_with(trunk_diameter_m=-0.3), "trunk_diameter_m: is -0.3, expected more than 0 m"),
        (line_with(shortest_path_m=None), "shortest_path_m: is None, expected a finite number"),
        (line_with(shortest_path_m=0), "shortest_path_m: is 0, expected more than 0 m"),
        (line_with(trunks_m=[[1, 2, 3, 4]]), "trunks_m[0]: is [1, 2, 3, 4], expected [x0, y0, x1, y1, lean]"),
        (line_with(trunks_m=[[1, 2, 3, "4", "left"]]), "trunks_m[0]: is '4', expected a finite number"),
        (line_with(trunks_m=[[1, 2, -3, 4, "left"]]), "trunks_m[0]: (-3, 4) is outside the world"),
        (line_with(trunks_m=[[1, 2, 1, 2, "left"]]), "trunks_m[0]: has no length, both ends are (1, 2)"),
        (
            line_with(trunks_m=[[0, 2, 1e-170, 2, "across"]]),
            "trunks_m[0]: has no length, both ends are (0, 2)",
        ),
        (
            line_with(trunks_m=[[1, 2, 3, 4, "up"]]),
            "trunks_m[0]: is 'up', expected a lean: 'right', 'left', 'across'",
        ),
        (line_with(goal_y_m=12.5), "goal_y_m: is 12.5, expected north of the start at 12.5 and at most 50 m"),
        (line_with(goal_y_m=60), "goal_y_m: is 60, expected north of the start at 12.5 and at most 50 m"),
        (
            line_with(heading_deg=180),
            "heading_deg: is 180, expected 0 to below 90, or above 270 to below 360",
        ),
        (line_with(heading_deg=-10), "heading_deg: is -10, expected 0 to below 90"),
        (line_with(heading_deg=90), "heading_deg: is 90, expected 0 to below 90"),
        ("", "there is no forest in this file"),
        ("\n \n", "there is no forest in this file"),
    ],
)
def test_broken_line_is_refused_in_one_line(path: Path, content: str, reason: str) -> None:
    text = refusal(path, content)
    assert text.startswith((f"{path}, line 1: {reason}", f"{path}: {reason}"))
    assert "expected" in text
    assert "\n" not in text
    assert len(text) < len(str(path)) + 250


def test_second_broken_line_is_numbered(path: Path) -> None:
    assert refusal(path, f"{line_with()}\n{line_with(noise='x')}\n").startswith(f"{path}, line 2: noise: ")


def test_same_forest_twice_names_both_lines(path: Path) -> None:
    text = refusal(path, f"{line_with()}\n{line_with(noise=1)}\n{line_with()}\n")
    assert text == f"{path}, line 3: forest, noise: 3, 2025 is on line 1 too, expected each pair once"


def test_bytes_that_are_not_utf8_are_numbered(path: Path) -> None:
    assert refusal(path, line_with().encode() + b"\n\xff\n") == (f"{path}, line 2: not UTF-8 at byte 0, expected text")


@pytest.mark.parametrize(("name", "why"), [("forests.jsonl", "No such file"), (".", "Is a directory")])
def test_what_cannot_be_opened_is_refused(tmp_path: Path, name: str, why: str) -> None:
    with pytest.raises(BadForest, match=rf"cannot be read .{why}"):
        read_forests(tmp_path / name)


@pytest.mark.parametrize(
    ("obstacle", "where", "gap_m"),
    [
        ({"trees_m": [[1, 1], [25.0, 12.5]]}, "trees_m[1]", -0.25),
        ({"trees_m": [[25.5, 12.5]]}, "trees_m[0]", 0.25),
        ({"trunks_m": [[20.0, 12.9, 30.0, 12.9, "across"]]}, "trunks_m[0]", 0.25),
        ({"trunks_m": [[25.4, 12.5, 30.0, 12.5, "across"]]}, "trunks_m[0]", 0.25),
    ],
)
def test_start_that_touches_an_obstacle_says_by_how_much(
    path: Path, obstacle: dict[str, object], where: str, gap_m: float
) -> None:
    assert refusal(path, line_with(**obstacle)) == (
        f"{path}, line 1: start_m: {where} is {gap_m:.3f} m from the centre of the rover, "
        f"expected more than 0.283 m (its corners); it lacks {0.2828427 - gap_m:.3f} m"
    )


def test_start_just_beside_an_obstacle_is_accepted(path: Path) -> None:
    path.write_text(line_with(trees_m=[[25.0 + 0.25 + 0.284, 12.5]]))
    assert len(read_forests(path)) == 1


@pytest.mark.parametrize(
    ("lean", "offset_deg", "expected"),
    [
        ("left", 10.0, "10.0 degrees clockwise of the goal heading; expected 'right'"),
        ("right", -10.0, "10.0 degrees counter-clockwise of the goal heading; expected 'left'"),
        ("across", 10.0, "10.0 degrees clockwise of the goal heading; expected 'right'"),
        ("left", -22.0, "22.0 degrees counter-clockwise of the goal heading; expected 'across'"),
    ],
)
@pytest.mark.parametrize("heading_deg", [0.0, 30.0, 350.0])
def test_lean_that_contradicts_the_trunk_is_refused(
    path: Path, lean: str, offset_deg: float, expected: str, heading_deg: float
) -> None:
    trunk = [30.0, 30.0, *end_of_trunk(heading_deg + offset_deg), lean]
    text = refusal(path, line_with(trunks_m=[trunk], heading_deg=heading_deg))
    assert text.endswith(f"trunks_m[0]: lean is '{lean}', but the trunk lies {expected}")


@pytest.mark.parametrize("lean", ["right", "left"])
def test_lean_of_a_trunk_along_the_goal_heading_may_be_either(path: Path, lean: str) -> None:
    path.write_text(line_with(trunks_m=[[30.0, 30.0, 30.0, 33.0, lean]]))
    assert read_forests(path)[0].trunks[0].lean == lean


def end_of_trunk(axis_deg: float, length_m: float = 5.0) -> tuple[float, float]:
    return 30.0 + length_m * sin(radians(axis_deg)), 30.0 + length_m * cos(radians(axis_deg))


coordinates_m = st.floats(0.0, WORLD_SIZE_M)
north_of_start_m = st.floats(13.5, WORLD_SIZE_M)


@st.composite
def trunks(draw: st.DrawFn, heading_deg: float) -> Trunk:
    x0_m, y0_m, x1_m, y1_m = (
        draw(coordinates) for coordinates in (coordinates_m, north_of_start_m, coordinates_m, north_of_start_m)
    )
    if max(abs(x0_m - x1_m), abs(y0_m - y1_m)) < 1e-3:
        x1_m = x0_m + 1.0 if x0_m < 25.0 else x0_m - 1.0
    offset_deg = axis_offset_deg(degrees(atan2(x1_m - x0_m, y1_m - y0_m)), heading_deg)
    return Trunk(x0_m, y0_m, x1_m, y1_m, lean_of(offset_deg))


@st.composite
def forests(draw: st.DrawFn) -> Forest:
    heading_deg = draw(st.floats(0.0, 89.0) | st.floats(271.0, 359.99))
    return Forest(
        forest=draw(st.integers(0, 2**31 - 1)),
        noise=draw(st.integers(0, 2**31 - 1)),
        start_m=(draw(coordinates_m), draw(st.floats(0.0, 12.5))),
        heading_deg=heading_deg,
        goal_y_m=draw(north_of_start_m),
        trunk_diameter_m=draw(st.floats(0.0, 1.0, exclude_min=True)),
        tree_radius_m=draw(st.floats(0.0, 0.5, exclude_min=True)),
        trunks=tuple(draw(st.lists(trunks(heading_deg), max_size=4))),
        trees_m=tuple(draw(st.lists(st.tuples(coordinates_m, north_of_start_m), max_size=4))),
        shortest_path_m=draw(st.none() | st.floats(0.1, 1e6)),
    )


@given(st.lists(forests(), min_size=1, max_size=3, unique_by=lambda forest: (forest.forest, forest.noise)))
def test_what_is_written_is_read_back(tmp_path_factory: pytest.TempPathFactory, written: list[Forest]) -> None:
    path = tmp_path_factory.mktemp("forests") / "forests.jsonl"
    write_forests(path, written)
    assert read_forests(path) == written


@pytest.fixture
def forest(path: Path) -> Forest:
    path.write_text(line_with())
    (forest,) = read_forests(path)
    return forest


def test_forest_that_would_be_refused_is_not_written(path: Path, forest: Forest) -> None:
    before = path.read_bytes()
    with pytest.raises(BadForest, match=r"forests.jsonl, line 2: goal_y_m: is nan"):
        write_forests(path, [forest, replace(forest, noise=1, goal_y_m=float("nan"))])
    assert path.read_bytes() == before


def test_failed_write_leaves_the_old_file_and_nothing_else(
    path: Path, forest: Forest, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = path.read_bytes()

    def full_disk(partial: Path, content: bytes) -> int:
        with partial.open("wb") as file:
            file.write(content[:20])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(BadForest, match=r"cannot be written .No space left"):
        write_forests(path, [replace(forest, noise=1)])
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_folder_cannot_be_overwritten(tmp_path: Path, forest: Forest) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(BadInput, match=r"taken is no ordinary file and is left as it is"):
        write_forests(tmp_path / "taken", [forest])
    assert not list(tmp_path.glob(".taken*"))


def test_absent_folder_is_not_made(tmp_path: Path, forest: Forest) -> None:
    with pytest.raises(BadForest, match=r"cannot be written .No such file"):
        write_forests(tmp_path / "absent" / "forests.jsonl", [forest])

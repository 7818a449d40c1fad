"""Files of forests: what is read, and what is refused in one line."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import replace
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import pytest

from tests.simhal.forest_lines import lines_of
from wayfarer.errors import BadForest
from wayfarer.simhal.world.forest import WORLD_SIZE_M, Forest, Trunk
from wayfarer.simhal.world.forest_file import REFERENCE, content_of, forests_in
from wayfarer.simhal.world.generate import generate_forest

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


def read(content: str | bytes) -> list[Forest]:
    return forests_in("my.jsonl", content if isinstance(content, bytes) else content.encode())


def refusal(content: str | bytes) -> str:
    with pytest.raises(BadForest) as refused:
        read(content)
    return str(refused.value)


def test_reference_file_is_read_and_survives_writing() -> None:
    forests = forests_in(REFERENCE, content_of(REFERENCE))
    assert forests[0].trunks[0] == Trunk(6.375, 30.128, 27.736, 31.514, "across")
    assert forests[0].trees_m[0] == (33.3, 6.9)
    assert forests[0].shortest_path_m == 37.61
    turned = replace(forests[0], heading_deg=0.1 + 0.2, trunks=(), diameters_m=(), shortest_path_m=None, noise=1)
    some = [*forests[:20], turned, generate_forest(2**31 - 1, 0, 0)]
    assert read(lines_of(some)) == some


def test_whole_numbers_are_read_as_lengths_and_the_shortest_path_may_be_absent() -> None:
    row = {key: value for key, value in ROW.items() if key != "shortest_path_m"}
    (forest,) = read(json.dumps(row | {"start_m": [25, 12], "goal_y_m": 50}))
    assert (forest.start_m, forest.shortest_path_m) == ((25.0, 12.0), None)
    assert isinstance(forest.goal_y_m, float)


def test_blank_lines_count_only_as_lines() -> None:
    assert [forest.noise for forest in read(f"\n{line_with()}\r\n  \n{line_with(noise=7)}\n\n")] == [2025, 7]
    assert "line 5" in refusal(f"\n{line_with()}\n  \n{line_with(noise=7)}\nnonsense")


@pytest.mark.parametrize("key", [key for key in ROW if key != "shortest_path_m"])
def test_missing_key_is_named(key: str) -> None:
    row = {other: value for other, value in ROW.items() if other != key}
    assert refusal(json.dumps(row)) == f"my.jsonl, line 1: key '{key}' is missing"


BEYOND = 1.2 * WORLD_SIZE_M


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ('{"forest": 1,', "line 1: not JSON at column 14: "),
        (f"{line_with()}\n".encode() + b"\xff\n", "line 2: not JSON that can be read: "),
        ("[1, 2]", "line 1: "),
        ("[" * 100_000, "line 1: not JSON that can be read: "),
        (line_with(goal_y_m=1).replace(": 1,", ": 1" + "0" * 5000 + ",", 1), "line 1: not JSON that can be read: "),
        (line_with(noize=1), "line 1: unknown key 'noize'; did you mean 'noise'?"),
        (line_with(**{"n\noize": 1}), "line 1: unknown key 'n oize'; did you mean 'noise'?"),
        (line_with(**{"n" * 1000: 1}), "line 1: unknown key 'nnn"),
        (line_with(forest="3"), "line 1: key 'forest' = '3': "),
        (line_with(forest=-1), "line 1: key 'forest' = -1: "),
        (f"{line_with()}\n{line_with(noise=1.5)}", "line 2: key 'noise' = 1.5: "),
        (
            line_with(noise=2**31),
            "line 1: key 'noise' = 2147483648: input should be less than 2147483648; allowed is 0 to below 2147483648",
        ),
        (line_with(heading_deg=None), "line 1: key 'heading_deg' = None: "),
        (line_with(heading_deg=float("nan")), "line 1: key 'heading_deg' = nan: input should be a finite number"),
        (line_with(heading_deg=-10), "line 1: key 'heading_deg' = -10: "),
        (line_with(heading_deg=90), "line 1: heading_deg: is 90, expected below 90 or above 270"),
        (line_with(goal_y_m=10**400), "line 1: key 'goal_y_m' = 1000"),
        (line_with(goal_y_m=False), "line 1: key 'goal_y_m' = False: "),
        (line_with(goal_y_m=12.5), "line 1: goal_y_m: is 12.5, expected north of the start at 12.5 m"),
        (line_with(goal_y_m=BEYOND), "line 1: key 'goal_y_m' = 60.0: "),
        (line_with(start_m=[BEYOND, 2]), "line 1: key 'start_m.0' = 60.0: "),
        (line_with(trees_m=[[1, 2], [3, BEYOND]]), "line 1: key 'trees_m.1.1' = 60.0: "),
        (line_with(trees_m={"x": 1}), "line 1: key 'trees_m' = {'x': 1}: "),
        (line_with(tree_radius_m=0), "line 1: key 'tree_radius_m' = 0: "),
        (line_with(trunk_diameter_m=-0.3), "line 1: key 'trunk_diameter_m' = -0.3: "),
        (line_with(diameters_m=[0.3]), "line 1: diameters_m: expected one for each of the 2 trunks"),
        (line_with(trunks_m=[[1, 2, 3, 4]]), "line 1: key 'trunks_m.0.4' is missing"),
        (line_with(trunks_m=[[1, 2, -3, 4, "left"]]), "line 1: key 'trunks_m.0.2' = -3: "),
        (line_with(trunks_m=[[1, 2, 3, 4, "up"]]), "line 1: key 'trunks_m.0.4' = 'up': "),
        (line_with(trunks_m=[[0, 2, 1e-170, 2, "across"]]), "line 1: trunks_m[0]: has no length"),
        (f"{line_with()}\n{line_with(noise=1)}\n{line_with()}", "line 3: forest, noise: 3, 2025 is on line 1 too"),
        ("\n \n", "there is no forest in this file"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line_that_says_where(content: str | bytes, said: str) -> None:
    text = refusal(content)
    assert text.startswith((f"my.jsonl, {said}", f"my.jsonl: {said}"))
    assert "\n" not in text
    assert len(text) < 250


def test_brackets_within_brackets_are_refused_at_every_depth() -> None:
    for depth in range(sys.getrecursionlimit() - 200, sys.getrecursionlimit()):
        assert "line 1: " in refusal(line_with().replace("2025", "[" * depth + "]" * depth))


@pytest.mark.parametrize(
    ("name", "why"),
    [("forests.jsonl", "No such file"), (".", "it is a folder"), ("pipe", "it is a pipe"), ("sparse", "it has more")],
)
def test_what_cannot_be_opened_is_refused(tmp_path: Path, name: str, why: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "sparse").touch()
    os.truncate(tmp_path / "sparse", 10**12)
    with pytest.raises(BadForest, match=rf"cannot be read .{why}"):
        content_of(tmp_path / name)


@pytest.mark.parametrize(
    ("obstacle", "where", "gap_m"),
    [
        ({"trees_m": [[1, 1], [25.0, 12.5]]}, "trees_m[1]", -0.25),
        ({"trunks_m": [[20.0, 12.9, 30.0, 12.9, "across"]]}, "trunks_m[0]", 0.25),
        ({"trunks_m": [[25.4, 12.5, 30.0, 12.5, "across"]]}, "trunks_m[0]", 0.25),
    ],
)
def test_start_that_touches_an_obstacle_says_by_how_much(obstacle: dict[str, object], where: str, gap_m: float) -> None:
    assert refusal(line_with(**obstacle)).endswith(
        f"start_m: {where} is {gap_m:.3f} m from the centre of the rover, "
        f"expected more than 0.283 m (its corners); it lacks {0.2828427 - gap_m:.3f} m"
    )


def test_start_just_beside_an_obstacle_is_accepted() -> None:
    assert len(read(line_with(trees_m=[[25.0 + 0.25 + 0.284, 12.5]]))) == 1


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
    lean: str, offset_deg: float, expected: str, heading_deg: float
) -> None:
    axis_rad = radians(heading_deg + offset_deg)
    trunk = [30.0, 30.0, 30.0 + 5.0 * sin(axis_rad), 30.0 + 5.0 * cos(axis_rad), lean]
    text = refusal(line_with(trunks_m=[trunk], heading_deg=heading_deg))
    assert text.endswith(f"trunks_m[0]: lean is '{lean}', but the trunk lies {expected}")


@pytest.mark.parametrize("lean", ["right", "left"])
def test_lean_of_a_trunk_along_the_goal_heading_may_be_either(lean: str) -> None:
    assert read(line_with(trunks_m=[[30.0, 30.0, 30.0, 33.0, lean]]))[0].trunks[0].lean == lean

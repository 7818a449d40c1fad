"""Films of trials: a short one is really drawn, written and read back; what cannot be filmed is one line."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.conftest import Run, refusal
from tests.simhal.mujoco.fields import A_M, B_M, BODY, RADIUS_M, drive, rover_on
from wayfarer.errors import BadInput
from wayfarer.escape.api import Phase
from wayfarer.experiments.film import screen, textures, video
from wayfarer.experiments.film.camera import BESIDE_DEG, SIGHT_M, View, smooth, views
from wayfarer.experiments.film.footage import FilmedTick, Footage
from wayfarer.experiments.film.rover_looks import SHELL
from wayfarer.experiments.film.scenery import MARK_EVERY_M, Scenery, scenery_of
from wayfarer.simhal.mujoco.world import MujocoWorld
from wayfarer.simhal.world.collision import Obstacle
from wayfarer.simhal.world.forest import CLEARING

SIM = ("sim", "--physics", "mujoco", "--rover", "forestrover", "--budget-m", "3", "--trial", "0")
FAST = ("--video-speed", "20")


@pytest.fixture(scope="module")
def opengl() -> None:
    """Something to draw with."""
    try:
        with screen.opengl(64, 64):
            pass
    except BadInput as error:
        pytest.skip(f"nothing to draw with: {error}")


needs_opengl = pytest.mark.usefixtures("opengl")


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    monkeypatch.setattr(textures, "LEAVES", 200)  # a bare floor is made sooner
    return run


def pictures(path: Path) -> list[NDArray[np.uint8]]:
    with av.open(str(path)) as file:
        return [frame.to_ndarray(format="rgb24").astype(np.uint8) for frame in file.decode(video=0)]


def orange_share(picture: NDArray[np.uint8]) -> float:
    """How much of a picture has about the hue of the rover's shell, in sun or shade."""
    red, green, blue = np.moveaxis(picture.astype(float), 2, 0)
    hue = SHELL[1] / SHELL[0]
    return float(np.mean((red > 120.0) & (np.abs(green / red.clip(1.0) - hue) < 0.15) & (blue < 0.3 * red)))


def lasts_s(row: str, speed: float) -> float:
    """How long the film of a trial should be, by the row that the command printed."""
    time_s, wait_s = float(row.splitlines()[1].split(",")[8]), 10.0  # before the start
    return (time_s - wait_s) / speed + video.BEFORE_S + video.AFTER_S


@needs_opengl
@pytest.mark.long
def test_film_shows_the_rover_in_the_middle_and_changes_nothing_of_the_trial(run: Run, tmp_path: Path) -> None:
    plain = run(*SIM, "--log-dir", tmp_path / "plain")
    code, out, err = run(*SIM, *FAST, "--log-dir", tmp_path / "filmed", "--video", tmp_path / "trial.mp4")
    assert code == 0, err
    assert out == plain[1]
    names = sorted(path.name for path in (tmp_path / "plain").iterdir())
    assert all((tmp_path / "plain" / n).read_bytes() == (tmp_path / "filmed" / n).read_bytes() for n in names)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["filmed", "plain", "trial.mp4"], "no draft is left"
    shown = pictures(tmp_path / "trial.mp4")
    assert len(shown) == pytest.approx(lasts_s(out, speed=20.0) * 25, abs=2)
    assert shown[0].shape == (540, 960, 3)
    for picture in (shown[0], shown[len(shown) // 2], shown[-1]):
        assert orange_share(picture[180:360, 320:640]) > 0.04
        assert orange_share(picture[380:, :]) < 0.01
    assert np.abs(shown[30].astype(float) - shown[len(shown) // 2]).mean() > 5.0, "it moves"


@needs_opengl
@pytest.mark.long
def test_animated_picture_is_written_for_a_page(run: Run, tmp_path: Path) -> None:
    code, out, err = run(*SIM, "--video-speed", "100", "--video", tmp_path / "trial.webp")
    assert code == 0, err
    data = (tmp_path / "trial.webp").read_bytes()
    assert data[:4] + data[8:12] == b"RIFFWEBP"
    # The encoder joins pictures that are alike, so their durations are added up: 3 bytes, 12 after each chunk's size.
    chunks = [place for place in range(len(data)) if data.startswith(b"ANMF", place)]
    shown_ms = sum(int.from_bytes(data[place + 20 : place + 23], "little") for place in chunks)
    assert shown_ms / 1000.0 == pytest.approx(lasts_s(out, speed=100.0), abs=0.2)
    assert len(chunks) > 10, "it moves"
    loops = data.index(b"ANIM") + 12
    assert data[loops : loops + 2] == b"\0\0", "for ever"


def tick(world_joints: NDArray[np.float64], t_s: float) -> FilmedTick:
    return FilmedTick(t_s, world_joints.copy(), Phase.FOLLOW, 0.0)


def driven(world: MujocoWorld, seconds: int) -> list[FilmedTick]:
    ticks = [tick(world.data.qpos, 0.0)]
    for _ in range(20 * seconds):
        drive(world, 0.3, 0.3, 0.05)
        ticks.append(tick(world.data.qpos, world.t_s))
    return ticks


def seen_of(world: MujocoWorld, ticks: list[FilmedTick], monkeypatch: pytest.MonkeyPatch) -> Scenery:
    monkeypatch.setattr(textures, "LEAVES", 200)
    return scenery_of(CLEARING, world, ticks)


@pytest.mark.long
def test_model_of_the_film_has_the_joints_and_the_ground_of_the_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    world = rover_on(0.5, roughness_m=0.01)
    seen = seen_of(world, driven(world, 1), monkeypatch).model
    assert seen.nq == world.model.nq
    assert (seen.jnt_qposadr == world.model.jnt_qposadr).all()
    assert (seen.hfield_data == world.model.hfield_data).all()
    wheels = [np.abs(model.body_pos[-4:]).tolist() for model in (seen, world.model)]
    assert wheels[0] == wheels[1] == [[A_M, B_M, 0.0]] * 4
    assert not world.model.nlight, "the trial's own model is left as it was"


@pytest.mark.long
def test_tyres_leave_marks_where_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    world = rover_on(0.8)
    ticks = driven(world, 3)
    seen = seen_of(world, ticks, monkeypatch)
    gone_m = ticks[-1].joints[1] - ticks[0].joints[1]
    assert len(seen.marks_s) == len(seen.marks) == pytest.approx(4 * gone_m / MARK_EVERY_M, rel=0.2)
    places_m = seen.model.geom_pos[seen.marks]
    assert abs(places_m[:, 0] - 25.0).max() == pytest.approx(B_M, abs=0.02)
    assert places_m[:, 2] == pytest.approx(0.0, abs=0.1 * RADIUS_M)
    nose_m = np.interp(seen.marks_s, [each.t_s for each in ticks], [each.joints[1] for each in ticks]) + A_M
    assert (places_m[:, 1] <= nose_m + 0.01).all(), "no mark comes before its wheel"


def footage_of(ticks: list[FilmedTick]) -> Footage:
    footage = Footage(None)
    footage.ticks = ticks
    return footage


def test_moment_between_two_ticks_lies_between_them() -> None:
    footage = footage_of(driven(rover_on(0.8), 1))
    before, after = footage.ticks[10:12]
    middle_s = (before.t_s + after.t_s) / 2.0
    early, between, late = footage.at([-5.0, middle_s, 99.0])
    assert between.t_s == middle_s
    assert between.joints[1] == pytest.approx((before.joints[1] + after.joints[1]) / 2.0)
    for shown, known in ((early, footage.ticks[0]), (late, footage.ticks[-1])):
        assert shown.t_s == known.t_s
        assert (shown.joints == known.joints).all()


@needs_opengl
@pytest.mark.long
def test_marks_appear_when_they_are_left_and_a_tree_before_the_rover_is_transparent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = rover_on(0.8)
    ticks = driven(world, 3)
    x_m, y_m, _ = ticks[-1].joints[:3].tolist()
    monkeypatch.setattr(textures, "LEAVES", 200)
    with screen.opengl(64, 64):
        seen = scenery_of(replace(CLEARING, trees_m=((x_m, y_m - 1.0), (x_m, y_m + 1.0))), world, ticks)
        painter = screen.Screen(seen, 64, 64)
        for number in (0, -1):
            painter.draw(ticks[number], View(ticks[number].joints[:3], 90.0, 25.0, 2.0))
            visible = seen.model.geom_rgba[seen.marks, 3] > 0.0
            assert (visible == (seen.marks_s <= ticks[number].t_s)).all()
        monkeypatch.setattr(screen, "MOST_MARKS", 5)
        painter.draw(ticks[-1], View(ticks[-1].joints[:3], 90.0, 25.0, 2.0))
        visible = seen.model.geom_rgba[seen.marks, 3] > 0.0
        assert seen.marks_s[visible].min() >= np.sort(seen.marks_s)[-5]
        assert visible.sum() == 5
        assert seen.model.geom_rgba[seen.trees[:2], 3] == pytest.approx([screen.FADED, 1.0]), "south and north of it"
        painter.close()


def test_camera_rises_before_a_trunk_hides_the_rover() -> None:
    joints = np.tile(rover_on(0.5).data.qpos, (50, 1))  # heads north; the camera is south of it
    free = views(joints, [], BODY.length_m, 25)
    trunk = Obstacle(20.0, 12.5 - SIGHT_M[1], 30.0, 12.5 - SIGHT_M[1], 0.15, 90.0)
    beside = views(joints, [trunk], BODY.length_m, 25)
    assert beside[25].elevation_deg > free[25].elevation_deg + 5.0
    assert free[25].azimuth_deg == pytest.approx(90.0 - BESIDE_DEG)
    ahead = Obstacle(20.0, 13.5, 30.0, 13.5, 0.15, 90.0)
    assert views(joints, [ahead], BODY.length_m, 25)[25].elevation_deg == pytest.approx(free[25].elevation_deg)


def test_smoothing_keeps_what_is_constant_and_lags_behind_nothing() -> None:
    assert smooth(np.full(40, 3.0), 5.0) == pytest.approx(3.0)
    line = np.arange(100.0)
    assert smooth(line, 5.0)[30:70] == pytest.approx(line[30:70])


REFUSED = {
    "another kind": ((*SIM, "--video", "x.avi"), "--video x.avi: expected a name that ends in .mp4 or .webp"),
    "no such folder": ((*SIM, "--video", "/nowhere/x.mp4"), "--video /nowhere/x.mp4 cannot be written: No such file"),
}


@pytest.mark.process
@needs_opengl
@pytest.mark.parametrize(("arguments", "says"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_filmed_is_one_line(run: Run, arguments: tuple[str, ...], says: str) -> None:
    assert says in refusal(run, *arguments)


def test_missing_encoder_is_one_line_and_leaves_no_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("wayfarer.extras.find_spec", lambda name: None if name == "scipy" else object())
    assert "--video needs scipy, which is not installed: pip install 'wayfarer-rover[ph" in refusal(
        run, *SIM, "--video", tmp_path / "x.mp4"
    )
    assert not list(tmp_path.iterdir())


def test_missing_opengl_is_one_line_and_leaves_no_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco.egl", None)  # its import fails, as where the system has no EGL
    said = refusal(run, *SIM, "--video", tmp_path / "x.mp4")
    assert "--video cannot draw with OpenGL (" in said
    assert said.rstrip().endswith("apt install libegl1 libgl1-mesa-dri")
    assert not list(tmp_path.iterdir())

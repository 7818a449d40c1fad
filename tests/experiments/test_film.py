"""Films of trials: a short one is really drawn, written and read back; what cannot be filmed is one line."""

from __future__ import annotations

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
from wayfarer.experiments.film.camera import SIGHT_M, smooth, views
from wayfarer.experiments.film.footage import FilmedTick, Footage
from wayfarer.experiments.film.looks import SHELL
from wayfarer.experiments.film.scenery import Scenery
from wayfarer.experiments.film.tyre_marks import EVERY_M, bars_of
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
    plain = run(*SIM, "--log", tmp_path / "plain")
    code, out, err = run(*SIM, *FAST, "--log", tmp_path / "filmed", "--video", tmp_path / "trial.mp4")
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


@pytest.mark.long
def test_model_of_the_film_has_the_joints_of_the_trial_and_meets_nothing() -> None:
    world = rover_on(0.5, roughness_m=0.01)
    seen = Scenery(CLEARING, world, 64, 64).model
    assert seen.nq == world.model.nq
    assert (seen.jnt_qposadr == world.model.jnt_qposadr).all()
    assert (seen.hfield_data == world.model.hfield_data).all()
    assert not seen.geom_contype.any()
    assert not seen.geom_conaffinity.any()
    wheels = [np.abs(model.body_pos[-4:]).tolist() for model in (seen, world.model)]
    assert wheels[0] == wheels[1] == [[A_M, B_M, 0.0]] * 4


def shot(world_joints: NDArray[np.float64], t_s: float) -> FilmedTick:
    return FilmedTick(t_s, world_joints.copy(), Phase.FOLLOW, 0.0)


def driven(seconds: int) -> list[FilmedTick]:
    world = rover_on(0.8)
    shots = [shot(world.data.qpos, 0.0)]
    for _ in range(20 * seconds):
        drive(world, 0.3, 0.3, 0.05)
        shots.append(shot(world.data.qpos, world.t_s))
    return shots


def test_moment_between_two_ticks_lies_between_them() -> None:
    footage = Footage.__new__(Footage)
    footage.shots = driven(1)
    before, after = footage.shots[10:12]
    between = footage.at((before.t_s + after.t_s) / 2.0)
    assert between.joints[1] == pytest.approx((before.joints[1] + after.joints[1]) / 2.0)
    assert np.linalg.norm(between.joints[3:7]) == pytest.approx(1.0)
    assert footage.at(-5.0) is footage.shots[0]
    assert footage.at(99.0) is footage.shots[-1]


def test_rover_that_is_carried_elsewhere_does_not_slide_there() -> None:
    footage = Footage.__new__(Footage)
    footage.shots = driven(1)[:2]
    footage.shots[1].joints[0] += 3.0
    assert (footage.at(0.04).joints == footage.shots[0].joints).all()


def test_tyres_leave_bars_where_they_were_and_no_sooner() -> None:
    shots = driven(3)
    bars = bars_of(shots, BODY)
    gone_m = shots[-1].joints[1] - shots[0].joints[1]
    assert len(bars.times_s) == pytest.approx(4 * gone_m / EVERY_M, rel=0.2)
    assert abs(bars.places_m[:, 0] - 25.0).max() == pytest.approx(B_M, abs=0.02)
    assert bars.places_m[:, 2] == pytest.approx(0.0, abs=0.1 * RADIUS_M)
    assert len(bars.until(0.0, shots[0].joints)) == 0
    assert len(bars.until(99.0, shots[-1].joints)) == len(bars.times_s)


def test_camera_rises_before_a_trunk_hides_the_rover() -> None:
    joints = np.tile(rover_on(0.5).data.qpos, (50, 1))  # heads north; the camera is south of it
    free = views(joints, [], BODY.length_m, 25)
    trunk = Obstacle(20.0, 12.5 - SIGHT_M[1], 30.0, 12.5 - SIGHT_M[1], 0.15, 90.0)
    beside = views(joints, [trunk], BODY.length_m, 25)
    assert beside[25].elevation_deg > free[25].elevation_deg + 5.0
    assert free[25].eye_m[1] < 12.5 - 1.0
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


MISSING = {
    "encoder": ("wayfarer.cli.extras.find_spec", "", "--video needs scipy, which is not installed: pip install '.[ph"),
    "opengl": ("wayfarer.experiments.film.screen.find_library", "", "the system has no libEGL or libOSMesa: apt insta"),
    "off screen": ("wayfarer.experiments.film.screen.find_library", "glfw", "MUJOCO_GL=glfw cannot: unset it, or set"),
}


@pytest.mark.parametrize(("finder", "backend", "says"), MISSING.values(), ids=MISSING)
def test_what_cannot_be_drawn_is_one_line_and_leaves_no_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, finder: str, backend: str, says: str
) -> None:
    monkeypatch.setenv("MUJOCO_GL", backend)
    monkeypatch.setattr(finder, lambda name: None if name in ("scipy", "EGL", "OSMesa") else object())
    assert says in refusal(run, *SIM, "--video", tmp_path / "x.mp4")
    assert not list(tmp_path.iterdir())

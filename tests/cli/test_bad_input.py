"""What cannot be, or does not go together, is refused in one line with exit code 2, and leaves no folder behind.

What may come later ends with 1, so that systemd tries again (``tests/system/test_systemd.py``).
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

from tests.conftest import Run, refusal

ANGLES = "sweep escape.turn_angle_deg=10,30"
MAZE = "sim --site extended-maze"

BAD_INPUT = {
    "smi": "'smi'; did you mean sim?",
    "logs shwo": "did you mean show?",
    "halt": "No such command 'halt'\n",
    "sim --trails 3 --out out": "--trails; did you mean --trials",
    "sim --banana 3 --out out": "No such option: --banana\n",
    "sim --trials 0 --out out": "--trials",
    "sim --jobs 0 --out out": "--jobs",
    "sim --seed -1 --out out": "--seed",
    "sim --trials many --out out": "--trials 'many': input should be a valid integer",
    "sim --slip-mean-m nan --out out": "--slip-mean-m 'nan': input should be a valid number",
    "sim --budget-m 0 --out out": "--budget-m 0: input should be greater than 0; allowed is above 0 to 1000000",
    "sim --depth chip": "--depth 'chip': input should be 'device' or 'bus'",
    "sim --set anomaly_source=smell --out out": "'anomaly_source' = 'smell'",
    "sim --algorithm pledge,forest-plege --out out": "did you mean forest-pledge",
    "sim --algorithm no_such_module:x --out out": "cannot import no_such_module",
    "sim --rover simm --out out": "did you mean sim",
    "sim --rover no/such.toml --out out": "no/such.toml",
    "sim --forests no/such.jsonl --out out": "no/such.jsonl",
    "sim --forests refrence": "refrence",
    "sim --trial -1": "--trial",
    "sim --trials 5 --trial 3": "--trial and --trials",
    "sim --trial 1 --algorithm pledge,oo-react": "one of pledge, oo-react",
    "sim --trial 0 --out out": "--trial and --out",
    "sim --log-dir logs --out out --resume": "--log-dir and --resume",
    "sim --resume": "--out",
    "sim --set sim.friction=0.3 --out out": "add --physics mujoco",
    "sim --physics mujoco --set sim.friction=0": "key 'sim.friction' = 0",
    "sim --physics mujoco --set sim.roughness_m=0.01:0.5": "allowed is 0 to 0.1",
    "sim --physics mujoco --ground mud --out out": "--ground mud",
    "sweep ground=ideal,ice --out out": "'leaf-litter'",
    "sim --set sim.slope_deg=50 --out out": "key 'sim.slope_deg' = 50",
    "sim --set sim.slop_deg=5 --out out": "did you mean sim.slope_deg",
    "sim --set senses=feild --out out": "did you mean field",
    "sim --set sim.slope_deg --out out": "write KEY=VALUE, or KEY=LOW:HIGH",
    "sim --slip-mean-m 2 --set slip_mean_m=3 --out out": "--slip-mean-m and the key 'slip_mean_m' set the same value",
    "sweep sim.blind_share=2 --out out": "'sim.blind_share' = 2",
    "sim --cluster a:1 --jobs 2": "--jobs and --cluster",
    "sim --cluster a:1 --trial 2": "--trial and --cluster",
    "sim --cluster a:1 --log-dir logs": "--log-dir and --cluster",
    f"{MAZE} --rover forestrover --forests x.jsonl": "--site and --forests",
    MAZE: "chassis.ground_clear",
    "sim --site swamp --out out": "unknown site 'swamp': known: dense-obstruction, extended-maze, forest-escape",
    "sweep --out out": "Missing argument 'KEY=VALUES', for example: wayfarer sweep escape.turn_",
    "sweep escape.turn_angel_deg=10 --out out": "did you mean escape.turn_",
    "sweep escape.turn_angle_deg=10:180 --out out": "a range is FIRST:LAST:STEP",
    f"{ANGLES} --site extended-maze --forests reference --out out": "--site and --forests",
    f"{ANGLES} --site extended-maze --out out": "chassis.ground_clear",
    f"{ANGLES} --set sim.friction=0.3 --out out": "add --physics mujoco",
    f"{ANGLES} --physics mujoco --ground mud --out out": "--ground mud",
    f"{ANGLES} --set escape.turn_angle_deg=90 --out out": "is there twice, swept or in --set",
    f"{ANGLES} slip_mean_m=2 footprint_m=0.4 --out out": "3 keys to sweep",
    f"{ANGLES} escape.turn_angle_deg=10,30 --out out": "is there twice",
    ANGLES: "Missing option '--out', for example: wayfarer sweep escape.turn_angle_deg=10:180:10",
    "goal": "Missing argument 'DEG', for example: wayfarer goal 270",
    "mark": "Missing argument 'TEXT', for example: wayfarer mark",
    "compare": "Missing argument 'RESULTS', for example: wayfarer compare results",
    "logs export 1 --format xls": "'xls'",
    "demo --rover minirover": "--rover",
    "run --rover minirover --seed 3": "without --sim",
    "run --rover minirover --fault snag": "without --sim",
    "run --sim --fault loop_stall": "in virtual time only: use wayfarer sim",
    "sim --fault silnt:compass --out out": "did you mean silent",
    "sim --fault silent --out out": "name the part: silent:compass, silent:motion",
    "sim --fault snag@soon --out out": "'soon' is not a time",
    "sim --fault nack:compass --out out": 'it needs depth "bus"',
    "list --faults --conditions": "--conditions and --faults",
    "run --rover minirover --depth bus": "without --sim",
    "run --sim --live-port 8088": "without --live",
    "run --sim --rover forestrover --algorithm cv-pledge --log-dir logs": "needs a contact sensor",
}


@pytest.mark.usefixtures("own_folders")
@pytest.mark.parametrize(("command", "says"), BAD_INPUT.items(), ids=BAD_INPUT)
def test_bad_input_is_one_line_and_exit_code_2_and_leaves_no_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    err = refusal(run, *shlex.split(command))
    assert err.startswith("wayfarer: ")
    assert says in err
    assert list(tmp_path.iterdir()) == []


LATE = {
    "run --rover forestrover": "is not there",
    "run --sim --mavlink udpout:no-such-host.invalid:14550": "host no-such-host.invalid is not known",
    "run --sim --live --live-host no-such-host.invalid": "no-such-host.invalid cannot be used",
    "run --sim --live --live-host 192.0.2.77": "192.0.2.77 cannot be used",
    "run --sim --live --live-port {taken_port}": "is in use",
}


@pytest.mark.usefixtures("own_folders")
@pytest.mark.parametrize(("command", "says"), LATE.items(), ids=LATE)
def test_what_time_may_mend_is_one_line_and_exit_code_1_and_leaves_no_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken_port: int, command: str, says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in refusal(run, *shlex.split(command.format(taken_port=taken_port)), exit_code=1)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def no_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the README's installation leaves out: None is what Python takes for "not installed"."""
    monkeypatch.setitem(sys.modules, "cv2", None)


@pytest.mark.usefixtures("no_opencv")
@pytest.mark.parametrize("command", ["sim", "sweep footprint_m=0.2 --out out", "run --sim"])
def test_rover_whose_driver_needs_a_package_says_what_to_install(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    said = refusal(run, *shlex.split(command), "--rover", "minirover", "--depth", "bus")
    assert (
        "rover 'minirover' needs cv2 for [parts.motion], which is not installed: pip install 'wayfarer-rover[camera]'; "
        "or use --depth"
    ) in said
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("no_opencv")
def test_what_needs_no_camera_runs_without_opencv(run: Run) -> None:
    code, _, _ = run("sim", "--rover", "minirover", "--trial", 0, "--budget-m", 1)
    assert code == 0

"""A real systemd starts, at boot, a rover whose drivers and algorithm are its owner's files (own_scenario.py)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.system import nspawn


def test_rover_of_one_s_own_comes_up_at_boot_is_armed_and_stops(tmp_path: Path) -> None:
    (tmp_path / "trial").mkdir()
    if (reason := nspawn.why_not(tmp_path / "trial")) is not None:
        pytest.skip(reason)
    folder = nspawn.boot(Path(__file__).with_name("own_scenario.py"), tmp_path, boots=2)
    if not (folder / "driver.txt").is_file():
        pytest.skip(f"no systemd comes up in a container here: {(folder / 'console.txt').read_text()[-500:]}")
    print((folder / "driver.txt").read_text(encoding="utf-8"))
    seen = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    print(seen["journal"])

    assert (seen["up"]["ActiveState"], seen["mode"]) == ("active", "disarmed")
    assert seen["armed"]["code"] == 0, seen["armed"]
    assert seen["before"][-1].startswith("drive 0.7"), "it drives ahead: 1 m/s of 1.4"

    assert seen["stopped"]["code"] == 0
    assert (seen["state"]["ActiveState"], seen["state"]["Result"]) == ("inactive", "success")
    assert seen["after"][-1] == "drive 0.00 0.00"
    assert seen["after"].count("stop") >= 2, "by the daemon, and by ExecStopPost="
    assert "wheels of mine says that the wheels are stopped" in seen["journal"]

    files = seen["header"]["files"]
    assert seen["header"]["algorithm"] == "spiral_of_mine.py"
    assert files["spiral_of_mine.py"]["path"] == "/etc/wayfarer/spiral_of_mine.py"
    assert "/etc/wayfarer/own_parts.py:Needle" in files
    assert seen["beside"] == ["own_parts.py", "rover.toml", "spiral_of_mine.py"], "nothing is written there"

    assert seen["root"]["code"] == 0, seen["root"]
    assert "stop" in seen["root"]["told"]
    assert seen["refused"]["code"] == 2
    assert "sudo chmod go-w /etc/wayfarer/own_parts.py" in seen["refused"]["err"]

"""What is done inside the booted system to a service whose drivers and algorithm are files in /etc/wayfarer.

The first boot installs and enables the service; the second one starts it. Nothing is judged here: test_own_files.py
asks the report.
"""

# ruff: noqa: TID251 - real time passes in a real systemd
from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path
from typing import Any

from tests.system.scenario import (
    DROP_IN,
    POLL_S,
    RESULTS,
    ROVER_FILE,
    SERVICE,
    WAYFARER,
    install,
    mode,
    run,
    shown,
    wait_for_mode,
    wait_until,
)

SOURCE = Path("/opt/wayfarer/source/tests/system")
OWN = ROVER_FILE.parent
TOLD = Path("/var/lib/wayfarer/own_wheels.txt")
REPORT = RESULTS / "report.json"
ROVER = """
name = "mine"
anomaly_source = "contact"
[vehicle]
length_m = 0.4
width_m = 0.4
track_m = 0.5
max_speed_m_s = 1.4
[safety]
start_delay_s = 0.0
[parts.motors]
driver = "own_parts.py:Wheels"
[parts.compass]
driver = "own_parts.py:Needle"
[parts.contact]
driver = "own_parts.py:Bumper"
"""


def first_boot() -> None:
    """Install the files as docs/how-to/service.md says, and let the next boot start the service."""
    install()
    ROVER_FILE.write_text(ROVER, encoding="utf-8")
    Path("/root/new").mkdir()
    subprocess.run([WAYFARER, "new", "algorithm", "spiral_of_mine"], cwd="/root/new", check=True)
    for file in (SOURCE / "own_parts.py", Path("/root/new/spiral_of_mine.py")):
        subprocess.run(["install", "-m", "644", file, str(OWN)], check=True)
    DROP_IN.parent.mkdir()
    command = (
        f"{WAYFARER} run --rover {ROVER_FILE} --log-dir /var/lib/wayfarer/field_logs --algorithm spiral_of_mine.py"
    )
    DROP_IN.write_text(f"[Service]\nExecStart=\nExecStart={command}\n", encoding="utf-8")
    subprocess.run(["systemctl", "daemon-reload"], check=True)
    # The container boots into this scenario's unit, in the place of multi-user.target.
    subprocess.run(["systemctl", "add-wants", "driver.service", SERVICE], check=True)


def told() -> list[str]:
    """What the wheels were told so far."""
    return TOLD.read_text(encoding="utf-8").splitlines() if TOLD.exists() else []


def second_boot() -> dict[str, Any]:
    """Wait for the service, arm it, let it drive, stop it; then stop the motors as root."""
    up = wait_until(lambda state: state["ActiveState"] in {"active", "failed"}, 60)
    seen: dict[str, Any] = {"up": up, "mode": mode(), "armed": run(WAYFARER, "arm")}
    wait_for_mode("armed", 30)
    ends_s = time.monotonic() + 30
    while told()[-1] in {"drive 0.00 0.00", "stop"} and time.monotonic() < ends_s:
        time.sleep(POLL_S)
    before = told()
    seen["stopped"] = run("systemctl", "stop", SERVICE)
    seen |= {"state": shown(), "before": before, "after": told()[len(before) :]}
    log = max(Path("/var/lib/wayfarer/field_logs").rglob("run.*.jsonl"))
    seen["header"] = json.loads(log.read_text(encoding="utf-8").splitlines()[0])
    seen["beside"] = sorted(path.name for path in OWN.iterdir())
    stopped = len(told())
    seen["root"] = run(WAYFARER, "stop-motors") | {"told": told()[stopped:]}
    (OWN / "own_parts.py").chmod(0o664)
    seen["refused"] = run(WAYFARER, "stop-motors")
    seen["journal"] = run("journalctl", "--no-pager", "--output=cat", "--unit", SERVICE)["out"]
    return seen


def main() -> None:
    """Do what is to be done at this boot."""
    if not (OWN / "own_parts.py").exists():
        first_boot()
    else:
        REPORT.write_text(json.dumps(second_boot(), indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()

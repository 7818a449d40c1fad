"""What is done to the service inside the booted system. Runs there as root; each step writes down what it saw.

Nothing is judged here: the report goes to /results/report.json, and test_systemd.py asks it.
"""

# ruff: noqa: TID251 - real time passes in a real systemd
from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

RESULTS = Path("/results")
WAYFARER = "/opt/wayfarer/bin/wayfarer"
RUN = f"{WAYFARER} run --sim --rover /etc/wayfarer/rover.toml --log-dir /var/lib/wayfarer/field_logs"
ROVER = "/opt/wayfarer/source/tests/system/rover.toml"
WHEELS = Path("/var/lib/wayfarer/wheels.txt")  # what tests.system.wheels was told
ROVER_FILE = Path("/etc/wayfarer/rover.toml")
RECORD = {"motors": {"driver": "tests.system.wheels:Wheels"}, "buses": "linux"}
# The files are no buses, so what is on them does not open; who may drive by hand needs only the motors.
LATE_DEVICES = ("/dev/i2c-7", "/dev/spidev7.0")
LATE_ROVER = """
name = "late"
[vehicle]
length_m = 0.4
width_m = 0.4
track_m = 0.5
max_speed_m_s = 1.4
[manual]
allowed = true
[safety]
allow_no_deadman = true
[parts.motors]
driver = "tests.system.wheels:Wheels"
[parts.compass]
driver = "cmps14"
bus = "/dev/i2c-7"
[parts.motion]
driver = "pmw3901"
bus = "/dev/spidev7.0"
"""
DROP_IN = Path("/etc/systemd/system/wayfarer.service.d/simulated.conf")
SERVICE = "wayfarer.service"
PROPERTIES = "ActiveState,SubState,StatusText,MainPID,NRestarts,Result"
POLL_S = 0.1  # each look is a process: systemctl, or wayfarer


def run(*command: str) -> dict[str, Any]:
    """Run a command; return its exit code and what it said."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr}


def shown() -> dict[str, str]:
    """What systemd says of the service now."""
    lines = run("systemctl", "show", "--property", PROPERTIES, SERVICE)["out"].splitlines()
    return dict(line.split("=", 1) for line in lines)


def mode() -> str | None:
    """What the daemon says of itself: disarmed, arming, armed; None if it does not answer."""
    answer = run(WAYFARER, "status", "--json")
    return str(json.loads(answer["out"])["mode"]) if answer["code"] == 0 else None


def wait_until(holds: Callable[[dict[str, str]], bool], limit_s: float) -> dict[str, str]:
    """Poll until systemd's view of the service is as wanted; return it, together with how long that took."""
    began_s = time.monotonic()
    while not holds(state := shown()):
        if time.monotonic() - began_s > limit_s:
            raise TimeoutError(f"after {limit_s} s the service is {state}")
        time.sleep(POLL_S)
    return state | {"after_s": f"{time.monotonic() - began_s:.2f}"}


def wait_for_mode(wanted: str, limit_s: float = 10.0) -> None:
    """Poll until the daemon is in a mode."""
    ends_s = time.monotonic() + limit_s
    while (now := mode()) != wanted:
        if time.monotonic() > ends_s:
            raise TimeoutError(f"after {limit_s} s the daemon is {now}, not {wanted}")
        time.sleep(POLL_S)


def drive_simulated(more: str = "") -> None:
    """Have the installed service drive a simulated rover; all else of the unit stays as installed."""
    DROP_IN.parent.mkdir(exist_ok=True)
    DROP_IN.write_text(f"[Service]\nExecStart=\nExecStart={RUN} {more}\n", encoding="utf-8")
    subprocess.run(["systemctl", "daemon-reload"], check=True)


def install() -> dict[str, Any]:
    """Install twice, and give the first of the two commands that it says; the second one starts the service."""
    run("install", "-D", "-m", "644", ROVER, str(ROVER_FILE))
    first = run(WAYFARER, "install-service")
    make_user, _ = [line.strip().replace("sudo ", "") for line in first["out"].splitlines() if "sudo" in line]
    return {
        "first": first,
        "make_user": run("sh", "-c", make_user),
        "second": run(WAYFARER, "install-service"),
        "verify": run("systemd-analyze", "verify", f"/etc/systemd/system/{SERVICE}"),
        "user": run("id", "wayfarer"),
    }


def security() -> dict[str, Any]:
    """Ask systemd how exposed the service is."""
    return run("systemd-analyze", "security", "--no-pager", SERVICE)


def start() -> dict[str, Any]:
    """Start, and watch it become active."""
    drive_simulated()
    subprocess.run(["systemctl", "start", "--no-block", SERVICE], check=True)
    states: list[str] = []

    def active(state: dict[str, str]) -> bool:
        if state["ActiveState"] not in states:
            states.append(state["ActiveState"])
        return state["ActiveState"] in {"active", "failed"}

    state = wait_until(active, 30)
    return {"states": states, "state": state, "mode": mode()}


def arm() -> dict[str, Any]:
    """Arm by hand."""
    answer = run(WAYFARER, "arm")
    wait_for_mode("armed")
    return {"answer": answer, "mode": mode()}


def stops_sent() -> int:
    """How often another process than the daemon has stopped the wheels so far."""
    return WHEELS.read_text(encoding="utf-8").splitlines().count("stop") if WHEELS.exists() else 0


def restart_after(set_faults: Callable[[int], object], limit_s: float) -> dict[str, Any]:
    """Do something to the daemon's process; return what systemd made of it."""
    before = shown()
    pid = int(before["MainPID"])
    sent = stops_sent()
    began_s = time.monotonic()
    set_faults(pid)
    down = wait_until(lambda state: state["SubState"] == "auto-restart", limit_s)
    sent = stops_sent() - sent
    up = wait_until(lambda state: state["ActiveState"] == "active" and int(state["MainPID"]) != pid, limit_s)
    took_s = time.monotonic() - began_s
    return {"before": before, "down": down, "up": up, "took_s": took_s, "stops_sent": sent, "mode": mode()}


def kill() -> dict[str, Any]:
    """Kill the armed daemon."""
    return restart_after(lambda pid: os.kill(pid, signal.SIGKILL), 15)


def changed_rover_file() -> dict[str, Any]:
    """Kill the daemon when its record names real motors, and the rover file others: who stops which?

    The simulated rover has no record of its own, so it is written here, as the service's user.
    """
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "start", SERVICE], check=True)
    record = f"echo '{json.dumps(RECORD)}' > /run/wayfarer/motors.json"
    written = run("runuser", "-u", "wayfarer", "--", "sh", "-c", f"umask 077; {record}")
    ROVER_FILE.write_text('[parts.motors]\ndriver = "no_such_driver"\n', encoding="utf-8")
    sent = stops_sent()
    os.kill(int(shown()["MainPID"]), signal.SIGKILL)
    wait_until(lambda state: state["SubState"] == "auto-restart", 15)
    run("systemctl", "stop", SERVICE)
    ROVER_FILE.write_text(Path(ROVER).read_text(encoding="utf-8"), encoding="utf-8")
    said = run("journalctl", "--no-pager", "--unit", SERVICE, "--output=cat")["out"].splitlines()
    return {
        "written": written,
        "stops_sent": stops_sent() - sent,
        "said": [line for line in said if "motors.json" in line],
        "left_in_run": [str(path) for path in Path("/run").glob("wayfarer/*.json")],
    }


def suspend() -> dict[str, Any]:
    """Stop the armed daemon's process: only the watchdog can notice."""
    arm()
    return restart_after(lambda pid: os.kill(pid, signal.SIGSTOP), 30)


def exception() -> dict[str, Any]:
    """Arm an algorithm that raises while it drives."""
    drive_simulated("--algorithm tests.system.buggy_algorithms:RAISES")
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "restart", SERVICE], check=True)
    return restart_after(lambda pid: run(WAYFARER, "arm"), 15)


def stop() -> dict[str, Any]:
    """Stop the service while it drives."""
    drive_simulated()
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "restart", SERVICE], check=True)
    arm()
    time.sleep(1)  # let it drive
    sent = stops_sent()
    began_s, asked_wall_s = time.monotonic(), time.time()
    stopped = run("systemctl", "stop", SERVICE)
    took_s = time.monotonic() - began_s
    newest = max(Path("/var/lib/wayfarer/field_logs").rglob("run.*.jsonl"), key=lambda path: path.stat().st_mtime_ns)
    records = [json.loads(line) for line in newest.read_text(encoding="utf-8").splitlines()]
    return {
        "stopped": stopped,
        "state": shown(),
        "took_s": took_s,
        "asked_wall_s": asked_wall_s,
        "stops_sent": stops_sent() - sent,
        "last": records[-1],
        "events": [record for record in records if record["record"] == "event"],
        "moved": any(record.get("applied_left") for record in records),
        "left_in_run": [str(path) for path in Path("/run").glob("wayfarer*")],
    }


def end() -> dict[str, Any]:
    """Have the daemon end its run as it should."""
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "start", SERVICE], check=True)
    answer = run(WAYFARER, "stop")
    wait_until(lambda state: state["ActiveState"] == "inactive", 10)
    time.sleep(6)  # longer than RestartSec
    return {"answer": answer, "state": shown()}


def read_only() -> dict[str, Any]:
    """Start where the logs' partition is mounted read-only, and arm."""
    logs = WHEELS.parent
    mounts = f"mount -t tmpfs tmpfs {logs}; chown wayfarer: {logs}; mount -o remount,ro {logs}"
    subprocess.run(["sh", "-ec", mounts], check=True)
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    started = run("systemctl", "start", SERVICE)
    seen = {"started": started, "refused": run(WAYFARER, "arm"), "armed": run(WAYFARER, "arm", "--without-log")}
    subprocess.run(["systemctl", "stop", SERVICE], check=True)
    subprocess.run(["umount", str(logs)], check=True)
    return seen


def comes_late(command: str, come: Callable[[], object]) -> dict[str, Any]:
    """Start what lacks something, see it fail and be tried again, and let it come."""
    DROP_IN.write_text(f"[Service]\nExecStart=\nExecStart={command}\n", encoding="utf-8")
    subprocess.run(["systemctl", "daemon-reload"], check=True)
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "start", "--no-block", SERVICE], check=True)
    missed = wait_until(lambda state: int(state["NRestarts"]) >= 1, 30)
    come()
    up = wait_until(lambda state: state["ActiveState"] == "active", 30)
    seen = {"missed": missed, "up": up, "mode": mode()}
    subprocess.run(["systemctl", "stop", SERVICE], check=True)
    return seen


def late() -> dict[str, Any]:
    """Start while an adapter, a name, an address or a port is not there yet."""
    taken = socket.create_server(("127.0.0.1", 8089))

    def plug_in() -> None:
        for device in LATE_DEVICES:
            Path(device).touch()
            Path(device).chmod(0o666)

    def know_name() -> None:
        with Path("/etc/hosts").open("a", encoding="utf-8") as hosts:
            hosts.write("\n127.0.0.1 late-station\n")

    ROVER_FILE.write_text(LATE_ROVER, encoding="utf-8")
    seen = {"adapter": comes_late(RUN.replace("--sim ", ""), plug_in)}
    ROVER_FILE.write_text(Path(ROVER).read_text(encoding="utf-8"), encoding="utf-8")
    return seen | {
        "name": comes_late(f"{RUN} --mavlink udpout:late-station:14550", know_name),
        "address": comes_late(
            f"{RUN} --live --live-host 10.9.8.7", lambda: run("ip", "address", "add", "10.9.8.7/32", "dev", "lo")
        ),
        "port": comes_late(f"{RUN} --live --live-port 8089", taken.close),
    }


def bad_rover_file() -> dict[str, Any]:
    """Start with a rover file that cannot be used."""
    ROVER_FILE.write_text("nonsense\n", encoding="utf-8")
    subprocess.run(["systemctl", "reset-failed", SERVICE], check=False)
    subprocess.run(["systemctl", "start", SERVICE], check=False, capture_output=True)
    time.sleep(6)  # longer than RestartSec
    return shown()


STEPS = (
    install, security, start, arm, kill, suspend, exception, stop, end, read_only, changed_rover_file, late,
    bad_rover_file,
)  # fmt: skip


def main() -> None:
    """Do all steps in turn; one that goes wrong does not hide the others."""
    report: dict[str, Any] = {}
    for step in STEPS:
        try:
            report[step.__name__] = step()
        except Exception:
            report[step.__name__] = {"error": traceback.format_exc()}
        (RESULTS / "report.json").write_text(json.dumps(report, indent=1), encoding="utf-8")
    journal = run("journalctl", "--no-pager", "--output=short-monotonic", "--unit", SERVICE)
    (RESULTS / "journal.txt").write_text(journal["out"] + journal["err"], encoding="utf-8")


if __name__ == "__main__":
    main()

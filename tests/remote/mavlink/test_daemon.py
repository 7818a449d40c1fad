"""A daemon that drives a simulated rover, and a station behind a radio that loses three frames in ten."""

# ruff: noqa: TID251 - processes live in real time
from __future__ import annotations

import json
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from tests.children import child
from tests.remote.mavlink.station import Encoder, Message, arming, heartbeat, mode, starts
from wayfarer.config.rover_path import SHIPPED
from wayfarer.daemon.socket.client import ask
from wayfarer.remote.mavlink.telemetry import MODE_AUTO, MODE_HOLD

pytestmark = pytest.mark.process

SETTINGS = '[mavlink]\non_link_lost = "hold"\nlink_lost_s = 3\n[manual]\nallowed = true\n'
LONG_S = 30.0  # this machine may be busy
HOSTILE = 3_000


class Station:
    """Loses three frames in ten, in both directions, while ``loses``."""

    def __init__(self, udp: socket.socket) -> None:
        self._udp = udp
        self._chance = random.Random(4)
        self._decoder = common.MAVLink(None)
        self._beat_s = 0.0
        self.encoder = Encoder()
        self.rover: Any = None
        self.loses = True
        self.mode = self.armed = -1

    def send(self, data: bytes) -> None:
        if not (self.loses and self._chance.random() < 0.3):
            self._udp.sendto(data, self.rover)

    def until(self, holds: Callable[[Any], bool], again: Message = None, *, beats: bool = True) -> None:
        """Send heartbeats, and a message again and again, until the rover sends what is waited for."""
        ends_s, said_s = time.monotonic() + LONG_S, 0.0
        while True:
            now_s = time.monotonic()
            assert now_s < ends_s, (self.mode, self.armed)
            if self.rover is not None and now_s - said_s > 0.5:
                said_s = now_s
                if beats:
                    self.send(self.encoder.frame(heartbeat()))
                if again is not None:
                    self.send(self.encoder.frame(again))
            try:
                data, self.rover = self._udp.recvfrom(2_048)
            except TimeoutError:
                continue
            if self.loses and self._chance.random() < 0.3:
                continue
            message = self._decoder.decode(bytearray(data))
            if message.get_type() == "HEARTBEAT":
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & common.MAV_MODE_FLAG_SAFETY_ARMED)
            if holds(message):
                return

    def reaches(self, number: int, armed: bool, again: Message = None, *, beats: bool = True) -> None:
        """Wait until the rover is in a mode."""
        self.until(lambda _: (self.mode, self.armed) == (number, armed), again, beats=beats)


@contextmanager
def running(folder: Path, udp: socket.socket) -> Iterator[subprocess.Popen[str]]:
    text = (SHIPPED / "sim.toml").read_text(encoding="utf-8")
    (folder / "rover.toml").write_text(text + SETTINGS, encoding="utf-8")
    folder.chmod(0o700)
    environment = {**os.environ, "RUNTIME_DIRECTORY": str(folder), "STATE_DIRECTORY": str(folder)}
    command = [
        sys.executable, "-m", "wayfarer", "run", "--sim", "--rover", str(folder / "rover.toml"),
        "--mavlink", f"udpout:127.0.0.1:{udp.getsockname()[1]}", "--log-dir", str(folder / "logs"),
    ]  # fmt: skip
    with child(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        yield process


def lateness_s(records: list[dict[str, Any]], since_s: float, until_s: float) -> list[float]:
    """How much later than 20 times per second the ticks came, between two wall times."""
    ticks = [each["t_s"] for each in records if each["record"] == "tick" and since_s < each["t_wall"] < until_s]
    return [after - before - 0.05 for before, after in pairwise(ticks)]


def test_station_stops_under_loss_and_hostile_packets_start_nothing(tmp_path: Path) -> None:
    control = tmp_path / "control.sock"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        udp.settimeout(0.1)
        station = Station(udp)
        with running(tmp_path, udp) as daemon:
            station.reaches(MODE_HOLD, armed=False)
            station.until(lambda each: each.get_type() == "ATTITUDE")  # it knows its heading
            began_s = time.time()
            _attack(station)
            ended_s = time.time()
            station.reaches(MODE_HOLD, armed=False)
            ask({"do": "arm", "heading_deg": 0.0}, control)
            station.reaches(MODE_AUTO, armed=True)
            station.reaches(MODE_HOLD, armed=True, again=mode(MODE_HOLD))
            for _ in range(10):
                station.send(station.encoder.frame(mode(MODE_AUTO)))
            station.until(lambda each: each.get_type() == "COMMAND_ACK" and each.result == common.MAV_RESULT_DENIED,
                          again=mode(MODE_AUTO))  # fmt: skip
            assert ask({"do": "status"}, control)["held"]
            ask({"do": "resume"}, control)
            station.reaches(MODE_AUTO, armed=True)
            station.reaches(MODE_HOLD, armed=True, beats=False)  # 3 s of silence: it holds
            station.reaches(MODE_HOLD, armed=False, again=arming(0.0))
            daemon.terminate()
            assert daemon.wait(10.0) == 0, daemon.stderr
    (path,) = (tmp_path / "logs").glob("*/run.00001.jsonl")
    records = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    assert median(lateness_s(records, began_s, ended_s)) < 0.01
    attacked = [each for each in records if each["record"] == "tick" and began_s < each["t_wall"] < ended_s]
    assert not any(each["applied_left"] or each["applied_right"] for each in attacked)
    events = [each for each in records if each["record"] == "event"]
    assert [each["name"] for each in events].count("armed") == 1
    assert "The link is lost: the ground station is silent: held" in [
        each["text"] for each in events if each["name"] == "link_lost"
    ]
    assert not any(each["name"] == "mark" for each in events), "which would keep the run for ever"


def _attack(station: Station) -> None:
    """Send from the station's own address all that could start something, between random bytes."""
    chance, orders = random.Random(1), starts()
    station.loses = False
    for number in range(HOSTILE):
        frame = station.encoder.frame(heartbeat() if number % 100 == 0 else chance.choice(orders))
        station.send(chance.randbytes(200) if number % 3 == 0 else frame)
        if number % 10 == 0:
            time.sleep(0.005)  # or the kernel drops most of them
    station.loses = True

"""A bench and a daemon over it, each a separate process: where a fault of the process happens for real.

The bench (``hil_server.py``) holds the chips of one rover in a clearing, where the rover drives ahead until the
test does something to it, and writes down what its wheels were told and when. It counts time as the
daemon does, so its times compare with those in the daemon's log.
"""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from tests.kit.logs import read_log
from tests.system import forks
from tests.system.forks import IMPORTS
from tests.system.hil_buses import SOCKET_VARIABLE, HilConnection, HilI2C, HilSerial
from tests.system.measures import Commands, now_s, stop_after
from tests.system.subprocesses import HARDWARE_PRIORITY, WAYFARER, command, put_first, starting
from wayfarer.config.rover_file import rover_text
from wayfarer.daemon.socket.client import ask
from wayfarer.daemon.socket.paths import SOCKET_NAME
from wayfarer.drivers.sabertooth import packet
from wayfarer.errors import WayfarerError
from wayfarer.fieldlog.folders import run_folders

DEADMAN_S = {"minirover": 0.25, "forestrover": 0.3}  # ThunderBorg, and what forestrover.toml sets its Sabertooth to
PATIENCE_S = 60.0  # costs time in a failure only
POLL_S = 0.02
LOOKED_S = 0.4  # longer than any deadman
MARGIN_S = 0.02  # between the two writes of one drive command
STARTS = 3
BUSY = re.compile(
    "a transfer did not (begin|end) within|an earlier transfer still hangs"
)  # what a late transfer is told as
DRIVES_M_S = 0.05
KEY_S = 0.05  # between two samples of a key that is held
LET_GO = 5  # samples, before a key is pressed
UNPROVED = 'deadman_unproved_because = "its board is simulated"'
FLOW = '[parts.motion]\ndriver = "pmw3901"\nbus = "/dev/spidev0.1"\n\n'

T = TypeVar("T")


class HilSetupError(WayfarerError):
    """What a trial needs did not come about: mostly a computer that is too busy."""


def wait_for(what: str, holds: Callable[[], T | None], patience_s: float = PATIENCE_S) -> T:
    """Poll until something holds, and return it.

    Raises:
        HilSetupError: it does not within ``patience_s``.
    """
    ends_s = now_s() + patience_s
    while not (found := holds()):
        if now_s() > ends_s:
            raise HilSetupError(f"after {patience_s:g} s not yet: {what}")
        time.sleep(POLL_S)
    return found


def rover_toml(rover: str) -> str:
    """Return the file of a rover, shipped or not, for the bench.

    It starts at once, sees with a chip instead of a camera, and has a deadman that nobody has watched.
    """
    text = re.sub(r"start_delay_s = [\d.]+", f"start_delay_s = 0.0\n{UNPROVED}", rover_text(rover))
    text = re.sub(r"\[parts\.motion\].*?(?=\[parts\.motors\])", FLOW, text, flags=re.DOTALL)
    return 'buses = "tests.system.hil_buses:buses"\n' + text


@contextmanager
def running_bench() -> Iterator[Path]:
    """Give the socket of a bench, at which any user may ask, for one site after the other: it takes a second to start.

    Raises:
        HilSetupError: it does not start.
    """
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:
        Path(folder).chmod(0o711)
        path = Path(folder) / "bench"
        server = (sys.executable, "-m", "tests.system.hil_server", "--rover", "forestrover", "--socket", path)
        with starting():
            process = subprocess.Popen(server, env=os.environ | IMPORTS, stdout=subprocess.PIPE)
        with process:
            try:
                assert process.stdout is not None
                if not process.stdout.readline():  # it says where it listens
                    raise HilSetupError("the bench ended")
                path.chmod(0o666)
                put_first(process.pid, HARDWARE_PRIORITY)
                yield path
            finally:
                process.kill()


class Site:
    """A folder with a bench's chips and, at times, a daemon.

    Args:
        folder: of its own, and short: a socket's path has 107 bytes at most.
        rover: ``forestrover``, ``minirover``, or a rover file.
        bench: the socket of a bench that serves no other site meanwhile.
    """

    def __init__(self, folder: Path, rover: str, bench: Path) -> None:
        self.folder, self.rover = folder, rover
        self.deadman_s = DEADMAN_S.get(rover, 0.0)
        self.logs, self.socket = folder / "logs", folder / SOCKET_NAME
        self.config = folder / "rover.toml"
        self.config.write_text(rover_toml(rover), encoding="utf-8")
        self.environment = os.environ | {
            **IMPORTS,
            SOCKET_VARIABLE: str(bench),
            "RUNTIME_DIRECTORY": str(folder),
            "STATE_DIRECTORY": str(folder),
            "HOME": str(folder),
            "XDG_STATE_HOME": str(folder),
        }
        self.uid = os.getuid()  # whose the daemon is
        self.processes: list[subprocess.Popen[bytes]] = []
        self.bench_socket = bench
        self._line = HilConnection(str(bench))
        self.bench("begin", rover=str(self.config))

    def start(self, *command: str | Path) -> subprocess.Popen[bytes]:
        """Start a process of this site."""
        with (self.folder / "output.txt").open("ab") as output, starting():
            process = forks.start([*map(str, command)], self.environment, self.folder, output.fileno())
        self.processes.append(process)
        return process

    def end(self) -> None:
        """End all processes."""
        self._line.close()
        for process in reversed(self.processes):
            process.kill()
            process.wait()

    # -- the bench -------------------------------------------------------------------------------------------------

    def bench(self, do: str, **details: object) -> dict[str, Any]:
        """Ask the bench itself; see ``hil_server.py``."""
        return self._line.ask(do, **details)

    @property
    def turning(self) -> bool:
        """Whether any wheel is told to turn."""
        return any(self.bench("look", since_s=now_s())["commanded"])

    @property
    def drives(self) -> bool:
        """Whether the wheels of both sides turn ahead."""
        left_m_s, right_m_s = self.bench("look", since_s=now_s())["wheels_m_s"]
        return bool(min(left_m_s, right_m_s) > DRIVES_M_S)

    def drives_on(self) -> None:
        """Assert that the rover is still armed, and drives as soon as no hold keeps it."""
        wait_for("the rover drives on", lambda: self.drives or self.status()["mode"] == "disarmed")
        status = self.status()
        assert status["mode"] == "armed", status

    def commands(self, since_s: float = 0.0) -> Commands:
        """Return what the wheels were told since then."""
        told: Commands = self.bench("look", since_s=since_s)["commands"]
        return told

    def stopped(self) -> Commands:
        """Return what the wheels were told until they stood still, and stayed so for longer than any deadman.

        Raises:
            HilSetupError: they do not stand still.
        """
        wait_for("the wheels stay stopped", lambda: not self.turning)
        time.sleep(LOOKED_S)
        if self.turning:
            raise HilSetupError("the wheels turn again")
        return self.commands()

    def stopped_by_daemon_s(self, since_s: float = 0.0) -> float:
        """Return when the wheels were stopped for good, and assert that the deadman did not do it.

        Args:
            since_s: what they were told before is left out.
        """
        self.stopped()
        turned_s, stopped_s = stop_after(self.commands(since_s))
        assert stopped_s - turned_s < self.deadman_s - MARGIN_S, "the deadman did it"
        return stopped_s

    # -- the daemon --------------------------------------------------------------------------------------------------

    def launch(self, *options: str, program: Sequence[str] = WAYFARER) -> subprocess.Popen[bytes]:
        """Start a daemon and do not wait for it.

        Args:
            options: of ``wayfarer run``.
            program: what stands for ``wayfarer``.
        """
        return self.start(*program, "run", "--rover", self.config, "--log-dir", self.logs, *options)

    def daemon(self, *options: str, program: Sequence[str] = WAYFARER) -> subprocess.Popen[bytes]:
        """Return a daemon that sees; arguments as ``launch``.

        On a busy computer the bench may be too slow for it: then another one.

        Raises:
            HilSetupError: it ends instead; with what it said.
        """
        for _ in range(STARTS):
            process = self.launch(*options, program=program)
            wait_for("the daemon sees, or has ended", lambda: self.sees() or self.processes[-1].poll() is not None)
            if process.poll() is None:
                put_first(process.pid)
                return process
            if not BUSY.search(self.said()):
                break
        raise HilSetupError(f"the daemon ended: {self.said()}")

    def armed(self, *options: str, program: Sequence[str] = WAYFARER) -> subprocess.Popen[bytes]:
        """Return a daemon whose rover drives; arguments as ``launch``.

        Raises:
            HilSetupError: it does not.
        """
        process = self.daemon(*options, program=program)
        self.ask("arm", heading_deg=0.0)
        wait_for("the wheels turn", lambda: self.drives)
        return process

    @contextmanager
    def driven_by_hand(self) -> Iterator[subprocess.Popen[bytes]]:
        """Give a daemon whose rover a person drives, who holds the key until the end, whatever the daemon answers.

        Raises:
            HilSetupError: it does not drive.
        """
        process = self.daemon("--manual")
        lease = self.ask("manual_begin", driver="keys")["lease"]
        over = threading.Event()

        def press() -> None:
            for seq in itertools.count(1):
                pressed = {"seq": seq, "forward": 0.5 if seq > LET_GO else 0.0, "turn": 0.0, "sent_s": now_s()}
                with suppress(WayfarerError):
                    ask({"do": "manual_drive", "lease": lease, **pressed}, self.socket, timeout_s=KEY_S)
                if over.wait(KEY_S):
                    return

        pressing = threading.Thread(target=press)
        pressing.start()
        try:
            wait_for("the wheels turn", lambda: self.drives)
            yield process
        finally:
            over.set()
            pressing.join()

    def ask(self, do: str, **details: object) -> dict[str, Any]:
        """Ask the daemon, as the user whose daemon it is; raises as ``socket.client.ask``."""
        os.seteuid(self.uid)
        try:
            return ask({"do": do, **details}, self.socket)
        finally:
            os.seteuid(os.getuid())

    def status(self) -> dict[str, Any]:
        """Return what the daemon says of itself; raises as ``socket.client.ask``."""
        return self.ask("status")

    def sees(self) -> bool:
        """Return whether a daemon is there and reads its compass."""
        try:
            return self.status().get("heading_deg") is not None
        except WayfarerError:  # not up yet
            return False

    def said(self) -> str:
        """Return what all processes said on their terminals."""
        return (self.folder / "output.txt").read_text(encoding="utf-8", errors="replace")

    def log(self) -> list[dict[str, Any]]:
        """Return the records of the newest run."""
        return read_log(run_folders(self.logs)[-1])

    def ticks_beyond(self, t_s: float) -> list[float]:
        """Return the times of the newest run's control ticks, as soon as there is one after this time.

        Raises:
            HilSetupError: none comes.
        """

        def known() -> list[float] | None:
            times_s = [record["t_s"] for record in self.log() if record["record"] == "tick"]
            return times_s if times_s and times_s[-1] > t_s else None

        return wait_for("a tick in the log", known)

    def told(self, name: str) -> dict[str, Any]:
        """Return the newest run's first event of this name, as soon as it is there.

        Raises:
            HilSetupError: it does not come.
        """
        return wait_for(
            f"the event '{name}'", lambda: next((record for record in self.log() if record.get("name") == name), None)
        )

    def turn_wheels(self) -> None:
        """Do what another program might: no deadman, and wheels that turn for ever.

        To a ThunderBorg: failsafe off, both sides ahead (its commands 19, 8 and 11); to a Sabertooth: both ahead.
        """
        path = str(self.bench_socket)
        if self.rover == "minirover":
            bus = HilI2C(path, "/dev/i2c-1")
            for command in ((19, 0), (8, 100), (11, 100)):
                bus.write(0x15, bytes(command))
            bus.close()
        else:
            port = HilSerial(path, "/dev/ttyAMA0")
            port.write(packet(128, 0, 60) + packet(128, 4, 60))
            port.close()

    def run(
        self, *arguments: str | Path, program: Sequence[str] = WAYFARER, **options: Any
    ) -> subprocess.CompletedProcess[str]:
        """Run a wayfarer command at this site to its end; arguments as ``command``."""
        return command(*arguments, program=program, env=self.environment, cwd=self.folder, **options)


@contextmanager
def hil_site(bench: Path, rover: str = "forestrover") -> Iterator[Site]:
    """Give a site in a folder of its own, and clear it away; ``bench`` as for ``Site``."""
    folder = Path(tempfile.mkdtemp(prefix="wf-"))
    try:
        made = Site(folder, rover, bench)
        try:
            yield made
        finally:
            made.end()
    finally:
        shutil.rmtree(folder, ignore_errors=True)

"""Python programs that start in a moment: forked from a process that has imported what a daemon imports.

To import it takes half a second of a core, and a hundred tests start a daemon. What is forked is a child of the tests'
process like any other: it was an orphan for a moment, and fell to them.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path

import msgspec

CHECKOUT = Path(__file__).resolve().parents[2]
# For ``tests``, whose buses a rover file names.
IMPORTS = {"PYTHONPATH": os.pathsep.join(filter(None, (str(CHECKOUT), os.environ.get("PYTHONPATH"))))}
# They import the others. Not numpy: it starts threads, which no fork survives, and a rover's daemon does without.
MODULES = (
    "tests.system.hil_buses", "wayfarer.cli", "wayfarer.commissioning.checks.api", "wayfarer.daemon.daemon",
    "wayfarer.logview.narrator", "wayfarer.remote.live.server",
)  # fmt: skip
SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of prctl(2)
MOST_BYTES = 150_000  # of a request; a socket takes no more than 200,000


class Forked(subprocess.Popen[bytes]):
    """A child that another process has made for this one."""

    def __init__(self, command: Sequence[str], pid: int) -> None:
        self.args, self.pid, self.returncode = command, pid, None
        self.stdin = self.stdout = self.stderr = None
        self._child_created, self._waitpid_lock, self._sigint_wait_secs = True, threading.Lock(), 0.25


@cache
def _server() -> socket.socket:
    """Start the process that forks; it ends with this one, which holds the other end of its line."""
    ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    serves = f"from {__name__} import serve; exec(serve({its.fileno()}), {{'__name__': '__main__'}})"
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(
        [sys.executable, "-c", serves], env=os.environ | IMPORTS, pass_fds=[its.fileno()], stdin=quiet, stdout=quiet
    )
    process.returncode = 0  # nobody waits for it
    its.close()
    atexit.register(ours.close)
    return ours


def start(command: Sequence[str], environment: Mapping[str, str], folder: Path, output: int) -> subprocess.Popen[bytes]:
    """Start a command whose output goes to a descriptor; Python code (``python -c``) is forked.

    Args:
        command: program and arguments.
        environment: of the process.
        folder: where it runs.
        output: an open descriptor.
    """
    if command[:2] != [sys.executable, "-c"]:
        return subprocess.Popen(command, env=environment, stdout=output, stderr=output, cwd=folder)
    line, prctl = _server(), ctypes.CDLL(None).prctl
    request = [command[2], command[3:], dict(environment), str(folder)]
    prctl(SUBREAPER, 1, 0, 0, 0)
    try:
        socket.send_fds(line, [msgspec.json.encode(request)], [output])
        pid = int(line.recv(100))
        line.recv(100)  # its parent is gone
    finally:
        prctl(SUBREAPER, 0, 0, 0, 0)
    return Forked(command, pid)


def serve(descriptor: int) -> str:
    """Fork whenever a line asks for it; return only in what was forked, with the code that it is to run.

    Raises:
        SystemExit: nobody can ask any more.
    """
    for name in MODULES:
        import_module(name)
    assert threading.active_count() == 1
    gc.freeze()
    line = socket.socket(fileno=descriptor)
    while True:
        text, descriptors, _, _ = socket.recv_fds(line, MOST_BYTES, 1)
        if not descriptors:
            raise SystemExit
        (output,) = descriptors
        if (parent := os.fork()) == 0:
            if (pid := os.fork()) == 0:
                line.close()
                return _become(*msgspec.json.decode(text), output=output)
            line.send(str(pid).encode())
            os._exit(0)
        os.waitpid(parent, 0)
        os.close(output)
        line.send(b"gone")


def _become(code: str, arguments: list[str], environment: dict[str, str], folder: str, *, output: int) -> str:
    """Take the place of a process that was started with these."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    os.dup2(output, 1)
    os.dup2(output, 2)
    os.close(output)
    sys.argv = ["-c", *arguments]
    return code

"""A /dev of a test's own, in a mount namespace: device files that the real libraries open, answered by a bench.

The I2C and SPI files are nodes of /dev/null, so that opening, looking at and locking them is the kernel's own; what
``ioctl`` does to them is ``ioctl_shim.c``'s. A serial port is a pty. Mounts are gone with the process that holds them.
"""

from __future__ import annotations

import json
import os
import pty
import select
import shutil
import socket
import stat
import subprocess
import termios
import threading
import tty
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tests.system.hil_buses import HilSerial
from tests.system.nspawn import in_own_mounts
from tests.system.subprocesses import HARDWARE_PRIORITY, put_thread_first
from tests.thread_guard import SHARED

SHIM = Path(__file__).with_name("ioctl_shim.c")
NULL = os.makedev(1, 3)
POLL_S = 0.05
MOUNT = """
set -eu
mount -t tmpfs -o mode=0755 tmpfs "$1"
for name in null zero full random urandom tty; do cp -a "/dev/$name" "$1/"; done
mkdir "$1/pts" "$1/shm"
mount --bind /dev/pts "$1/pts"
mount --move "$1" /dev
echo mounted
exec cat
"""


class NoMounts(Exception):
    """This computer does not let a test mount anything."""


def why_not() -> str | None:
    """Say why there can be no such /dev here, or None if there can be."""
    if os.geteuid() != 0:
        return "a private /dev needs root"
    missing = [name for name in ("cc", "unshare", "nsenter") if shutil.which(name) is None]
    return f"a private /dev needs {missing[0]}: apt-get install gcc libc6-dev util-linux" if missing else None


def compiled_shim(folder: Path) -> Path:
    """Return the shim, compiled."""
    made = folder / "ioctl_shim.so"
    subprocess.run(["cc", "-Wall", "-Wextra", "-Werror", "-O1", "-shared", "-fPIC", "-o", made, SHIM], check=True)
    return made


class PrivateDev:
    """A /dev; ``enter`` begins the command of a process that sees it.

    Args:
        folder: an empty one, to mount on.

    Raises:
        NoMounts: it cannot be mounted.
    """

    def __init__(self, folder: Path) -> None:
        self._holder = subprocess.Popen(
            in_own_mounts(MOUNT, folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert self._holder.stdout is not None
        if self._holder.stdout.readline() != b"mounted\n":
            raise NoMounts(self._holder.communicate()[1].decode().strip())
        self.enter = ("nsenter", f"--mount=/proc/{self._holder.pid}/ns/mnt", "--")

    def _path(self, device: str) -> Path:
        return Path(f"/proc/{self._holder.pid}/root{device}")

    def plug(self, device: str) -> None:
        """Make a device file whose ``ioctl`` is the shim's."""
        os.mknod(self._path(device), stat.S_IFCHR | 0o600, NULL)

    def link(self, device: str, to: str) -> None:
        """Make a link to a device file."""
        self._path(device).parent.mkdir(parents=True, exist_ok=True)
        self._path(device).symlink_to(to)

    def unplug(self, device: str) -> None:
        """Take a device file, or a link, away."""
        self._path(device).unlink()

    def close(self) -> None:
        """Unmount, as soon as nobody is inside any more."""
        self._holder.communicate()


class SerialLine:
    """A serial line: the pty at ``path``, and a thread that carries bytes between it and a port of a bench."""

    def __init__(self, bench: Path, port: str) -> None:
        self._far, self._near = pty.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)
        self._unplugged = threading.Event()
        self._thread = threading.Thread(
            target=self._carry, args=(HilSerial(str(bench), port),), name=f"{SHARED} serial line"
        )
        self._thread.start()

    def _carry(self, to: HilSerial) -> None:
        put_thread_first(0, HARDWARE_PRIORITY)
        while not self._unplugged.is_set():
            if select.select([self._far], [], [], POLL_S)[0]:
                to.write(os.read(self._far, 1024))
                os.write(self._far, to.read(1024))
        to.close()

    def block(self) -> None:
        """Let nothing through, as a line does whose flow control says stop: writing blocks."""
        termios.tcflow(self._near, termios.TCOOFF)

    def unblock(self) -> None:
        """Let it through again."""
        termios.tcflow(self._near, termios.TCOON)

    def unplug(self) -> None:
        """Hang up, for good: who has it open gets errors."""
        self._unplugged.set()
        self._thread.join()
        os.close(self._far)
        os.close(self._near)


class Recorder:
    """Stands for a bench while it is entered: keeps the requests, and answers each with the bytes 1, 2, 3 ..."""

    def __init__(self, path: Path) -> None:
        self.requests: list[dict[str, Any]] = []
        path.unlink(missing_ok=True)  # of the same test, which is run again
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
            except OSError:  # shut down
                return
            with client, client.makefile("rwb") as lines:
                request = json.loads(lines.readline())
                self.requests.append(request)
                count = request.get("count", sum(len(piece) // 2 for piece in request["data"]))
                lines.write(json.dumps({"data": [bytes(range(1, count + 1)).hex()]}, separators=(",", ":")).encode())
                lines.write(b"\n")

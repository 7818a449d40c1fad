"""A read-only Foxglove WebSocket server for a running rover, in a process beside the daemon."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from select import select

import orjson

from wayfarer.daemon.socket.protocol import Commands
from wayfarer.errors import BadInput, WayfarerError
from wayfarer.fieldlog.schema import Record
from wayfarer.views.foxglove import HOST

SERVER = "wayfarer.views.foxglove.server"
UNSENT_BYTES = 1 << 20  # 20 s of a run that drives, for a process that gets no time on a busy computer
START_S = 15.0  # of no source: half of the 30 s in which the service must be ready
END_S = 0.5  # of the 2 s in which a run must end


class FoxgloveLive:
    """Shows a run to Foxglove; implements ``daemon.daemon.Viewer``.

    Whatever clients do, the daemon only writes lines into a pipe, and drops what does not fit; ``server`` says why.

    Args:
        port: 0 takes a free one.

    Raises:
        BadInput: it cannot listen there; the text says why.
        WayfarerError: the process did not start.
    """

    def __init__(self, port: int) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", SERVER, str(port)],  # -P: nothing is imported from the working folder
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # Ctrl-C is for the daemon
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe = self._process.stdin
        with self._process.stdout as said:
            answered, _, _ = select([said], [], [], START_S)
            answer = said.readline().decode().strip() if answered else ""
        if not answer.isdecimal():
            self.close()
            raise BadInput(answer) if answer else WayfarerError("Foxglove's server did not start: see what it said")
        os.set_blocking(self._pipe.fileno(), False)
        self._unsent = bytearray()
        self.url = f"ws://{HOST}:{answer}"

    def show(self, record: Record) -> None:
        """Send a record to the process, as far as the pipe takes it.

        Raises:
            WayfarerError: the process has ended.
        """
        if self._pipe.closed:
            return  # a record after the end
        if len(self._unsent) < UNSENT_BYTES:
            self._unsent += orjson.dumps(record) + b"\n"
        try:
            del self._unsent[: self._pipe.write(self._unsent) or 0]
        except BrokenPipeError:
            raise WayfarerError("the process that serves Foxglove has ended") from None

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:  # noqa: ARG002
        """End the process in the end."""
        try:
            yield
        finally:
            await asyncio.to_thread(self.close)

    def close(self) -> None:
        """End the process: it ends by itself when its records do, and is killed if it does not. Safe twice."""
        self._pipe.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

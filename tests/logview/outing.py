"""A short outing of the simulated rover under its real daemon, with everything that a person can ask of it.

``python -m tests.logview.outing`` makes the sample run in ``field_logs`` again.
"""

# ruff: noqa: ASYNC110 - a daemon lives in real time, and is polled
from __future__ import annotations

import asyncio
import shutil
import tempfile
from pathlib import Path
from typing import Any

from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.daemon import Daemon, Service
from wayfarer.daemon.socket.client import ask
from wayfarer.escape.catalogue import CATALOGUE
from wayfarer.run_sim import simulated_rover_setup
from wayfarer.simhal.world.physics import Depth

SEED = 4  # soon in the thick of it
SAMPLE_S = 12.0
SAMPLE_LOGS = Path("field_logs")


async def outing(logs: Path, drive_s: float) -> None:
    """Drive for so many seconds, then mark, hold, resume, change the goal, disarm and stop."""

    config = load_rover("sim")
    with tempfile.TemporaryDirectory(prefix="wf-") as folder:  # a socket's path must be short
        socket = Path(folder) / "control.sock"
        service = Service(
            config=config,
            algorithm=CATALOGUE["forest-pledge"],
            seed=SEED,
            make_rover=lambda finish: simulated_rover_setup(config, Depth.DEVICE, SEED, finish),
            logs=logs,
            socket=socket,
            simulated=True,
            dry_run=False,
        )

        async def request(do: str, **keys: Any) -> dict[str, Any]:
            return await asyncio.to_thread(ask, {"do": do, **keys}, socket)

        run = asyncio.create_task(Daemon(service).run())
        while not socket.exists() or "heading_deg" not in await request("status"):
            await asyncio.sleep(0.05)
        await request("arm", heading_deg=20.0)
        await asyncio.sleep(drive_s)
        await request("mark", text="hit log")
        for do in ("hold", "resume"):
            await request(do)
            await asyncio.sleep(0.5)
        await request("goal", heading_deg=40.0)
        await asyncio.sleep(0.2)
        await request("disarm")
        await asyncio.sleep(0.2)
        await request("stop")
        await run


if __name__ == "__main__":
    for old in SAMPLE_LOGS.glob("0*"):
        shutil.rmtree(old)
    asyncio.run(outing(SAMPLE_LOGS, SAMPLE_S))

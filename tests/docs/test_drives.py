"""The drives of the tutorial, as a reader does them: a daemon in one terminal, commands in another."""

from __future__ import annotations

import asyncio
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.children import child
from tests.commissioning import computers
from tests.conftest import Run
from tests.docs import transcripts
from tests.docs.pages import ROOT, Fence, fences
from tests.docs.transcripts import Shown, difference, printed, shown
from tests.loop_guard import WatchedVirtualLoop
from tests.system.hil_setup import HilSetupError, wait_for
from tests.system.subprocesses import put_first, starting
from wayfarer.cli import init
from wayfarer.commissioning.first_rover import Inventory, first_rover_file
from wayfarer.daemon.socket.paths import SOCKET_NAME
from wayfarer.drivers.gpsd import Gpsd
from wayfarer.errors import NotResponding

pytestmark = pytest.mark.process
SHOWN_WITHIN_S = 30.0  # on a busy computer; the rover reaches the first trunk after 5 s
OWN_ROVER = "docs/tutorial/my-own-rover.md"


def compared_here(page: str) -> list[Fence]:
    return [fence for fence in fences(page) if fence.compared_by == "tests/docs/test_drives.py"]


class Terminals:
    """The reader's two terminals, in a folder of his own: one with a daemon, one for commands."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = transcripts.environment(folder) | {"PYTHONPATH": "examples"}
        (folder / "examples").symlink_to(ROOT / "examples")
        self._said = folder / "daemon.txt"

    def play(self, blocks: list[list[Shown]]) -> None:
        """Run the commands of some blocks in their order, the daemon's first, and compare what both terminals show."""
        daemon, *others = blocks
        ((command, output),) = daemon
        options: dict[str, Any] = {"cwd": self.folder, "env": self.environment, "stderr": subprocess.STDOUT}
        with self._said.open("wb") as said, child(command.split(), stdout=said, **options) as process:
            put_first(process.pid)
            wait_for("the daemon listens", lambda: (self.folder / SOCKET_NAME).exists())
            self._wait_for(output)
            for block in others:
                if block[0].command:
                    self.compare(block)
                else:
                    output += block[0].output
                    self._wait_for(output)
            assert process.wait(20) == 0

    def compare(self, block: list[Shown]) -> None:
        """Run the commands of a block, and compare what they print."""
        with starting():
            terminals = printed([each.command for each in block], self.folder, self.environment)
        for each, terminal in zip(block, terminals, strict=True):
            stale = difference(each.output, terminal, self.folder, in_real_time=True)
            assert not stale, f"{each.command} prints something else:\n{stale}"

    def _wait_for(self, output: str) -> None:
        def stale() -> str:
            return difference(output, self._said.read_text(encoding="utf-8"), self.folder, in_real_time=True)

        try:
            wait_for("the daemon's terminal shows what the page does", lambda: not stale() or None, SHOWN_WITHIN_S)
        except HilSetupError:
            pytest.fail(f"the daemon's terminal shows something else:\n{stale()}")


def test_first_drive_is_five_commands(tmp_path: Path) -> None:
    blocks = [shown(fence) for fence in compared_here("docs/tutorial/first-drive.md")]
    words = [each.command.split()[1] for block in blocks for each in block if each.command]
    assert words == ["run", "arm", "status", "stop", "report"]
    Terminals(tmp_path).play(blocks)
    assert list(tmp_path.glob("field_logs/*/*.html"))


def test_own_rover_is_checked_and_drives_on_simulated_chips(tmp_path: Path) -> None:
    """As the page says, but for the ten seconds in which a person steps away."""
    text = first_rover_file("my-rover", "forestrover", Inventory())
    (tmp_path / "my-rover.toml").write_text(
        text.replace("start_delay_s = 10.0", "start_delay_s = 0.0"), encoding="utf-8"
    )
    terminals = Terminals(tmp_path)
    check, *drive, _ = [shown(fence) for fence in compared_here(OWN_ROVER)]
    assert check[-1].command.startswith("wayfarer check")
    terminals.compare(check)
    terminals.play(drive)


@pytest.fixture
def runner() -> Iterator[asyncio.Runner]:
    with asyncio.Runner(loop_factory=WatchedVirtualLoop) as runner:
        yield runner


def test_first_look_at_a_rover_is_shown(
    tmp_path: Path, runner: asyncio.Runner, run: Run, own_folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its parts are simulated chips; this computer's buses and its gpsd are none of the page's."""

    async def identify(driver: Gpsd) -> None:
        raise NotResponding(driver.name)

    monkeypatch.setattr(Gpsd, "identify", identify)
    monkeypatch.setattr(init, "_look", computers.forestrover(tmp_path, runner).look)
    monkeypatch.chdir(own_folders)
    ((command, output),) = shown(compared_here(OWN_ROVER)[-1])
    code, out, errors = run(*command.split()[1:])
    assert (code, difference(output, out + errors, own_folders)) == (0, "")

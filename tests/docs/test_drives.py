"""The drives of the tutorial, as a reader does them: a daemon in one terminal, commands in another."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from tests.children import child
from tests.docs.pages import ROOT, fences, shell_lines, wayfarer_words
from tests.system.hil_setup import wait_for
from tests.system.subprocesses import WAYFARER, command, put_first
from wayfarer.commissioning.first_rover import Inventory, first_rover_file
from wayfarer.daemon.socket.paths import SOCKET_NAME

pytestmark = pytest.mark.process


@pytest.fixture
def terminal(tmp_path: Path) -> dict[str, str]:
    """The environment of a reader who works in a folder of his own."""
    own = {"RUNTIME_DIRECTORY": str(tmp_path), "STATE_DIRECTORY": str(tmp_path), "HOME": str(tmp_path)}
    return {**os.environ, **own, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "examples")])}


def drive_commands(page: str) -> list[list[str]]:
    """Return the commands of a page's drive in their order, the daemon's first."""
    marked = [fence for fence in fences(page) if fence.why_not and "test_drives.py" in fence.why_not]
    return [words for fence in marked for line in shell_lines(fence) for words in wayfarer_words(line)]


def drive(commands: list[list[str]], folder: Path, environment: dict[str, str]) -> str:
    """Run the first command in the background and the others after it; return what was printed."""
    daemon, *others = commands
    printed = ""
    with child([*WAYFARER, *daemon], cwd=folder, env=environment, stdout=subprocess.DEVNULL) as process:
        put_first(process.pid)
        wait_for("the daemon listens", lambda: (folder / SOCKET_NAME).exists())
        for words in others:
            done = command(*words, cwd=folder, env=environment)
            assert done.returncode == 0, f"{words}: {done.stderr}"
            printed += done.stdout
        assert process.wait(20) == 0
    return printed


def test_first_drive_is_five_commands(tmp_path: Path, terminal: dict[str, str]) -> None:
    commands = drive_commands("docs/tutorial/first-drive.md")
    assert [words[0] for words in commands] == ["run", "arm", "status", "stop", "report"]
    printed = drive(commands, tmp_path, terminal)
    assert re.search(r"arm(ed|ing) \(simulated\)", printed)
    assert list(tmp_path.glob("field_logs/*/*.html"))


def test_own_rover_is_checked_and_drives_on_simulated_chips(tmp_path: Path, terminal: dict[str, str]) -> None:
    """As the page says, but for the ten seconds in which a person steps away."""
    text = first_rover_file("my-rover", "forestrover", Inventory())
    (tmp_path / "my-rover.toml").write_text(
        text.replace("start_delay_s = 10.0", "start_delay_s = 0.0"), encoding="utf-8"
    )
    page = "docs/tutorial/my-own-rover.md"
    lines = [line for fence in fences(page) for line in shell_lines(fence) if line.startswith(("reason=", "(echo"))]
    subprocess.run(["bash", "-c", "\n".join(lines)], cwd=tmp_path, check=True)
    check, *commands = drive_commands(page)
    assert [words[0] for words in (check, *commands)] == ["check", "run", "arm", "status", "stop"]
    checked = command(*check, cwd=tmp_path, env=terminal, stdin=subprocess.DEVNULL)
    assert (checked.returncode, "ok      compass: heading" in checked.stdout) == (0, True), checked.stderr
    assert re.search(r"my-rover +arm(ed|ing)", drive(commands, tmp_path, terminal))

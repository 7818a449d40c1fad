"""A container or cron, where neither systemd nor logind has made a folder: what the refusal says works as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from tests.system.forks import CHECKOUT
from tests.system.nspawn import in_own_mounts
from tests.system.subprocesses import COMMAND_S

OWN_RUN = 'mount -t tmpfs tmpfs /run && exec sh -c "$1"'


def shell(home: Path, script: str) -> subprocess.CompletedProcess[str]:
    """Run a script on a computer without sessions; ``wayfarer`` is this checkout's."""
    wayfarer = f'wayfarer() {{ "{sys.executable}" -m wayfarer "$@"; }}; cd ~; '
    return subprocess.run(
        in_own_mounts(OWN_RUN, wayfarer + script),
        env={"PATH": os.environ["PATH"], "HOME": str(home), "PYTHONPATH": str(CHECKOUT)},
        capture_output=True, text=True, check=False, timeout=COMMAND_S,
    )  # fmt: skip


@pytest.fixture
def home() -> Iterator[Path]:
    """With a path that is short enough for a socket in it."""
    with TemporaryDirectory(prefix="wf-") as folder:
        yield Path(folder)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can take away /run")
def test_daemon_that_has_no_folder_says_what_to_type_and_that_is_enough(home: Path) -> None:
    refused = shell(home, "wayfarer run --sim")
    assert refused.returncode == 2
    (said,) = refused.stderr.splitlines()
    typed = re.search(r": (mkdir [^;]+; export [^;]+)$", said)
    assert typed is not None, said
    asked = shell(home, "wayfarer status; wayfarer stop")
    assert asked.stderr.count("XDG_RUNTIME_DIR is not set") == 2
    until_it_answers = "for _ in $(seq 50); do wayfarer status >/dev/null 2>&1 && break; sleep 0.2; done; "
    done = shell(
        home,
        f"{typed[1]}; wayfarer run --sim & {until_it_answers} wayfarer status; wayfarer arm 0; wayfarer disarm;"
        " wayfarer stop; wait $!; echo ended $?",
    )
    assert "disarmed: not armed since the start (simulated)" in done.stdout
    assert "arming: the wheels can turn after" in done.stdout
    assert done.stdout.endswith("ended 0\n"), done

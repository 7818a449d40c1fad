"""What bash completes, in a real bash: with the function that ``wayfarer --show-completion`` gives it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.logview.records import HEADER, write
from wayfarer import cli

# Asks bash's own registered function, as readline does when TAB is pressed.
ASK = """
eval "$(wayfarer --show-completion)"
[[ $(complete -p wayfarer) == *"-F _wayfarer_completion wayfarer" ]] || exit 3
while IFS= read -r line; do
    read -ra COMP_WORDS <<< "$line"
    [[ $line == *" " ]] && COMP_WORDS+=("")
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
    COMPREPLY=()
    _wayfarer_completion wayfarer
    echo "${COMPREPLY[*]}"
done
"""
BASH = shutil.which("bash")


@pytest.mark.process
@pytest.mark.skipif(BASH is None, reason="no bash")
def test_bash_completes_commands_runs_algorithms_rovers_and_scenarios(tmp_path: Path) -> None:
    write(tmp_path / "logs" / "00007-20261121T061405Z", [HEADER])
    write(tmp_path / "logs" / "my-trial", [HEADER])
    command = tmp_path / "wayfarer"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from wayfarer.cli import main; main()" "$@"\n')
    command.chmod(0o755)
    wanted = {
        "wayfarer logs su": "summary",
        "wayfarer logs summary --log-dir logs ": "my-trial 7",
        "wayfarer report --log-dir none ": "",
        "wayfarer run --algorithm levy-w": "levy-walk",
        "wayfarer sim --algorithm pledge,levy-": "pledge,levy-pledge pledge,levy-walk",
        "wayfarer run --rover ": "forestrover minirover sim",
        "wayfarer sim --site ext": "extended-maze",
        "wayfarer sim --fault sil": "silent",
        "wayfarer sweep escape.turn_a": "escape.turn_angle_deg=",
    }
    assert BASH is not None
    done = subprocess.run(
        [BASH, "--norc", "-c", ASK], input="".join(f"{line}\n" for line in wanted), cwd=tmp_path,
        capture_output=True, text=True, check=False, env=os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert dict(zip(wanted, done.stdout.splitlines(), strict=True)) == wanted


@pytest.mark.parametrize(("shell", "says"), [("zsh", "#compdef wayfarer"), ("fish", "complete --command wayfarer")])
def test_completion_is_shown_for_the_shell_that_is_named(
    capsys: pytest.CaptureFixture[str], shell: str, says: str
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.run(["--show-completion", shell])
    assert (ended.value.code, capsys.readouterr().out.splitlines()[0][: len(says)]) == (0, says)

"""Rover files that cannot be used, or that change under a daemon."""

# ruff: noqa: TID251 - real processes need real time
from __future__ import annotations

import re
import time
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.system.hil_setup import Site, rover_toml

BAD_INPUT = 2
CRUISE = "cruise_m_s = 0.42"
GENTLER = "cruise_m_s = 0.21"
HUGE_LINE_BYTES = 900_000  # a file may have a million
# What stands in the file instead of the line CRUISE, and what the one line on the terminal must say besides its number.
BAD_LINES = {
    "unknown key": ("cruse_m_s = 0.42", ("escape.cruse_m_s", "did you mean 'cruise_m_s'")),
    "out of range": ("cruise_m_s = -1", ("escape.cruise_m_s", "allowed is")),
    "huge line": ("a" * HUGE_LINE_BYTES, ("not valid TOML",)),
}


@pytest.mark.parametrize(("instead", "wanted"), BAD_LINES.values(), ids=BAD_LINES)
def test_daemon_refuses_a_bad_rover_file_in_one_line(
    run: Run, tmp_path: Path, instead: str, wanted: tuple[str, ...]
) -> None:
    text = rover_toml("forestrover")
    line = text[: text.index(CRUISE)].count("\n") + 1
    config = tmp_path / "rover.toml"
    config.write_text(text.replace(CRUISE, instead), encoding="utf-8")
    code, _, err = run("run", "--rover", config, "--log-dir", tmp_path)
    said = err.strip()
    assert code == BAD_INPUT
    assert said.count("\n") == 0, said[:200]
    assert [part for part in wanted if part not in said] == [], said[:200]
    assert [int(number) for number in re.findall(r"line (\d+)", said)] in ([line], [line + 1])


def test_rover_file_that_is_changed_counts_from_the_next_start_on(site: Site) -> None:
    daemon = site.armed()
    site.config.write_text(site.config.read_text("utf-8").replace(CRUISE, GENTLER), encoding="utf-8")
    time.sleep(1.0)
    before = site.log()[0]
    assert before["config"]["escape"]["cruise_m_s"] == 0.42
    site.drives_on()
    daemon.terminate()
    daemon.wait()
    site.daemon()
    after = site.log()[0]
    assert after["config"]["escape"]["cruise_m_s"] == 0.21
    assert before["config_hash"] != after["config_hash"]

"""``wayfarer sim`` refuses a rover that no trial could be run with, before the first one."""

from __future__ import annotations

from pathlib import Path

import pytest

from wayfarer import cli

BODY = """
name = "test"
[vehicle]
length_m = 0.4
width_m = 0.4
track_m = 0.5
max_speed_m_s = 1.0
"""
COMPASS = '[parts.compass]\ndriver = "cmps14"\n'
THUNDERBORG = '[parts.motors]\ndriver = "thunderborg"\n'
PINS = "left_forward = 17\nleft_backward = 18\nright_forward = 22\nright_backward = 23\n"
UNBUILDABLE = {
    "no motors": (COMPASS, "rover 'test' has no [parts.motors]"),
    "no compass": (THUNDERBORG, "rover 'test' has no [parts.compass]"),
    "no parts": ("", "rover 'test' has no [parts.compass]"),
    "no such chip": (
        COMPASS + '[parts.motors]\ndriver = "gpio_motors"\n' + PINS,
        "no simulated chip for",
    ),
    "two chips at one address": (COMPASS + THUNDERBORG + "address = 0x60\n", "two chips at 0x60"),
}


@pytest.mark.parametrize("options", [["--out", "out"], ["--trial", "0", "--log", "log"]], ids=["all", "alone"])
@pytest.mark.parametrize(("parts", "says"), UNBUILDABLE.values(), ids=UNBUILDABLE)
def test_rover_that_cannot_be_built_is_one_line_before_any_trial(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    parts: str,
    says: str,
    options: list[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("wayfarer.simhal.trial.run_trial", lambda *_: pytest.fail("a trial was run"))
    Path("rover.toml").write_text(BODY + parts, encoding="utf-8")
    code = cli.run(["sim", "--depth", "bus", "--jobs", "1", "--rover", "./rover.toml", *options])
    out, err = capsys.readouterr()
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("wayfarer: ")
    assert says in err
    assert [path.name for path in tmp_path.iterdir()] == ["rover.toml"]


def test_rover_without_parts_can_be_simulated_at_device_depth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rover.toml").write_text(BODY, encoding="utf-8")
    options = ["--trials", "1", "--trial", "0", "--budget-m", "1", "--rover", str(tmp_path / "rover.toml")]
    assert cli.run(["sim", *options]) == 0
    assert "entrapped" in capsys.readouterr().out

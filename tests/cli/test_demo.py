"""``wayfarer demo``, and the options of ``wayfarer run`` for those who look on."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.conftest import Run, refusal
from wayfarer import cli
from wayfarer.cli import demo
from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign
from wayfarer.fieldlog.reader import find_header
from wayfarer.safety.mission import RunEnd

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")


pytestmark = pytest.mark.usefixtures("own_folders")


@pytest.fixture(autouse=True)
def own_place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Keep away from browsers that there may be on this machine."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Stand in for the daemon: keep the service, make its folder, end well."""
    kept = SimpleNamespace()

    def serve(service: Any) -> RunEnd:
        kept.service = service
        for viewer in service.viewers:
            viewer.close()
        return RunEnd("escaped", "the simulated rover has escaped after 76.0 m")

    monkeypatch.setattr("wayfarer.daemon.daemon.serve", serve)
    return kept


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Have the demo end its trial at once, as if somebody had looked on; keep what it was asked for."""
    kept = SimpleNamespace()

    async def run(self: Any, page: Any) -> None:
        page.close()
        self._signal = kept.signal
        self.seen()
        self.run_at(1000.0)
        self._tell_end(await asyncio.to_thread(self.run_trial, lambda _record: None))
        self._lines.close()

    kept.signal = ""
    monkeypatch.setattr("wayfarer.demo.Demo.run", run)
    return kept


def test_demo_says_where_the_page_is_how_it_ended_and_what_to_try_next(shown: SimpleNamespace, run: Run) -> None:
    code, out, _ = run("demo", "--live-port", "0", "--seed", "45")
    assert code == 0
    first, *rest = out.splitlines()
    assert first.startswith("open this page; the rover starts when it is open: http://127.0.0.1:")
    assert "crossed the destination line: 39.1 m driven in 0:00:41" in rest
    assert any("the page stays" in line and "Ctrl-C" in line for line in rest)
    (log,) = (line for line in rest if line.startswith("the field log: "))
    assert Path(log.partition(": ")[2]).is_dir()
    assert any(line.split()[:6] == ["wayfarer", "sim", "--seed", "45", "--trial", "0"] for line in rest)


def test_demo_that_a_signal_ends_does_not_say_that_the_page_stays(shown: SimpleNamespace, run: Run) -> None:
    shown.signal = "SIGTERM"
    code, out, _ = run("demo", "--live-port", "0", "--algorithm", "levy-walk")
    assert code == 0
    assert "ended by SIGTERM: 0.0 m driven in 0:00:00" in out
    assert "the page stays" not in out
    assert "--trial 0 --algorithm levy-walk" in out


def test_demo_shows_the_trial_that_it_is_asked_for_and_keeps_its_log_where_it_is_told(
    shown: SimpleNamespace, tmp_path: Path
) -> None:
    shown.signal = "SIGTERM"
    arguments = ["--seed", "5", "--trial", "17", "--log-dir", str(tmp_path / "kept")]
    assert cli.run(["demo", "--live-port", "0", *arguments]) == 0
    (folder,) = (tmp_path / "kept").iterdir()
    header = find_header(folder)
    assert header is not None
    campaign = Campaign(("forest-pledge",), 18, load_rover("sim"), 5)
    assert (header.trial, header.forest, header.simulated) == (17, 17, True)
    assert header.seed == campaign.trial_seed(17)


def test_browser_is_opened_only_where_it_has_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_window(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr("webbrowser.open", open_window)
    demo.open_page("http://127.0.0.1:1/")
    assert opened == []
    monkeypatch.setenv("DISPLAY", ":0")
    demo.open_page("http://127.0.0.1:1/")
    assert opened == ["http://127.0.0.1:1/"]


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "inf", "1e9"])
def test_speed_that_cannot_be_is_refused(speed: str, run: Run) -> None:
    code, _, err = run("demo", "--speed", speed)
    assert code == 2
    assert "0.1 to 1000" in err


@pytest.mark.parametrize("command", [["demo", "--no-browser"], ["run", "--sim", "--live"]])
def test_port_in_use_is_refused_before_there_is_a_log(
    command: list[str], taken_port: int, tmp_path: Path, run: Run
) -> None:
    said = refusal(run, *command, "--live-port", taken_port, "--log-dir", tmp_path / "logs", exit_code=1)
    assert "--live-port" in said
    assert not (tmp_path / "logs").exists()


def test_run_serves_the_page_where_it_is_told(served: SimpleNamespace, run: Run) -> None:
    code, out, _ = run("run", "--sim", "--live", "--live-host", "0.0.0.0", "--live-port", "0")
    assert code == 0
    assert "/?token=" in out
    (page,) = served.service.viewers
    assert served.service.addresses == {"live_page": page.url}


def test_run_shows_nobody_anything_unless_asked(served: SimpleNamespace) -> None:
    assert cli.run(["run", "--sim"]) == 0
    assert served.service.viewers == []

"""``wayfarer demo``, and the options of ``wayfarer run`` for those who look on."""

# ruff: noqa: TID251 - the clocks that the log's begins at
from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.conftest import Run, refusal
from wayfarer import cli
from wayfarer.cli import demo
from wayfarer.daemon.socket.paths import daemon_socket, single_daemon
from wayfarer.safety.mission_limits import RunEnd

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
        (service.logs / "00001-20261121T061405Z").mkdir(parents=True)
        (service.logs / "00001-20261121T061405Z" / "run.jsonl").touch()
        kept.alone = single_daemon(service.socket)
        with kept.alone:
            for viewer in service.viewers:
                if hasattr(viewer, "close"):
                    viewer.close()
        return RunEnd("escaped", "the simulated rover has escaped after 76.0 m")

    monkeypatch.setattr("wayfarer.daemon.daemon.serve", serve)
    monkeypatch.setattr("wayfarer.experiments.demo.LEFT_S", 0.0)  # nobody has the page open
    return kept


def test_demo_says_where_the_page_is_how_it_ended_and_what_to_try_next(served: SimpleNamespace, run: Run) -> None:
    code, out, _ = run("demo", "--live-port", "0")
    assert code == 0
    first, *rest = out.splitlines()
    assert first.startswith("open this page; the rover starts when it is open: http://127.0.0.1:")
    assert "the simulated rover has escaped after 76.0 m" in rest
    assert any("the page and its buttons stay" in line and "Ctrl-C" in line for line in rest)
    (log,) = (line for line in rest if line.startswith("the field log: "))
    assert Path(log.partition(": ")[2]).is_dir()
    assert any("wayfarer sim" in line for line in rest)


def test_demo_drives_only_the_simulated_rover_and_disturbs_no_daemon(served: SimpleNamespace) -> None:
    with single_daemon(daemon_socket()):
        assert cli.run(["demo", "--live-port", "0"]) == 0
    service = served.service
    assert (service.simulated, service.config.name, service.dry_run) == (True, "sim", False)
    assert service.time_scale == demo.SPEED, "as the log says, so that it is known when the run began"
    assert service.socket != daemon_socket()
    assert not service.socket.parent.exists(), "only the log stays"


def test_wall_clock_of_the_log_begins_now_and_goes_with_the_time_of_the_run(served: SimpleNamespace) -> None:
    """Pause and speed change how fast that time goes; nobody sets the clock."""
    before_s = time.time()
    assert cli.run(["demo", "--live-port", "0"]) == 0
    t_s = time.monotonic()
    assert before_s - 0.01 <= served.service.wall(t_s) <= time.time() + 0.01
    assert served.service.wall(t_s + 60.0) - served.service.wall(t_s) == pytest.approx(60.0)


def test_demo_keeps_its_log_where_it_is_told(served: SimpleNamespace, tmp_path: Path) -> None:
    assert cli.run(["demo", "--live-port", "0", "--log-dir", str(tmp_path / "kept"), "--seed", "5"]) == 0
    assert (served.service.logs, served.service.seed) == (tmp_path / "kept", 5)


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
    assert "--live-port" in refusal(run, *command, "--live-port", taken_port, "--log-dir", tmp_path / "logs")
    assert not (tmp_path / "logs").exists()


def test_run_serves_the_page_where_it_is_told(served: SimpleNamespace, run: Run) -> None:
    code, out, _ = run("run", "--sim", "--live", "--live-host", "0.0.0.0", "--live-port", "0")
    assert code == 0
    assert "/?token=" in out
    assert len(served.service.viewers) == 1


def test_run_shows_nobody_anything_unless_asked(served: SimpleNamespace) -> None:
    assert cli.run(["run", "--sim"]) == 0
    assert served.service.viewers == []


@pytest.mark.parametrize(
    ("arguments", "port"), [(["--foxglove"], 8765), (["--foxglove", "--foxglove-port", "9001"], 9001)]
)
def test_foxglove_takes_a_port_or_its_own(
    served: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, arguments: list[str], port: int
) -> None:
    pytest.importorskip("foxglove", reason="Foxglove's SDK is not installed")
    asked: list[int] = []

    class Channels:
        url = "ws://127.0.0.1:1"

        def __init__(self, port: int) -> None:
            asked.append(port)

        def close(self) -> None: ...

    monkeypatch.setattr("wayfarer.views.foxglove.live.FoxgloveLive", Channels)
    assert cli.run(["run", "--sim", *arguments]) == 0
    assert asked == [port]

"""What commands print with ``--json`` is as in ``docs/reference/json.md``: its tables against output and types."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.cli.json_schema import keys_of, keys_of_class, read_tables, wrong
from tests.conftest import Run
from tests.daemon import played
from tests.kit.rover import Rig
from tests.logview.records import HEADER, drive, event, noted, numbered, outcome, write
from wayfarer import cli
from wayfarer.cli.listing import Described
from wayfarer.commissioning.checks import Finding
from wayfarer.daemon.last_mission import LastMission
from wayfarer.experiments.run import ComputeCost
from wayfarer.fieldlog.reader import Damage
from wayfarer.fieldlog.record import Fix
from wayfarer.fieldlog.replay import DecisionDifference, Replay
from wayfarer.fieldlog.run_fold import LowBattery
from wayfarer.logview.listing import RunRow
from wayfarer.logview.summary import LastPosition, Mark, PeriodPercentiles, RangeBearing, RunSummary
from wayfarer.logview.terminal import print_json

FIELD_LOGS = Path(cli.__file__).parents[2] / "field_logs"
tables = cache(read_tables)

# Tables of what a class holds, and the keys that are added to it; a key is in no table that is not in its class.
CLASSES: dict[type, set[str]] = {
    RunRow: set(), RunSummary: set(), LowBattery: set(), PeriodPercentiles: set(), Mark: set(), LastPosition: set(),
    RangeBearing: set(), LastMission: {"text"}, Fix: set(), Damage: set(), Replay: {"run"}, DecisionDifference: set(),
    ComputeCost: {"cpu_us_per_tick"}, Finding: set(), Described: set(),
}  # fmt: skip


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_table_has_the_keys_and_types_of_the_class(cls: type) -> None:
    told = keys_of(cls.__name__, tables())
    assert {key: told[key] for key in told if key not in CLASSES[cls]} == keys_of_class(cls)


def test_every_table_that_is_named_exists() -> None:
    types = {word for table in tables().values() for words in table.values() for word in words.split()}
    assert {word for word in types if word[0].isupper()} <= tables().keys()


def commands_with_json(command: Any = None, path: str = "wayfarer") -> Iterator[str]:
    command = command or typer.main.get_command(cli.app)
    if any("--json" in parameter.opts for parameter in command.params):
        yield path
    for name in getattr(command, "commands", {}):
        yield from commands_with_json(command.get_command(None, name), f"{path} {name}")


def test_page_has_every_command_with_json_and_no_other() -> None:
    told = {heading.partition(" --")[0] for heading in tables() if heading.startswith("wayfarer ")}
    assert told == set(commands_with_json())


def test_settings_of_a_folder_are_in_the_page(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "angles"
    asked = ("escape.turn_angle_deg=10,30", "--trials", 1, "--budget-m", 2, "--jobs", 1, "--out", out)
    assert run("sweep", *asked)[0] == 0
    said = json.loads((out / "campaign.json").read_text(encoding="utf-8"))
    axes = said.pop("axes")
    assert not [*wrong(said, "CampaignSettings", tables()), *wrong(axes[0], "SweepAxis", tables())]


# -- what is printed -------------------------------------------------------------------------------------------------


@pytest.fixture
def says(run: Run) -> Any:
    """Run a command with ``--json``, check what it prints against the table of its name, and return it."""

    def says(table: str, *arguments: object, code: int = 0) -> Any:
        got, out, _ = run(*arguments, "--json")
        assert (got, out.count("\n")) == (code, 1)
        said = json.loads(out)
        assert not list(wrong(said, f"wayfarer {table}", tables()))
        return said

    return says


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A run that ended, one that was cut off in the middle of a line, and one of which nothing can be read."""
    began = [HEADER, event("armed", 0.0), noted(0.0, "log \x1b[2J\U0001f600"), *drive(0.0, 6.0)]
    write(tmp_path / "00001-20261121T061405Z", numbered([*began, outcome(6.0)]))
    write(tmp_path / "00002-20261121T071405Z", numbered([HEADER, *drive(0.0, 3.0, phase="halt")]))
    with (tmp_path / "00002-20261121T071405Z" / "run.00001.jsonl").open("ab") as file:
        file.write(b'{"record":"ti')
    write(tmp_path / "00003-20261121T081405Z", [])
    return tmp_path


def test_logs(says: Any, logs: Path) -> None:
    found = says("logs list", "logs", "list", "--log-dir", logs)["runs"]
    assert [(run["number"], run["outcome"]) for run in found][::2] == [(1, "requested"), (3, "unreadable")]
    assert found[0]["commanded_m"] == pytest.approx(3.0, abs=0.1)
    assert says("logs summary", "logs", "summary", 1, "--log-dir", logs)["marks"][0]["at_s"] == 0.0
    assert says("logs summary", "logs", "summary", 2, "--log-dir", logs)["damage"]["torn"] == 1
    checked = says("logs check", "logs", "check", 1, 2, 3, "--log-dir", logs, code=1)["logs"]
    assert [log["integrity"] for log in checked] == ["complete", "partial", "unreadable"]
    whole = says("logs summary", "logs", "summary", "--log-dir", FIELD_LOGS)
    assert whole["low_battery"], "a log with more in it"


def test_lines_of_a_run_are_an_object_each_and_notes_go_elsewhere(run: Run, logs: Path) -> None:
    plain = run("logs", "show", 2, "--log-dir", logs)[1].splitlines()
    code, out, err = run("logs", "show", 2, "--log-dir", logs, "--json")
    objects = [json.loads(line) for line in out.splitlines()]
    assert code == 0
    assert not [fault for each in objects for fault in wrong(each, "wayfarer logs show", tables())]
    assert plain[: len(objects)] == [f"0:00:{each['elapsed_s']:05.2f}  {each['text']}" for each in objects]
    assert err.splitlines() == plain[len(objects) :]
    assert len(run("logs", "show", 2, "--log-dir", logs, "--ticks", "--json")[1].splitlines()) == 61


def test_replay(says: Any, logs: Path, tmp_path: Path) -> None:
    whole = says("replay", "replay", "--log-dir", FIELD_LOGS)["runs"]
    assert whole[0]["difference"] is None
    records = [json.loads(line) for line in (next(FIELD_LOGS.glob("0*")) / "run.00001.jsonl").read_text().splitlines()]
    at = next(number for number, record in enumerate(records) if record.get("phase") == "back_off")
    other = [*records[:at], records[at] | {"phase": "follow"}, *records[at + 1 :]]
    changed = says("replay", "replay", write(tmp_path / "changed", other), code=1)["runs"][0]["difference"]
    assert (changed["logged"], changed["today"]) == ("follow", "back_off")
    says("replay", "replay", write(tmp_path / "cut", [*records[:at], *records[at + 1 :]]), code=3)


@pytest.mark.process  # MuJoCo's first import starts one
@pytest.mark.usefixtures("quick_trials")
def test_sim_and_compare(says: Any, tmp_path: Path) -> None:
    sim = partial(says, "sim", "sim", "--jobs", 1)
    said = sim("--trials", 4, "--algorithm", "pledge,forest-pledge", "--out", tmp_path / "out")
    assert (said["last_run"]["trials"], said["table"][0]["algorithm"]) == (8, "pledge")
    compared = says("compare", "compare", tmp_path / "out")["algorithms"]
    assert [each["algorithm"] for each in compared] == ["forest-pledge", "pledge"]
    assert (compared[0]["spl_change"], compared[1]["success_percent_change_pairs"]) == (None, 4)
    numbers = [value for each in (*compared, *said["table"]) for value in each.values() if isinstance(value, float)]
    assert numbers == [round(value, 4) for value in numbers]
    sim("--trials", 2, "--ground", "mud", "--rover", "forestrover", "--forests", "reference")
    sim("--trials", 2, "--physics", "mujoco", "--rover", "forestrover")
    sim("--trials", 2, "--set", "sim.slope_deg=5", "--set", "senses=field")
    says(
        "sim --trial", "sim", "--trial", 3, "--set", "sim.slope_deg=5", "--physics", "mujoco", "--rover", "forestrover"
    )
    assert says("sim --trial", "sim", "--trial", 3)["trial"] == 3


@pytest.mark.usefixtures("quick_trials")
def test_sweep_says_at_which_point_each_line_is(says: Any, tmp_path: Path) -> None:
    asked = ("escape.turn_angle_deg=10,30", "slip_mean_m=2,5", "--trials", 2, "--jobs", 1, "--out", tmp_path / "out")
    table = says("sweep", "sweep", *asked)["table"]
    assert [list(line["point"].values()) for line in table] == [[10, 2], [10, 5], [30, 2], [30, 5]]
    assert table[0]["point"].keys() == {"escape.turn_angle_deg", "slip_mean_m"}


def test_list(says: Any) -> None:
    algorithms = {each["name"]: each for each in says("list", "list")["algorithms"]}
    assert algorithms["oo-react"]["needs"] == ["contact"]


def test_list_of_faults(says: Any) -> None:
    assert {"silent", "snag"} <= {each["kind"] for each in says("list --faults", "list", "--faults")["faults"]}


def test_list_of_keys(says: Any, run: Run) -> None:
    keys = {each["key"]: each for each in says("list --keys", "list", "--keys")["keys"]}
    assert (keys["sim.friction"]["value"], keys["escape.turn_angle_deg"]["what"]) == (0.5, None)
    assert "sim.slope_direction_deg" in run("list", "--keys")[1]


def test_list_of_conditions(says: Any) -> None:
    rows = {each["condition"]: each for each in says("list --conditions", "list", "--conditions")["conditions"]}
    assert (rows["motors_failed"]["level"], rows["motors_failed"]["among_people"]) == ("hold", "fault")


def test_check(says: Any, own_folders: Path, tmp_path: Path) -> None:
    rover = tmp_path / "rover.toml"
    shipped = (Path(cli.__file__).parents[1] / "rovers/forestrover.toml").read_text(encoding="utf-8")
    rover.write_text('buses = "tests.cli.test_rover:buses"\n' + shipped, encoding="utf-8")
    assert not says("check", "check", "--rover", rover, "--log-dir", tmp_path, code=1)["passed"]


def test_status(says: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a rover that is disarmed, that drives and that is held, as its daemon answers."""
    answers: list[dict[str, Any]] = []

    @played.played
    async def answered(run: played.Run) -> None:
        answers.append(await run.status())
        await run.arm()
        answers.append(await run.status())
        await run.commands.hold()
        answers.append(await run.status())

    answered(run=played.Run(Rig(tmp_path)))
    monkeypatch.setattr("wayfarer.daemon.socket.client.ask", lambda request, timeout_s: answers.pop(0))
    said = [says("status", "status") for _ in range(3)]
    assert [(each["mode"], each["held"]) for each in said] == [("disarmed", False), ("armed", False), ("armed", True)]


def test_number_that_is_none_is_null(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"nan": float("nan"), "inf": [float("inf")], "periods": PeriodPercentiles(1.0, -float("inf"), 2.0)})
    assert json.loads(capsys.readouterr().out) == {
        "nan": None, "inf": [None], "periods": {"p50_s": 1.0, "p99_s": None, "max_s": 2.0},
    }  # fmt: skip

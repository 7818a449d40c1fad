"""Files that people write or carry over: rovers, calibrations, forests, folders of campaigns."""

from __future__ import annotations

import dataclasses
import json
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from math import isfinite
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hypothesis import strategies as st

import tests.faults
from tests.fuzz.damage import as_json, bytes_of, json_of
from tests.fuzz.target import Case, Target, Try, reading
from wayfarer.config import calibration_file
from wayfarer.config.rover_file import load_rover, rover_names
from wayfarer.daemon.stop_motors import stop_motors
from wayfarer.errors import BadConfig, WayfarerError
from wayfarer.experiments.provenance import RUNS, facts_of, read_runs
from wayfarer.experiments.recorded import FORESTS, SETTINGS, recorded
from wayfarer.experiments.results import TRIALS, Results
from wayfarer.experiments.rows import COLUMNS, TrialRow, csv_line
from wayfarer.simhal.buses import FakeBuses, FakeSerial
from wayfarer.simhal.world.forest_file import as_row, content_of, forests_in
from wayfarer.simhal.world.generate import generate_forest
from wayfarer.testing.scenario import read_scenarios

MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None  # nothing here is about disks
ROVERS = [
    (Path(calibration_file.__file__).parents[1] / "rovers" / f"{name}.toml").read_bytes() for name in rover_names()
]
WORDS = sorted({word for rover in ROVERS for word in rover.split() if word[:1].isalpha() or word[:1] == b"["})
CALIBRATION = {
    "schema": 1,
    "compass": {"t_wall": 1.8e9, "date": "2026-11-21", "part": "CMPS14", "level": 3, "residual_deg": 1.5},
    "flow": {"t_wall": 1.8e9, "date": "2026-11-21", "part": "PMW3901", "scale": 1.1},
    "motors": {
        "t_wall": 1.8e9, "date": "2026-11-21", "part": "ThunderBorg",
        "shift_half_deg": 1.0, "shift_full_deg": 2.0, "passed": True,
    },
}  # fmt: skip


@contextmanager
def reading_a_file(name: str, read: Callable[[Path], str]) -> Iterator[Try]:
    """Write each case to a file of that name, and read it."""
    with tempfile.TemporaryDirectory(prefix="wf-", dir=MEMORY) as folder:
        path = Path(folder) / name

        def attempt(content: bytes) -> str:
            path.write_bytes(content)
            return reading(lambda: read(path))

        yield attempt


def check_finite(value: Any) -> None:
    """See that each number in a settings object can be one."""
    if isinstance(value, float):
        assert isfinite(value), f"{value} was accepted"
    elif isinstance(value, dict | list | tuple):
        for each in value.values() if isinstance(value, dict) else value:
            check_finite(each)
    elif dataclasses.is_dataclass(value):
        check_finite([getattr(value, field.name) for field in dataclasses.fields(value)])
    elif hasattr(value, "model_fields_set"):
        check_finite(dict(value))


# -- rovers and calibrations -----------------------------------------------------------------------------------------


def _load_rover(path: Path) -> str:
    try:
        config = load_rover(str(path))
    except WayfarerError as error:
        assert isinstance(error, BadConfig) and f"{path.name}: " in str(error)
        raise
    check_finite(config)
    return f"a rover with {len(config.parts)} parts"


ROVER_TABLES = [tomllib.loads(rover.decode()) for rover in ROVERS]


def _toml(table: Any) -> bytes:
    """Return a table as a rover file: TOML in which only values are strange."""
    if not isinstance(table, dict):
        return b""
    return "".join(f"{json.dumps(key)} = {_toml_value(value)}\n" for key, value in table.items()).encode()


def _toml_value(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml_value(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml_value, value)) + "]" if len(value) != 1 else f"[{json.dumps(str(value)[:9])}]"
    return "nan" if value is None else json.dumps(value)


ROVER = Target(
    "rover",
    bytes_of([b"", *ROVERS], WORDS) | json_of(ROVER_TABLES).map(_toml),
    lambda: reading_a_file("rover.toml", _load_rover),
)


# -- rovers whose wheels must stop, whatever else their file holds ---------------------------------------------------


class Wheels(FakeBuses):
    """Buses of which nobody answers; ``stops`` counts what was sent to a motor board."""

    stops = 0

    def serial(self, name: str, *, baud: int = 9600) -> FakeSerial:
        port = super().serial(name, baud=baud)
        port.attach(self)
        return port

    def receive(self, _data: bytes) -> bytes:
        Wheels.stops += 1
        return b""


MOTORS = b"""
[parts.motors]
driver = "sabertooth"
port = "/dev/ttyAMA0"
"""


def _stop(path: Path) -> str:
    Wheels.stops = 0
    said = stop_motors(str(path))
    assert Wheels.stops, f"nothing was sent, and yet: {said}"
    return "stopped"


@contextmanager
def _stopping() -> Iterator[Try]:
    """Stop by the rover file of each case; daemons are not looked for, because there may be real ones."""
    with (
        patch("wayfarer.daemon.socket.paths.known_sockets", list),
        reading_a_file("rover.toml", _stop) as attempt,
    ):
        yield attempt


STOPPING = Target(
    "stop-motors",
    st.builds(
        lambda *pieces: b"".join(pieces),
        st.just(f'buses = "{Wheels.__module__}:Wheels"\n'.encode()),
        bytes_of([b"", *ROVERS], WORDS, 2),
        bytes_of([MOTORS], WORDS, 2) | st.just(MOTORS),
        bytes_of([b"", *ROVERS], WORDS, 2),
    ),
    _stopping,
    quick=15,
)  # fmt: skip


def _load_calibration(path: Path) -> str:
    loaded = calibration_file.load(path)
    check_finite(loaded)
    return f"calibrated: {[name for name in ('compass', 'flow', 'motors') if getattr(loaded, name)]}"


CALIBRATIONS = Target(
    "calibration",
    bytes_of([as_json(CALIBRATION)]) | json_of([CALIBRATION]).map(as_json),
    lambda: reading_a_file(calibration_file.FILE_NAME, _load_calibration),
)


# -- fault scenarios -------------------------------------------------------------------------------------------------

SCENARIO_FILES = [path.read_bytes() for path in (Path(tests.faults.__file__).parent / "found").glob("*.toml")]

SCENARIO = Target(
    "scenario",
    bytes_of(SCENARIO_FILES, [b"[[scenario.fault]]", b"kind", b"target", b"settings"]),
    lambda: reading_a_file("faults.toml", lambda path: f"{len(read_scenarios(path))} scenarios"),
)


# -- forests ---------------------------------------------------------------------------------------------------------


def _forest(number: int) -> dict[str, object]:
    """Return a forest that is small, so that a change meets everything in it."""
    row = as_row(generate_forest(number, noise=0, seed=0))
    return {**row, "trees_m": row["trees_m"][:3], "trunks_m": row["trunks_m"][:3]}  # type: ignore[index]


FORESTS_ROWS: list[Any] = [{**_forest(0), "shortest_path_m": 41.0}, _forest(1)]
FOREST_FILE = b"".join(as_json(row) + b"\n" for row in FORESTS_ROWS)


def _read_forests(path: Path) -> str:
    forests = forests_in(path, content_of(path))
    check_finite(forests)
    return f"{len(forests)} forests"


FOREST = Target(
    "forest",
    bytes_of([FOREST_FILE]) | st.lists(json_of(FORESTS_ROWS), max_size=3).map(
        lambda rows: b"\n".join(map(as_json, rows))
    ),
    lambda: reading_a_file("forests.jsonl", _read_forests),
)  # fmt: skip


# -- campaigns -------------------------------------------------------------------------------------------------------

CAMPAIGN: dict[str, Any] = {
    "version": "0.1.0", "algorithms": ["pledge", "cv-react"], "trials": 2, "seed": 0, "slip_mean_m": 10.0,
    "budget_m": 400.0, "spl": False, "go_on": False, "depth": "device", "site": None, "forests": None,
    "physics": "light", "ground": "ideal", "set": {"sim.slope_deg": 5.0, "senses": "field"},
    "faults": ["silent:compass@20+5"], "rover": load_rover("sim").model_dump(mode="json"),
}  # fmt: skip
ROWS = [
    TrialRow(trial, algorithm, trial, 0, 7, "escaped", 80.125, 1.5, 90.0, 3, 2, 40.0, 0.5)
    for algorithm in CAMPAIGN["algorithms"]
    for trial in range(2)
]
TABLE = (csv_line(COLUMNS) + "".join(csv_line(COLUMNS, row) for row in ROWS)).encode()
RECORDED_RUN = {
    "began": "2026-11-25T22:44:26Z", "command": "wayfarer sim --out results", "version": "0.1.0", "compiled": False,
    "machine": {"cpu": "AMD EPYC", "cores": 2, "system": "Debian 12, x86_64", "python": "CPython 3.11.7"},
}  # fmt: skip
WITH_FORESTS = {**CAMPAIGN, "forests": {"file": "mine.jsonl", "blake2b": "00"}}
CELLS = (b",", b"escaped", b"vanished", b"pledge", b"\n", b"-1", b"1e5")


def _campaigns() -> st.SearchStrategy[Case]:
    settings = bytes_of([json.dumps(CAMPAIGN).encode()], most=2) | json_of([CAMPAIGN, WITH_FORESTS], 2).map(as_json)
    table = bytes_of([TABLE], CELLS, 3)
    return st.fixed_dictionaries(
        {},
        optional={
            SETTINGS: settings | st.just(json.dumps(CAMPAIGN).encode()),
            TRIALS: table,
            FORESTS: st.just(FOREST_FILE),
            RUNS: json_of([[RECORDED_RUN]]).map(as_json),
        },
    ) | st.fixed_dictionaries({SETTINGS: st.just(json.dumps(CAMPAIGN).encode()), TRIALS: table})


def _read_campaign(folder: Path) -> str:
    resumed = reading(lambda: _resume(folder))
    return f"{resumed} / {reading(lambda: _report_of(folder))}"


def _resume(folder: Path) -> str:
    with Results.kept(recorded(CAMPAIGN), folder, resume=True) as results:
        assert all(isinstance(row.trial, int) for row in results.rows), "a trial without a number"
        check_finite(results.rows)
        return f"{len(results.rows)} trials kept"


def _report_of(folder: Path) -> str:
    results = Results.open(folder, unfinished=True)
    check_finite(results.rows)
    made = reading(lambda: f"{len(dict(facts_of(read_runs(folder))))} facts")
    return f"{len(results.by_algorithm)} algorithms, {reading(lambda: str(results.rebuild().trials))} trials, {made}"


def _read_folder(files: dict[str, bytes]) -> str:
    with tempfile.TemporaryDirectory(prefix="wf-", dir=MEMORY) as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        return _read_campaign(Path(folder))


RESULTS = Target(
    "results",
    _campaigns(),
    lambda: nullcontext(_read_folder),
)  # fmt: skip

"""How results were made is kept beside them, without a name, and decides nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from wayfarer.errors import BadInput
from wayfarer.experiments.provenance import RUNS, facts_of, read_runs, record_run, this_machine


def test_each_run_is_kept_and_each_different_value_told_once(tmp_path: Path) -> None:
    assert read_runs(tmp_path) == []
    assert list(facts_of([])) == []
    record_run(tmp_path, ["wayfarer", "sim", "--out", "a b"])
    record_run(tmp_path, None)
    runs = read_runs(tmp_path)
    assert [run.command for run in runs] == ["wayfarer sim --out 'a b'", None]
    assert [run.machine for run in runs] == [this_machine()] * 2
    facts = dict(facts_of(runs))
    assert facts["command"] == "wayfarer sim --out 'a b'\nnone: run from Python"
    assert "\n" not in facts["computer"]
    assert runs[0].began <= runs[1].began


def test_home_folder_is_not_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    record_run(tmp_path, ["wayfarer", "sim", "--out", "/home/ada/out", "--forests", "/home/adam/\udcff.jsonl"])
    assert read_runs(tmp_path)[0].command == r"wayfarer sim --out ~/out --forests '/home/adam/\udcff.jsonl'"


@pytest.mark.parametrize("content", ["", "[{}]", '{"began": 1}', "[" * 100_000])
def test_damaged_file_is_named_with_its_remedy(tmp_path: Path, content: str) -> None:
    (tmp_path / RUNS).write_text(content)
    with pytest.raises(BadInput, match=r"runs\.json is damaged: .*remove it") as refused:
        read_runs(tmp_path)
    assert len(str(refused.value)) < 300


def test_file_is_a_list_of_runs_that_other_programs_can_read(tmp_path: Path) -> None:
    record_run(tmp_path, ["wayfarer"])
    (entry,) = json.loads((tmp_path / RUNS).read_text())
    assert set(entry) == {"began", "command", "version", "compiled", "machine"}
    assert set(entry["machine"]) == {"cpu", "cores", "system", "python"}

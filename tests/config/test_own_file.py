"""A driver or an algorithm in a file of one's own: which file it is, what in it is meant, and what is wrong with it."""

from __future__ import annotations

import asyncio
import os
import pickle
import re
import sys
from collections.abc import Iterator
from hashlib import blake2b
from pathlib import Path

import pytest

import wayfarer
from wayfarer.cli.replay import replay_text
from wayfarer.commissioning.checks import CheckVerdict, HostEnvironment, check
from wayfarer.config.calibration_file import Calibration, FlowEntry
from wayfarer.config.factory import assemble
from wayfarer.config.own_file import (
    OwnMistake,
    as_used,
    check_same,
    forget_changed,
    names_file,
    split,
    used,
    whole_name,
)
from wayfarer.config.registry import find_algorithm, find_driver
from wayfarer.config.rover_file import RoverConfig, load_rover
from wayfarer.errors import BadConfig, BadInput, UnknownName, WayfarerError
from wayfarer.experiments.checks import check_rover
from wayfarer.fieldlog.replay import replay
from wayfarer.simhal.buses import FakeBuses
from wayfarer.simhal.world.physics import Depth

HANDLER = """
from __future__ import annotations
from dataclasses import dataclass
from wayfarer.escape.catalogue import CATALOGUE

@dataclass
class Memory:
    turns: int = 0

class Spiral:
    \"\"\"Round and round.\"\"\"

    def __init__(self, settings, vehicle, rng):
        self._inner = CATALOGUE["rand-pledge"].make(settings, vehicle, rng)
        self.decide, self.reset, self.memory = self._inner.decide, self._inner.reset, self._inner.memory

    def decide(self, observation): ...
    def reset(self): ...
    def memory(self): ...
"""
DRIVER = """
from dataclasses import dataclass

class Needle:
    part, name = "compass", "needle"

    @dataclass(frozen=True)
    class Settings:
        address: int = 0x28

    def __init__(self, settings, buses): ...
    async def open(self): ...
    async def read(self): ...
    async def close(self): ...
"""


NO_CHIP = """
from wayfarer.testing import SimulatedChip
Needle.simulated_chip = "needle.py:CHIP"
CHIP = SimulatedChip(lambda settings, wiring: None)
"""


@pytest.fixture(autouse=True)
def nothing_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Each test is in an empty folder, and what it loads is forgotten."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = {*sys.modules}
    yield
    for name in {*sys.modules} - before:
        if name.startswith("wayfarer_own_"):
            del sys.modules[name]


def written(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


# -- which file --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("spiral.py", ("spiral.py", "")),
        ("spiral.py:Spiral", ("spiral.py", "Spiral")),
        ("a/b:c/spiral.py", ("a/b:c/spiral.py", "")),
        ("/a:b/spiral.py:In.Ner", ("/a:b/spiral.py", "In.Ner")),
        ("a:b.py", ("a:b.py", "")),
        ("./rules:Spiral", ("./rules", "Spiral")),
    ],
)
def test_slash_or_py_decides_that_a_name_is_a_file_s(name: str, parts: tuple[str, str]) -> None:
    assert (names_file(name), split(name)) == (True, parts)


@pytest.mark.parametrize("name", ["forest-pledge", "module:attribute", "pkg.module:Class.inner", "cmps14", ""])
def test_other_names_are_no_file_s(name: str) -> None:
    assert not names_file(name)
    assert whole_name("algorithm", name) == name


def test_file_beside_the_rover_file_comes_before_one_in_the_current_folder(tmp_path: Path) -> None:
    here = written(tmp_path, "spiral.py", HANDLER)
    there = written(tmp_path / "rover", "spiral.py", HANDLER)
    assert whole_name("algorithm", "spiral.py:Spiral", tmp_path / "rover") == f"{there}:Spiral"
    assert whole_name("algorithm", "spiral.py:Spiral", tmp_path / "elsewhere") == f"{here}:Spiral"
    assert whole_name("algorithm", "rover/../spiral.py") == str(here)


def test_driver_s_file_has_its_whole_path_in_a_rover_that_was_read(tmp_path: Path) -> None:
    file = written(tmp_path / "rover", "needle.py", DRIVER)
    rover = written(tmp_path / "rover", "rover.toml", ROVER)
    assert load_rover(str(rover)).parts["compass"]["driver"] == f"{file}:Needle"
    with pytest.raises(BadConfig, match=rf"needle\.py; looked in {tmp_path}$"):
        RoverConfig.model_validate({"name": "r", "vehicle": {}, "parts": {"compass": {"driver": "needle.py:Needle"}}})


ROVER = """
name = "mine"
[vehicle]
length_m = 0.4
width_m = 0.4
track_m = 0.5
max_speed_m_s = 1.0
[parts.compass]
driver = "needle.py:Needle"
"""


def test_long_path_of_a_driver_is_no_long_text(tmp_path: Path) -> None:
    folder = tmp_path / ("long" * 40) / ("folder" * 30)
    folder.mkdir(parents=True)
    written(folder, "needle.py", DRIVER)
    assert load_rover(str(written(folder, "rover.toml", ROVER))).parts["compass"]["driver"].endswith("needle.py:Needle")


# -- what in it --------------------------------------------------------------------------------------------------------


def test_class_of_a_file_is_an_algorithm_under_the_name_that_was_asked_for(tmp_path: Path) -> None:
    file = written(tmp_path, "spiral.py", HANDLER)
    found = find_algorithm("spiral.py")
    assert (found.name, found.origin, found.summary) == ("spiral.py", str(file), "Round and round.")
    assert found.make is find_algorithm(f"{file}:Spiral").make


def test_row_in_a_file_counts_before_the_class_it_is_made_of(tmp_path: Path) -> None:
    row = 'from wayfarer.escape.catalogue import Algorithm\nmine = Algorithm("m", "f", "a row", Spiral)\n'
    written(tmp_path, "spiral.py", HANDLER + row)
    assert find_algorithm("spiral.py").summary == "a row"


def test_driver_s_class_is_found_without_its_name(tmp_path: Path) -> None:
    written(tmp_path, "needle.py", DRIVER)
    assert find_driver("needle.py").__name__ == "Needle"


def test_two_that_fit_are_listed_with_the_text_to_write(tmp_path: Path) -> None:
    written(tmp_path, "needle.py", DRIVER + "class Other(Needle): ...\n")
    with pytest.raises(BadInput, match=r"several in it fit; write needle\.py:Needle or needle\.py:Other$"):
        find_driver("needle.py")


def test_objects_of_a_file_can_be_pickled_and_one_file_is_executed_once(tmp_path: Path) -> None:
    written(tmp_path, "spiral.py", HANDLER)
    handler = find_algorithm("spiral.py").make
    memory = sys.modules[handler.__module__].Memory(3)
    assert pickle.loads(pickle.dumps(memory)) == memory
    assert find_algorithm("./spiral.py:Spiral").make is handler


def test_file_imports_its_neighbours_and_hides_no_installed_module(tmp_path: Path) -> None:
    written(tmp_path, "json.py", "raise RuntimeError('hidden')")
    written(tmp_path, "neighbour_of_spiral.py", "ANGLE = 7")
    written(tmp_path, "spiral.py", HANDLER + "\nimport json\nfrom neighbour_of_spiral import ANGLE\n")
    sys.modules.pop("neighbour_of_spiral", None)
    find_algorithm("spiral.py")
    assert sys.path[-1] == str(tmp_path)
    assert not list(tmp_path.glob("__pycache__/spiral.*")), "nothing is written beside it"


def test_file_that_was_edited_is_loaded_again(tmp_path: Path) -> None:
    file = written(tmp_path, "spiral.py", HANDLER)
    before, names = used({"s": str(file)}), find_algorithm("spiral.py").make
    forget_changed()
    assert find_algorithm("spiral.py").make is names
    written(tmp_path, "spiral.py", HANDLER.replace("Round and round", "Straight on"))
    forget_changed()
    assert find_algorithm("spiral.py").summary == "Straight on."
    assert used({"s": str(file)})["s"].blake2b != before["s"].blake2b


# -- three errors ------------------------------------------------------------------------------------------------------


def test_file_that_is_not_there_is_told_with_the_folders_and_near_names(tmp_path: Path) -> None:
    written(tmp_path / "rover", "spiral.py", HANDLER)
    with pytest.raises(BadInput) as caught:
        find_algorithm("spirl.py:Spiral", tmp_path / "rover")
    looked = f"looked in {tmp_path / 'rover'} and {tmp_path}"
    assert str(caught.value) == (
        f"algorithm 'spirl.py:Spiral': no such file spirl.py; {looked}; did you mean spiral.py?"
    )


@pytest.mark.parametrize(
    "name", ["\0/x.py", "x\0.py", "x" * 300 + "/x.py", "circle/x.py", "circle.py", "/.py", "x.py/y.py"]
)
def test_what_no_file_can_be_called_is_not_there(tmp_path: Path, name: str) -> None:
    (tmp_path / "circle").symlink_to("circle")
    (tmp_path / "circle.py").symlink_to("circle.py")
    written(tmp_path, "x.py", HANDLER)
    with pytest.raises(BadInput, match=r"no such file .*\.py; looked in "):
        find_algorithm(name, tmp_path / "nowhere")


def test_name_without_its_file_s_ending_is_told_what_to_write(tmp_path: Path) -> None:
    # A name of its own: what other tests have loaded is in ``sys.path``.
    written(tmp_path, "wall_follower.py", HANDLER)
    with pytest.raises(UnknownName, match=rf"; a file wall_follower\.py is in {tmp_path}: write wall_follower\.py$"):
        find_algorithm("wall_follower")
    with pytest.raises(BadInput, match=r"cannot import wall_follower .*: write wall_follower\.py:Spiral$"):
        find_algorithm("wall_follower:Spiral")
    with pytest.raises(BadInput, match=r"no such file wall_follower; .* did you mean wall_follower\.py\?"):
        find_algorithm("./wall_follower:Spiral")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("\n\nprint(undefined)\n", r"broken\.py:3: NameError: name 'undefined' is not defined$"),
        ("def f(:\n", r"broken\.py:1: SyntaxError: invalid syntax$"),
        (
            "x = 1\nimport no_such_thing.inner\n",
            r"broken\.py:2: ModuleNotFoundError: .*; correct the name, put no_such_thing\.py beside it, or install",
        ),
        ("import json\n\njson.loads('{')\n", r"broken\.py:3: JSONDecodeError: .* \(raised in decoder\.py:\d+\)$"),
        ("def f():\n    return 1 / 0\n\nf()\n", r"broken\.py:2: ZeroDivisionError: division by zero$"),
        ("raise SystemExit(3)\n", r"broken\.py:1: SystemExit: 3$"),
        ("x = '\0'\n", r"broken(\.py)?: .*null byte"),
    ],
)
@pytest.mark.parametrize("name", ["broken.py:It", "broken:It"])
def test_file_that_fails_is_told_by_its_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, says: str
) -> None:
    written(tmp_path, "broken.py", text)
    monkeypatch.syspath_prepend(tmp_path)
    for find in (find_algorithm, find_driver):
        sys.modules.pop("broken", None)
        with pytest.raises(BadInput, match=rf"broken.*:It' failed while it was loaded: {says}") as caught:
            find(name)
        assert "\n" not in str(caught.value)
        assert caught.value.__cause__ is not None, "for whoever wants the traceback"


@pytest.mark.parametrize(
    ("text", "name", "says"),
    [
        ("", "own.py", "nothing in it fits: no class is in it"),
        ("class A: ...", "own.py:A", r"own\.py:A lacks decide\(\), memory\(\), reset\(\); write that, then check_algo"),
        ("def a(): ...", "own.py:a", r"own\.py:a is a function, neither a class nor a wayfarer"),
        (HANDLER, "own.py:Spirale", r"own\.py has no 'Spirale': did you mean Spiral\?$"),
        (
            HANDLER + "Spiral.requires = ('contact')",
            "own.py",
            r"has requires = 'contact', which is not a tuple of names",
        ),
        (HANDLER + "Spiral.requires = 1", "own.py", r"has requires = 1, which is not a tuple of names"),
        (
            HANDLER + "Spiral.requires = ('bumper',)",
            "own.py",
            r"has 'bumper' in requires, and a rover can have",
        ),
        (
            HANDLER.replace("decide(self, obs", "decide(self, a, obs"),
            "own.py",
            r"a decide\(\) that cannot be called",
        ),
        (
            HANDLER.replace("def memory", "def memoir") + "class Aux: ...\n",
            "own.py",
            r"fits: Spiral lacks memory\(\); Memory lacks decide",
        ),
        (HANDLER.replace(", rng):", "):"), "own.py", r"Spiral cannot be made with \(settings, vehicle, rng\)"),
    ],
)
def test_what_is_no_algorithm_is_told_by_what_is_missing(tmp_path: Path, text: str, name: str, says: str) -> None:
    written(tmp_path, "own.py", text)
    with pytest.raises(BadInput, match=says):
        find_algorithm(name)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (DRIVER.replace("part,", "prt,"), r"lacks the class attribute part, one of compass, motors, "),
        (DRIVER.replace('"compass"', '"compas"'), r"Needle has part = 'compas'; did you mean 'compass'\?; write"),
        (DRIVER.replace('"compass"', '"xyz"'), r"Needle has part = 'xyz'; it is one of compass, motors, "),
        (
            DRIVER.replace("async def read", "async def get"),
            r"Needle lacks read\(\), as its part is 'compass'; w",
        ),
        (
            DRIVER.replace('"compass"', '"motors"'),
            r"lacks drive\(\), halt\(\), .*, stop\(\), as its part is 'motors'; ",
        ),
        (DRIVER.replace("    @dataclass(frozen=True)\n", ""), r"lacks the dataclass Settings"),
        (DRIVER.replace(", buses):", "):"), r"cannot be made with \(settings, buses\)"),
    ],
)
def test_what_is_no_driver_is_told_by_what_is_missing(tmp_path: Path, text: str, says: str) -> None:
    written(tmp_path, "needle.py", text)
    with pytest.raises(BadInput, match=says):
        find_driver("needle.py:Needle")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root is careful whose code it runs")
@pytest.mark.parametrize(
    ("spoil", "order"),
    [
        (lambda file: os.chown(file, 12345, 0), "sudo chown root {file}, or"),
        (lambda file: file.chmod(0o664), "sudo chmod go-w {file}, or"),
        (lambda file: file.parent.chmod(0o1777), "sudo chmod go-w {folder}, or"),
        (lambda file: os.chown(file.parent, 12345, 0), "sudo chown root {folder}, or"),
        (lambda file: file.parent.parent.chmod(0o777), "sudo chmod go-w {above}, or"),
    ],
)
def test_root_loads_no_file_that_another_user_could_change(tmp_path: Path, spoil: object, order: str) -> None:
    file = written(tmp_path / "above", "x", "").parent / "rover" / "spiral.py"
    written(file.parent, "spiral.py", HANDLER)
    find_algorithm(str(file))
    forget_changed()
    file.write_text(HANDLER + "# another\n")
    forget_changed()
    spoil(file)  # type: ignore[operator]
    said = order.format(file=file, folder=file.parent, above=file.parent.parent)
    with pytest.raises(BadInput, match=f"another user can change {file}, and root would run it; {said}"):
        find_algorithm(str(file))


def test_worker_that_has_an_earlier_version_of_a_file_loads_the_one_that_is_asked_for(tmp_path: Path) -> None:
    file = written(tmp_path, "spiral.py", HANDLER)
    (earlier,) = used({"s": str(file)}).values()
    written(tmp_path, "spiral.py", HANDLER + "# edited\n")
    now = earlier._replace(blake2b=blake2b((HANDLER + "# edited\n").encode(), digest_size=16).hexdigest())
    check_same([now])
    with pytest.raises(BadInput, match="is not the file that the campaign began with"):
        check_same([earlier])


OWN_CHIP = """
from wayfarer.testing import SimulatedChip
CHIP = SimulatedChip(lambda settings, wiring: wiring.nothing)
"""


@pytest.mark.parametrize(
    ("driver", "said"),
    [
        (DRIVER.replace("buses): ...", "buses): buses.i2cc"), r"of 'parts.compass' failed while it was made: needle"),
        (DRIVER + "Needle.simulated_chip = 'needle.py:CHIP'\n" + OWN_CHIP, "^the simulated chip of driver '"),
    ],
    ids=["driver", "chip"],
)
def test_mistake_in_what_is_made_for_bus_depth_is_told_in_a_line_with_its_own(
    tmp_path: Path, driver: str, said: str
) -> None:
    file = written(tmp_path, "needle.py", driver + ("" if "CHIP" in driver else NO_CHIP))
    config = load_rover("forestrover").model_copy(deep=True)
    config.parts["compass"] = {"driver": str(file)}
    with pytest.raises(OwnMistake, match=rf"{said}.*\.py:\d+: AttributeError: .*; correct that and run it again$"):
        check_rover(config, Depth.BUS, "forestrover")


def test_checks_go_on_if_a_driver_of_one_s_own_cannot_be_made_or_breaks(tmp_path: Path) -> None:
    broken = DRIVER.replace("buses): ...", "buses): buses.i2cc")
    unopened = DRIVER.replace("async def open(self): ...", "async def open(self): self.x")
    for text, said in ((broken, r"failed while it was made: needle\.py:11: Attr"), (unopened, r"^needle\.py:12: Attr")):
        file = written(tmp_path, "needle.py", text)
        forget_changed()
        config = load_rover("forestrover").model_copy(deep=True)
        config.parts["compass"] = {"driver": str(file)}
        rover = assemble(config, FakeBuses(), Calibration(flow=None), checking=True)
        host = HostEnvironment(tmp_path, tmp_path / "none", (), 0.0, tmp_path)
        findings = {each.name: each for each in asyncio.run(check(config, rover, host, Calibration(), None))}
        assert findings["compass"].verdict is CheckVerdict.FAIL
        assert re.search(said, findings["compass"].text)
        assert findings["compass"].remedy == "correct that and run it again"
        assert "motion" in findings
    with pytest.raises(OwnMistake):
        written(tmp_path, "needle.py", broken)
        forget_changed()
        assemble(config, FakeBuses())


@pytest.mark.parametrize("part", ["motors", "motion"])
def test_checks_take_what_stands_for_any_part_that_cannot_be_made(tmp_path: Path, part: str) -> None:
    text = DRIVER.replace("buses): ...", "buses): buses.i2cc").replace('"compass"', f'"{part}"')
    methods = ("drive", "halt", "health", "read_back", "stop")
    file = written(tmp_path, "needle.py", text + "".join(f"    def {each}(self): ...\n" for each in methods))
    config = load_rover("forestrover").model_copy(deep=True)
    config.parts[part] = {"driver": str(file)}
    rover = assemble(
        config, FakeBuses(), Calibration(flow=FlowEntry(t_wall=0.0, date="", part="x", scale=1.25)), checking=True
    )
    host = HostEnvironment(tmp_path, tmp_path / "none", (), 0.0, tmp_path)
    findings = asyncio.run(check(config, rover, host, Calibration(), None))
    assert any(each.text.startswith(f"driver '{file}' of 'parts.{part}' failed while it was made") for each in findings)
    assert not any("an error in a driver or in wayfarer itself" in each.text for each in findings)


def test_settings_of_a_driver_are_not_among_what_does_not_fit(tmp_path: Path) -> None:
    written(tmp_path, "needle.py", DRIVER.replace("async def read", "async def get") + "Own = Needle.Settings\n")
    with pytest.raises(BadInput, match=r"nothing in it fits: Needle lacks read\(\), as"):
        find_driver("needle.py")


def test_driver_for_another_part_is_told_with_the_key_and_its_part(tmp_path: Path) -> None:
    written(tmp_path, "needle.py", DRIVER.replace('"compass"', '"light"'))
    with pytest.raises(BadConfig, match=r"key 'parts\.compass\.driver': .* as its part is 'light'"):
        load_rover(str(written(tmp_path, "rover.toml", ROVER)))


def test_missing_folder_and_a_folder_are_told_as_such(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    with pytest.raises(BadInput, match=rf"looked in {tmp_path}/parts; there is no such folder$"):
        find_driver("parts/needle.py")
    for name in ("sub/", "./sub"):
        with pytest.raises(BadInput, match=rf"driver '{name}' is a folder; name a file in it, such as .*sub/mine\.py$"):
            find_driver(name)


@pytest.mark.parametrize("decided", ["None", "('far', 1)"])
def test_decide_that_gives_no_decision_is_named_with_its_file(tmp_path: Path, decided: str) -> None:
    own = HANDLER.replace("self.decide, self.reset", "_, self.reset").replace(
        "observation): ...", f"observation): return {decided}"
    )
    written(tmp_path, "spiral.py", own)
    said = re.escape(f"decide() of spiral.py returned {decided}, not a Decision")
    with pytest.raises(WayfarerError, match=said):
        wayfarer.run_trial(0, "spiral.py")


def test_replay_and_trials_say_that_a_file_has_changed(tmp_path: Path) -> None:
    own = HANDLER.replace("self.decide, self.reset", "_, self.reset").replace(
        "observation): ...", "observation): return self._inner.decide(observation)"
    )
    written(tmp_path, "spiral.py", own)
    wayfarer.run_trial(0, "spiral.py", log_dir=tmp_path / "log")
    run = tmp_path / "log"
    assert replay(run, allow_code=True).changed_file is None
    written(tmp_path, "spiral.py", own.replace("rand-pledge", "levy-walk"))
    forget_changed()
    result = replay(run, allow_code=True)
    assert result.changed_file == "spiral.py"
    assert replay_text(run, result).endswith(" today; spiral.py is not the file that was logged")


def test_missing_sense_is_told_with_what_to_do_once(tmp_path: Path) -> None:
    written(tmp_path, "spiral.py", HANDLER + "Spiral.requires = ('wheels',)\n")
    with pytest.raises(WayfarerError, match=r"has none; choose another algorithm or rover$"):
        wayfarer.run_campaign("spiral.py", trials=1)


# -- where it is used --------------------------------------------------------------------------------------------------


def test_trials_say_which_file_they_used_and_refuse_another_one(tmp_path: Path) -> None:
    file = written(tmp_path, "spiral.py", HANDLER)
    results = wayfarer.run_campaign("spiral.py:Spiral", trials=1, out=tmp_path / "out")
    assert [row["algorithm"] for row in results.trials] == ["spiral.py:Spiral"]
    files = results.plan.base.files
    assert files["spiral.py:Spiral"].path == str(file)
    assert as_used("spiral.py:Spiral", files) == f"{file}:Spiral"
    written(tmp_path, "spiral.py", HANDLER + "# edited\n")
    with pytest.raises(BadInput, match=r"out: spiral\.py has changed since; restore it, or give another folder$"):
        wayfarer.run_campaign("spiral.py:Spiral", trials=1, out=tmp_path / "out", resume=True)

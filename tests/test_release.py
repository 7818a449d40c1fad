"""packaging/release: what it refuses to release, and what its .deb takes from the project."""

from __future__ import annotations

import re
import subprocess
import tomllib
from collections.abc import Iterable
from importlib import import_module
from importlib.machinery import SourceFileLoader
from importlib.metadata import requires
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
CHANGELOG = "# Changelog\n\n## [Unreleased]\n\n## [0.2.0] - 2026-11-25\n\n## [0.1.0] - 2026-11-22\n"
CITATION = "title: wayfarer\nversion: 0.2.0\n"
LIBRARY = re.compile(r"^([\w-]+)==[\w.]+$", re.MULTILINE)


@pytest.fixture(scope="module")
def release() -> Any:
    loader = SourceFileLoader("packaging_release", str(ROOT / "packaging" / "release"))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


@pytest.mark.parametrize("version", ["0.2.0", "1.0.0rc1"])
def test_clean_tag_that_changelog_and_citation_name_is_released(release: Any, version: str) -> None:
    texts = (text.replace("0.2.0", version) for text in (CHANGELOG, CITATION))
    assert release.refuse_unless_release([f"v{version}"], "", *texts) == version


@pytest.mark.parametrize(
    ("tags", "changed", "changelog", "citation", "said"),
    [
        (["v0.2.0"], " M README.md\n?? x\n", CHANGELOG, CITATION, "the checkout has changes: M README.md; commit"),
        ([], "", CHANGELOG, CITATION, r"has 0 tags v\*, not one; git tag -a"),
        (["v0.2.0", "v0.2.1"], "", CHANGELOG, CITATION, r"has 2 tags v\*"),
        (["v0.2"], "", CHANGELOG, CITATION, "the tag v0.2 is no version"),
        (["v0.2.0-rc1"], "", CHANGELOG, CITATION, "the tag v0.2.0-rc1 is no version"),
        (["v0.3.0"], "", CHANGELOG, CITATION, r"newest release is '\[0.2.0\] - 2026-11-25', not '\[0.3.0\] - DATE'"),
        (["v0.1.0"], "", CHANGELOG, CITATION, r"not '\[0.1.0\] - DATE'"),
        (["v0.2.0"], "", CHANGELOG.replace(" - 2026-11-25", ""), CITATION, r"newest release is '\[0.2.0\]', not"),
        (["v0.2.0"], "", "", CITATION, "newest release is"),
        (["v0.2.0"], "", CHANGELOG, CITATION.replace("0.2.0", "0.1.0"), "has no line 'version: 0.2.0'"),
    ],
)
def test_anything_else_is_refused(
    release: Any, tags: list[str], changed: str, changelog: str, citation: str, said: str
) -> None:
    with pytest.raises(release.Refused, match=said):
        release.refuse_unless_release(tags, changed, changelog, citation)


@pytest.mark.parametrize(
    ("version", "debian", "others"),
    [
        ("1.2.3", "1.2.3~deb12", ["wayfarer_1.2.3~rc1~deb12_amd64.deb", "wayfarer_rover-1.2.3rc1.tar.gz"]),
        ("1.2.3", "1.2.3~deb13", ["wayfarer_1.2.30~deb12_arm64.deb", "wayfarer_rover-1.2.30-py3-none-any.whl"]),
        ("1.2.3rc1", "1.2.3~rc1~deb12", ["notes.txt", "wayfarer_1.2.3~deb12_amd64.deb"]),
    ],
)
def test_files_of_another_release_are_told_from_those_of_this_one(
    release: Any, version: str, debian: str, others: list[str]
) -> None:
    ours = [f"wayfarer_rover-{version}{ending}" for ending in (".tar.gz", ".cdx.json", "-py3-none-any.whl")]
    assert release.not_of(version, [*ours, *others, f"wayfarer_{debian}_amd64.deb", "SHA256SUMS"]) == others


def test_extension_of_a_cross_compiler_is_named_for_aarch64(release: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.uname", lambda: SimpleNamespace(machine="x86_64"))
    environment = release.for_aarch64(".cpython-313-x86_64-linux-gnu.so")
    assert environment["SETUPTOOLS_EXT_SUFFIX"] == ".cpython-313-aarch64-linux-gnu.so"
    assert environment["LDSHARED"].split()[0] == environment["CC"]


def test_debian_package_has_every_library_that_wayfarer_needs() -> None:
    text = (ROOT / "packaging" / "debian" / "requirements.txt").read_text(encoding="utf-8")
    inside = {name.replace("_", "-").lower() for name in LIBRARY.findall(text)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = names(project["dependencies"] + project["optional-dependencies"]["live"])
    assert {"pydantic", "aiohttp"} <= needed
    assert {*needed, *names(needs("aiohttp")), *names(needs("yarl")), "smbus2"} <= inside


def names(requirements: Iterable[str]) -> set[str]:
    return {re.split(r"[^\w-]", each)[0].replace("_", "-").lower() for each in requirements}


def needs(library: str) -> list[str]:
    """What a library needs on the Pythons of the package, whose oldest is 3.11."""
    old_or_optional = ('python_version < "3.11"', "extra ==")
    return [each for each in requires(library) or () if not any(words in each for words in old_or_optional)]


def test_pure_debian_package_has_or_takes_every_library_that_wayfarer_needs(release: Any) -> None:
    text = (ROOT / "packaging" / "debian" / "requirements.txt").read_text(encoding="utf-8")
    inside = set(LIBRARY.findall(release.not_of_debian(text)))
    project = release.PROJECT
    needed = names(project["dependencies"] + project["optional-dependencies"]["live"])
    assert needed <= inside | set(release.OF_DEBIAN)
    assert "python3-pydantic (>= 2.7)" in release.depends("3.13", "all")
    assert "python3-aiohttp (>= 3.9)" in release.depends("3.13", "all")
    assert release.depends("3.13", "arm64").startswith("python3 (>= 3.13), python3 (<< 3.14), ")


def test_debhelper_neither_stops_nor_restarts_a_rover() -> None:
    """Its restart would follow a refused upgrade, too; tests/debian/run shows what the package does instead."""
    rules = (ROOT / "packaging" / "debian" / "rules").read_text(encoding="utf-8")
    flags = re.findall(r"^\tdh_installsystemd (.*)$", rules, re.MULTILINE)
    assert [set(each.split()) for each in flags] == [
        {"--no-enable", "--no-start", "--no-restart-after-upgrade", "--no-stop-on-upgrade"}
    ]


def test_the_container_s_test_builds_by_what_the_release_has(release: Any) -> None:
    """tests/debian/run takes minutes and root, so it is not run here; a renamed step would be noticed late."""
    text = (ROOT / "tests" / "debian" / "run").read_text(encoding="utf-8")
    used = set(re.findall(r"\bmaking\.(\w+)", text))
    assert "debian_package" in used
    assert [name for name in used if name != "dist" and not hasattr(release.Release, name)] == []


@pytest.mark.process
@pytest.mark.parametrize(
    ("status", "refused"),
    [
        ('{"mode": "disarmed", "why_disarmed": "the mode was armed"}', ""),
        ('{"why_disarmed": null, "mode": "armed"}', "armed"),
        ('{"mode": "manual"}', "manual"),
        ("", ""),
    ],
)
def test_removal_is_refused_by_the_mode_of_now(tmp_path: Path, status: str, refused: str) -> None:
    script = (ROOT / "packaging" / "debian" / "wayfarer.prerm").read_text(encoding="utf-8")
    (tmp_path / "status").write_text(status, encoding="utf-8")
    script = script.replace("/usr/bin/wayfarer status --json", f"cat {tmp_path / 'status'}")
    decides = script.partition("if [ -d /run/systemd/system ]")[0]
    there_is_no_service = "systemctl() { return 3; }\n"
    done = subprocess.run(
        ["sh", "-c", f"{there_is_no_service}{decides}leave_an_armed_rover_alone"],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == (1 if refused else 0), done.stderr
    assert done.stderr.startswith(f"wayfarer: the rover is {refused}, so" if refused else "")
    assert refused or done.stderr == ""


@pytest.mark.parametrize("taken", ["docs", "examples"])
def test_debian_package_takes_files_that_are_there(taken: str) -> None:
    patterns = (ROOT / "packaging" / "debian" / f"wayfarer.{taken}").read_text(encoding="utf-8").split()
    assert patterns
    assert [pattern for pattern in patterns if not any(ROOT.glob(pattern))] == []


def test_launcher_of_the_debian_package_starts_the_command() -> None:
    launcher = (ROOT / "packaging" / "debian" / "launcher").read_text(encoding="utf-8")
    module = re.findall(r"-c 'from ([\w.]+) import main; main\(\)'", launcher)
    assert callable(import_module(module[0]).main)

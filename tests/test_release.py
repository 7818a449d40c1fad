"""packaging/release: what it refuses to release, and what its .deb takes from the project."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from importlib.machinery import SourceFileLoader
from importlib.metadata import requires
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from socket import AF_UNIX, SHUT_RDWR, socket
from threading import Thread
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


DEBIAN = ROOT / "packaging" / "debian"


@contextmanager
def answering(path: Path, status: dict[str, object]) -> Iterator[None]:
    """Stand in for a daemon that is asked once for its status."""
    path.parent.mkdir(parents=True)
    with socket(AF_UNIX) as listening:
        listening.bind(str(path))
        listening.listen()

        def answer() -> None:
            with suppress(OSError), listening.accept()[0] as client:
                client.recv(8192)
                client.sendall(json.dumps({"ok": True, **status}).encode() + b"\n")

        thread = Thread(target=answer)
        thread.start()
        yield
        with suppress(OSError):
            listening.shutdown(SHUT_RDWR)  # wakes a thread that nobody has asked
        thread.join()


@pytest.mark.process
@pytest.mark.parametrize(
    ("status", "refused"),
    [
        ({"mode": "disarmed", "why_disarmed": "the mode was armed"}, ""),
        ({"why_disarmed": None, "mode": "armed"}, "armed"),
        ({"mode": "manual"}, "manual"),
        (None, ""),
    ],
)
@pytest.mark.parametrize("whose", ["service", "user"])
def test_removal_is_refused_by_the_mode_of_now_of_the_service_and_not_of_a_user_s_daemon(
    tmp_path: Path, status: dict[str, object] | None, refused: str, whose: str
) -> None:
    service, user = tmp_path / "wayfarer" / "control.sock", tmp_path / "user" / "wayfarer" / "control.sock"
    (tmp_path / "user").mkdir(mode=0o700)
    script = (DEBIAN / "wayfarer.prerm").read_text(encoding="utf-8")
    script = script.replace("/run/wayfarer/control.sock", str(service)).replace("/usr/lib/wayfarer", str(ROOT))
    script = script.replace("python3 -Ic", f"{sys.executable} -Ic")
    decides = script.partition("if [ -d /run/systemd/system ]")[0]
    there_is_no_service = "systemctl() { return 3; }\n"
    answers = answering(service if whose == "service" else user, status) if status else nullcontext()
    refused = refused if whose == "service" else ""
    with answers:
        done = subprocess.run(
            ["sh", "-c", f"{there_is_no_service}{decides}leave_an_armed_rover_alone"],
            env={**os.environ, "XDG_RUNTIME_DIR": str(user.parents[1])},
            stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == (1 if refused else 0), done.stderr
    assert done.stderr.startswith(f"wayfarer: the rover is {refused}, so" if refused else "")
    assert refused or done.stderr == ""


@pytest.mark.process
def test_purge_deletes_what_was_written_and_no_file_system_that_is_mounted_there(tmp_path: Path) -> None:
    kept, link = tmp_path / "etc" / "wayfarer", tmp_path / "var" / "lib" / "wayfarer"
    elsewhere, tools = tmp_path / "elsewhere", tmp_path / "tools"
    for folder in (kept, link.parent, elsewhere, tools):
        folder.mkdir(parents=True)
    (kept / "rover \\n-e.toml").touch()
    (elsewhere / "log").touch()
    link.symlink_to(elsewhere)
    (tools / "rm").write_text(f'#!/bin/sh\nprintf "%s\\n" "$*" >>{tmp_path}/rm; exec /bin/rm "$@"\n', encoding="utf-8")
    (tools / "rm").chmod(0o755)
    script = (DEBIAN / "wayfarer.postrm").read_text(encoding="utf-8")
    script = (
        script.replace("/var/lib", f"{tmp_path}/var/lib").replace("/etc/wayfarer", str(kept)).replace("userdel", ":")
    )
    path = f"{tools}:{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-c", script, "postrm", "purge"], env={"PATH": path}, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == [
        f"wayfarer: deleting {link}: 1 files, {done.stdout.split()[5]}",
        f"wayfarer: deleting {kept}: 1 files, {done.stdout.split()[-1]}",
    ]
    assert not kept.exists() and not link.is_symlink() and (elsewhere / "log").exists()
    assert all(line.startswith("-rf --one-file-system /") for line in (tmp_path / "rm").read_text().splitlines())


@pytest.mark.parametrize("name", ["postinst", "postrm", "prerm"])
def test_scripts_of_the_package_print_any_text_as_it_is(name: str) -> None:
    script = (DEBIAN / f"wayfarer.{name}").read_text(encoding="utf-8")
    assert re.findall(r"^\s*(?:echo|printf (?!'%s\\n')).*", script, re.MULTILINE) == []


@pytest.mark.parametrize("taken", ["docs", "examples"])
def test_debian_package_takes_files_that_are_there(taken: str) -> None:
    patterns = (ROOT / "packaging" / "debian" / f"wayfarer.{taken}").read_text(encoding="utf-8").split()
    assert patterns
    assert [pattern for pattern in patterns if not any(ROOT.glob(pattern))] == []


def test_launcher_of_the_debian_package_starts_the_command() -> None:
    launcher = (ROOT / "packaging" / "debian" / "launcher").read_text(encoding="utf-8")
    module = re.findall(r"-c 'from ([\w.]+) import main; main\(\)'", launcher)
    assert callable(import_module(module[0]).main)

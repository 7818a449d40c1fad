"""Whether the card can be written and keeps the logs, over a tree of system files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.kit.rover import Rig
from wayfarer.commissioning.checks import CheckVerdict, system
from wayfarer.commissioning.checks.system import CardHealth, card_health, card_troubles

ROOT = "22 1 179:2 / / rw,relatime shared:1 - ext4 /dev/mmcblk0p2 rw"
# As Debian's overlayroot mounts it: https://manpages.debian.org/bookworm/overlayroot
OVERLAY = "22 1 0:25 / / rw - overlay overlayroot rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay"
TMPFS = "23 1 0:24 / /media/root-rw rw - tmpfs tmpfs-root rw"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return the system files of a computer with its root on a card."""
    mounts(tmp_path, ROOT)
    return tmp_path


def mounts(root: Path, *lines: str) -> None:
    file = root / "proc/self/mountinfo"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([*lines, ""]), encoding="ascii")


def health(root: Path) -> CardHealth:
    return card_health(Path("/var/lib/wayfarer/field_logs"), root)


@pytest.mark.parametrize(
    ("lines", "memory"),
    [
        ([ROOT], ""),
        ([OVERLAY, TMPFS], "an overlay, as it seems"),
        ([OVERLAY, TMPFS, ROOT.replace(" / / ", " / /var/lib/wayfarer ")], ""),
        ([ROOT, TMPFS.replace("/media/root-rw", "/var/lib")], "tmpfs"),
        ([ROOT, TMPFS.replace("/media/root-rw", "/var\\057lib")], "tmpfs"),
        ([ROOT, TMPFS.replace("/media/root-rw", "/var/li")], ""),
        ([TMPFS.replace("/media/root-rw", "/var/lib"), ROOT.replace(" / / ", " / /var/lib ")], ""),
    ],
)
def test_logs_in_memory_are_noticed(root: Path, lines: list[str], memory: str) -> None:
    mounts(root, *lines)
    assert health(root).disk_memory == memory
    assert [trouble.name for trouble in card_troubles(health(root))] == (["memory"] if memory else [])


def test_computer_that_tells_nothing_is_taken_as_it_is(tmp_path: Path) -> None:
    assert health(tmp_path) == CardHealth()
    assert card_troubles(CardHealth()) == []


@pytest.mark.parametrize(
    "line",
    [
        ROOT.replace("rw,relatime", "ro,relatime"),
        ROOT.removesuffix("rw") + "ro,errors=remount-ro",  # so does the kernel after an error
        ROOT.replace("/dev/mmcblk0p2 rw", " ro"),  # a mount whose source has no name
    ],
)
def test_read_only_disk_and_a_slow_one_are_trouble(root: Path, line: str) -> None:
    mounts(root, line)
    assert [trouble.name for trouble in card_troubles(health(root), sync_ms=2100.0)] == ["read_only", "slow"]
    assert "2.1 s" in card_troubles(CardHealth(), sync_ms=2100.0)[0].text
    assert card_troubles(CardHealth(), sync_ms=500.0) == []


def test_check_warns_of_the_worst_and_passes_a_card_that_is_well(rig: Rig, root: Path) -> None:
    rig.host = replace(rig.host, root=root / "none")
    assert rig.look(system.card).verdict is CheckVerdict.SKIPPED
    rig.host = replace(rig.host, root=root)
    finding = rig.look(system.card)
    assert (finding.verdict, finding.text) == (CheckVerdict.OK, "it can be written and keeps the logs")
    mounts(root, OVERLAY, TMPFS)
    finding = rig.look(system.card)
    assert finding.verdict is CheckVerdict.WARN
    assert finding.text.startswith("the logs are in memory (an overlay, as it seems), lost at power-off")
    assert "partition that is written" in finding.remedy

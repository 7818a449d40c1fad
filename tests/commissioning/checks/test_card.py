"""How worn the card is and whether it keeps the logs, over a tree of system files."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.kit.rover import Rig
from wayfarer.commissioning.checks import CheckVerdict, card
from wayfarer.commissioning.checks.card import CardHealth, card_health, card_troubles

ROOT = "22 1 179:2 / / rw,relatime shared:1 - ext4 /dev/mmcblk0p2 rw"
# As Debian's overlayroot mounts it: https://manpages.debian.org/bookworm/overlayroot
OVERLAY = "22 1 0:25 / / rw - overlay overlayroot rw,lowerdir=/media/root-ro,upperdir=/media/root-rw/overlay"
TMPFS = "23 1 0:24 / /media/root-rw rw - tmpfs tmpfs-root rw"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return the system files of a computer with an eMMC memory of two partitions."""
    partition = tmp_path / "sys/devices/platform/mmc0/block/mmcblk0/mmcblk0p2"
    write(partition / "partition", "2\n")
    (tmp_path / "sys/dev/block").mkdir(parents=True)
    (tmp_path / "sys/dev/block/179:2").symlink_to(partition)
    (tmp_path / "media/root-rw/overlay").mkdir(parents=True)
    write(partition.parent / "device/life_time", "0x01 0x02\n")
    write(partition.parent / "device/pre_eol_info", "0x01\n")
    write(tmp_path / "sys/fs/ext4/mmcblk0p2/errors_count", "0\n")
    mounts(tmp_path, ROOT)
    return tmp_path


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="ascii")


def mounts(root: Path, *lines: str) -> None:
    write(root / "proc/self/mountinfo", "\n".join([*lines, ""]))


def health(root: Path) -> CardHealth:
    return card_health(Path("/var/lib/wayfarer/field_logs"), root)


def test_emmc_memory_tells_its_wear_and_the_file_system_its_errors(root: Path) -> None:
    assert health(root) == CardHealth(False, "", 0, 20, False)
    disk = root / "sys/devices/platform/mmc0/block/mmcblk0/device"
    write(disk / "life_time", "0x0b 0x02\n")
    write(disk / "pre_eol_info", "0x02\n")
    write(root / "sys/fs/ext4/mmcblk0p2/errors_count", "7\n")
    assert health(root) == CardHealth(False, "", 7, 110, True)
    assert [trouble.kind for trouble in card_troubles(health(root))] == ["errors", "worn", "spare"]


@pytest.mark.parametrize(
    ("lines", "memory"),
    [
        ([ROOT], ""),
        ([OVERLAY, TMPFS], "tmpfs"),
        ([OVERLAY.replace("/media/root-rw", "/gone")], "an overlay whose upper layer cannot be seen"),
        ([OVERLAY, TMPFS, ROOT.replace(" / / ", " / /var/lib/wayfarer ")], ""),
        ([OVERLAY, ROOT.replace(" / / ", " / /media/root-rw ")], ""),
        ([ROOT, TMPFS.replace("/media/root-rw", "/var/lib")], "tmpfs"),
        ([ROOT, TMPFS.replace("/media/root-rw", "/var/li")], ""),
        ([ROOT, ROOT.replace("179:2 / /", "254:0 / /var\\057lib")], "zram0"),
    ],
)
def test_logs_in_memory_are_noticed_through_an_overlay_too(root: Path, lines: list[str], memory: str) -> None:
    zram = root / "sys/devices/virtual/block/zram0"
    zram.mkdir(parents=True)
    (root / "sys/dev/block/254:0").symlink_to(zram)
    mounts(root, *lines)
    assert health(root).disk_memory == memory
    assert [trouble.kind for trouble in card_troubles(health(root))] == (["memory"] if memory else [])


def test_computer_that_tells_nothing_is_taken_as_it_is(tmp_path: Path) -> None:
    assert health(tmp_path) == CardHealth(disk_read_only=False)
    assert card_troubles(CardHealth()) == []


def test_read_only_disk_and_a_slow_one_are_trouble(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "statvfs", lambda _: SimpleNamespace(f_flag=os.ST_RDONLY))
    assert [trouble.kind for trouble in card_troubles(health(root), sync_ms=2100.0)] == ["read_only", "slow"]
    assert "2.1 s" in card_troubles(CardHealth(), sync_ms=2100.0)[0].found
    assert card_troubles(CardHealth(), sync_ms=500.0) == []


def test_check_warns_of_the_worst_and_passes_a_card_that_is_well(rig: Rig, root: Path) -> None:
    rig.host = replace(rig.host, root=root / "none")
    assert rig.look(card.card).verdict is CheckVerdict.SKIPPED
    rig.host = replace(rig.host, root=root)
    finding = rig.look(card.card)
    assert (finding.verdict, finding.found) == (CheckVerdict.OK, "life used at most 20 %, 0 errors of the file system")
    mounts(root, OVERLAY, TMPFS)
    finding = rig.look(card.card)
    assert finding.verdict is CheckVerdict.WARN
    assert finding.found == "the logs are in memory (tmpfs), lost at power-off"
    assert "partition that is written" in finding.remedy

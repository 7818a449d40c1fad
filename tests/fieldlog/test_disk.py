"""A person is told once what is wrong with the log, and once that it is over."""

from __future__ import annotations

from wayfarer.fieldlog.disk import DiskTrouble


def test_present_trouble_is_known_until_it_is_over() -> None:
    trouble = DiskTrouble(lambda _: None)
    assert trouble.now is None
    trouble.begins("disk", "the disk is full; the rover drives on")
    trouble.begins("queue", "the disk does not answer")
    assert trouble.now == "the disk is full"
    trouble.ends("disk", 1)
    assert trouble.now == "the disk does not answer"
    trouble.ends("queue", 1)
    assert trouble.now is None


def test_each_kind_of_trouble_is_told_once_until_all_of_it_is_over() -> None:
    told: list[str] = []
    trouble = DiskTrouble(told.append)
    trouble.ends("disk", 3)
    for _ in range(3):
        trouble.begins("queue", "the disk does not answer")
        trouble.begins("disk", "the disk is full")
    trouble.ends("queue", 10)
    trouble.ends("queue", 11)
    assert told == ["the disk does not answer", "the disk is full"]
    trouble.ends("disk", 12)
    trouble.ends("disk", 12)
    assert told[2:] == ["the field log is written again; records missing: 9"]
    trouble.begins("disk", "the disk is full")
    trouble.ends("disk", 14)
    assert told[3:] == ["the disk is full", "the field log is written again; records missing: 2"]

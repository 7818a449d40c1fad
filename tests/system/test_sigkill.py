"""The daemon is killed at random instants. More often:
``KILLS=200 pytest -n 0 -m long -s tests/system/test_sigkill.py``.
"""

from __future__ import annotations

import os
from random import Random

import pytest

from tests.system.hil_setup import DEADMAN_S, Site
from tests.system.killer import LIVES, Killer

KILLS = int(os.environ.get("KILLS", "12"))  # half of them on each rover; each takes about three seconds


@pytest.mark.long
@pytest.mark.parametrize("site", sorted(DEADMAN_S), indirect=True)
def test_every_kill_leaves_standing_wheels_and_a_whole_log(site: Site) -> None:
    killer = Killer(site, Random(12))
    turned = [killer.kill(LIVES[number % len(LIVES)]) for number in range(KILLS // 2)]
    killer.up()
    assert sum(turned) >= len(turned) // 3, "most of those that were killed while they drove"

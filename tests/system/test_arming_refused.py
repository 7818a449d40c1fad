"""What is wrong with a rover before it drives: arming is refused, for a reason that says what to do."""

from __future__ import annotations

import pytest

from tests.system.hil_setup import PATIENCE_S, UNPROVED, Site, wait_for
from tests.system.measures import told_to_turn
from wayfarer.commissioning.checks.deadman import board_settings
from wayfarer.config.calibration_file import FILE_NAME, Calibration, DeadmanEntry, save, stamp
from wayfarer.config.rover_file import load_rover
from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.fieldlog.clock import wall_clock


@pytest.mark.parametrize("site", ["minirover"], indirect=True)
def test_board_that_does_not_acknowledge_its_failsafe_is_not_armed(site: Site) -> None:
    site.daemon()
    begins_s = site.bench("inject", target="motors", kind="failsafe_off")["t_s"]
    is_refused(site, "failsafe")
    assert site.status()["mode"] == "disarmed"
    assert not told_to_turn(site.commands(begins_s))


def test_sabertooth_is_armed_only_with_a_proof_of_its_deadman(site: Site) -> None:
    """A daemon reads the calibration when it starts: it may not run while the proof is made."""
    site.config.write_text(site.config.read_text("utf-8").replace(UNPROVED, ""), encoding="utf-8")
    daemon = site.daemon()
    is_refused(site, "nobody has seen", "wayfarer check")
    proof, seen = board_settings(load_rover(str(site.config))), stamp("Sabertooth", wall_clock(0.0))
    for settings in ({**proof, "timeout_s": 0.5}, proof):
        daemon.terminate()
        assert daemon.wait(PATIENCE_S) == 0
        save(site.folder / FILE_NAME, Calibration(deadman=DeadmanEntry(**seen, settings=settings)))
        daemon = site.daemon()
        if settings != proof:
            is_refused(site, "timeout_s = 0.5 (now 0.3)", "wayfarer check")
    assert not told_to_turn(site.commands())
    site.ask("arm", heading_deg=0.0)
    wait_for("the wheels turn", lambda: site.drives)


def is_refused(site: Site, *wanted: str) -> None:
    """Arming is refused, and the reason says all of this."""
    with pytest.raises(RequestRefused) as refused:
        site.ask("arm", heading_deg=0.0)
    assert [part for part in wanted if part not in str(refused.value)] == [], refused.value

"""The page in a real browser, over real daemons."""

# ruff: noqa: TID251 - a person's clock
from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from tests.browser import DESKTOP, PHONE, SIZES, Opened, OpenPage
from tests.remote.live.contrast import texts, weak_texts
from tests.remote.live.daemons import Daemon, running

if TYPE_CHECKING:
    from playwright.sync_api import FloatRect

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process

NARROW = (360, 640)
LANDSCAPE = (640, 360)  # a telephone on its side
STOP_S = 0.2
BLANK = "\N{EN DASH}"
ARMED = re.compile("^Armed")  # not disarmed


@pytest.fixture
def daemon() -> Iterator[Daemon]:
    with running("run", "--sim", "--live", "--live-port", "0") as found:
        yield found


def look(browser_page: OpenPage, daemon: Daemon, viewport: tuple[int, int] = DESKTOP) -> Opened:
    """Open the page and wait until it is alive."""
    opened = browser_page(viewport)
    opened.page.goto(daemon.url)
    alive(opened)
    others = opened.page.locator("#demo, #next, #manual, #how-to-drive").locator("visible=true")
    assert not others.count(), "only a demo has such buttons, or a run in which a person may drive"
    return opened


def alive(opened: Opened) -> None:
    opened.page.locator("body:not(.stale)").wait_for()
    opened.page.locator("#age", has_text="live").wait_for()


def text(opened: Opened, where: str) -> str:
    return opened.page.locator(where).inner_text()


def test_stop_on_the_page_stops_the_wheels_at_once(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon, PHONE)
    daemon.arm()
    opened.page.locator("#mode", has_text=ARMED).wait_for()
    opened.page.evaluate("addEventListener('click', () => { document.body.dataset.pressed = Date.now() }, true)")
    opened.page.locator("#stop").click()
    opened.page.locator("#banner", has_text="The run has ended").wait_for()
    assert daemon.process.wait(timeout=5) == 0
    pressed_s = float(opened.page.locator("body").get_attribute("data-pressed") or "nan") / 1e3
    records = daemon.log()
    driven_s = [r["t_wall"] for r in records if r["record"] == "tick" and (r["applied_left"] or r["applied_right"])]
    (stopped_s,) = [r["t_wall"] for r in records if r.get("name") == "wheels_stopped"]
    assert driven_s[-1] > pressed_s - 0.5, "it drove when Stop was pressed"
    print(f"wheels stopped {1e3 * (stopped_s - pressed_s):.0f} ms after Stop was pressed")
    assert max(stopped_s, driven_s[-1]) - pressed_s < STOP_S
    assert opened.trouble == []


def test_hold_resume_and_mark_work_from_the_keyboard(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon)
    page = opened.page
    daemon.arm()
    page.locator("#mode", has_text=ARMED).wait_for()
    page.locator("#hold").press("Enter")
    page.locator("#mode", has_text="Held").wait_for()
    page.locator("#health", has_text="an operator asked to hold").wait_for()
    page.locator("#health", has_text="until Resume").wait_for()
    page.locator("#resume").press("Enter")
    page.locator("#mode", has_text=ARMED).wait_for()
    assert page.locator("#resume").is_hidden()
    assert page.locator("#how-to-resume").is_hidden()
    page.locator("#mark").press_sequentially("<b>hit</b> log")
    page.locator("#mark").press("Enter")
    page.locator("#lines li", has_text="<b>hit</b> log").wait_for()
    assert page.locator("#mark").input_value() == ""
    assert daemon.ask("status")["mode"] == "armed"
    assert opened.trouble == []


@SIZES
def test_page_without_the_token_can_hold_but_not_resume(
    browser_page: OpenPage, daemon: Daemon, viewport: tuple[int, int]
) -> None:
    opened = browser_page(viewport)
    page = opened.page
    page.goto(daemon.origin)
    alive(opened)
    daemon.arm()
    page.locator("#hold").click()
    page.locator("#how-to-resume", has_text="wayfarer status").wait_for()
    assert page.locator("#resume").is_hidden()
    assert (weak_texts(page), opened.overflow_px()) == ([], 0)
    page.goto(daemon.ask("status")["live_page"])
    page.locator("#resume").click()
    page.locator("#mode", has_text=ARMED).wait_for()
    assert opened.trouble == []


def test_token_stays_in_the_tab_and_nowhere_else(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon)
    page = opened.page
    token = daemon.url.partition("?token=")[2]
    for _ in range(2):
        assert page.url == f"{daemon.origin}/"
        assert token not in page.title() + page.content()
        assert page.context.cookies() == []
        assert page.evaluate("Object.values(localStorage)") == []
        page.reload()
        alive(opened)
    daemon.arm()
    page.locator("#hold").click()
    page.locator("#resume").click()
    page.locator("#mode", has_text=ARMED).wait_for()


def test_page_from_another_computer_needs_the_token_for_everything(browser_page: OpenPage) -> None:
    with running("run", "--sim", "--live", "--live-host", "0.0.0.0", "--live-port", "0") as daemon:
        if daemon.origin.startswith("http://127."):
            pytest.skip("this computer has no other address")
        opened = look(browser_page, daemon)
        opened.page.reload()
        alive(opened)
        bare = browser_page(PHONE)
        bare.page.goto(daemon.origin)
        bare.page.locator("#banner", has_text="open the address that it printed").wait_for()
        assert [text(bare, each) for each in ("#rover", "#mode", "#age")] == ["wayfarer", "not connected", "connecting"]
        assert bare.overflow_px() == 0


def test_daemon_that_is_killed_is_noticed_at_once_and_the_page_comes_back_with_the_next_one(
    browser_page: OpenPage, daemon: Daemon
) -> None:
    opened = look(browser_page, daemon)
    daemon.process.kill()
    stop_at = opened.page.locator("#stop").bounding_box()
    killed_s = time.monotonic()
    opened.page.locator("body.stale").wait_for(timeout=2000)
    opened.page.locator("#banner", has_text="No connection to the rover. What you see is").wait_for(timeout=2000)
    print(f"shown {1e3 * (time.monotonic() - killed_s):.0f} ms after the daemon was killed")
    opened.page.locator("#stop").click()
    assert "Not sent" in text(opened, "#reply")
    assert opened.page.locator("#stop").bounding_box() == stop_at, "neither the banner nor the reply moves Stop"
    with running("run", "--sim", "--live", "--live-port", str(daemon.port)):
        alive(opened)
        assert opened.page.locator("#banner").is_hidden()
        assert text(opened, "#reply") == "", "the new run was asked for nothing"


def test_pressing_hold_twice_holds(browser_page: OpenPage, daemon: Daemon) -> None:
    page = look(browser_page, daemon, PHONE).page
    daemon.arm()
    page.locator("#mode", has_text=ARMED).wait_for()
    hold, stop_at = page.locator("#hold").bounding_box(), page.locator("#stop").bounding_box()
    assert hold is not None
    middle = (hold["x"] + hold["width"] / 2, hold["y"] + hold["height"] / 2)
    page.mouse.dblclick(*middle)
    page.locator("#resume").wait_for()
    page.mouse.click(*middle)
    page.locator("#reply", has_text="Held").wait_for()
    assert daemon.ask("status")["held"] is True
    assert page.locator("#stop").bounding_box() == stop_at


def test_resume_on_a_page_that_is_old_starts_no_wheels_later(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon)
    daemon.arm()
    opened.page.locator("#hold").click()
    opened.page.locator("#resume").wait_for()
    daemon.process.send_signal(signal.SIGSTOP)
    opened.page.locator("#banner", has_text="No data from the rover").wait_for(timeout=3000)
    assert text(opened, "#age").startswith("old")
    assert opened.page.locator("#resume").is_disabled()
    assert opened.page.locator("#send-mark").is_disabled()
    opened.page.locator("#resume").click(force=True)
    opened.page.locator("#hold").click()
    opened.page.locator("#reply", has_text="Hold: no answer yet").wait_for()
    daemon.process.send_signal(signal.SIGCONT)
    opened.page.locator("#reply", has_text="Held").wait_for()
    alive(opened)
    assert daemon.ask("status")["held"] is True


def test_network_that_goes_away_is_noticed_and_its_return_as_well(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon, PHONE)
    opened.page.context.set_offline(True)
    opened.page.locator("#banner", has_text="No connection").wait_for(timeout=3000)
    opened.page.context.set_offline(False)
    alive(opened)
    assert opened.page.locator("#banner").is_hidden()


def test_banner_of_a_lost_connection_never_covers_stop(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon)
    daemon.process.kill()
    opened.page.locator("#banner", has_text="If wayfarer was restarted").wait_for(timeout=20_000)  # its longest text
    for width, height in (DESKTOP, (900, 700), PHONE, NARROW, LANDSCAPE):
        opened.page.set_viewport_size({"width": width, "height": height})
        banner, stop = opened.page.locator("#banner").bounding_box(), opened.page.locator("#stop").bounding_box()
        assert banner is not None
        assert stop is not None
        assert not overlap(banner, stop), (width, height)
        assert stop["y"] + stop["height"] <= height, "without scrolling"
        assert (
            opened.page.evaluate(
                "([x, y]) => document.elementFromPoint(x, y).id",
                [stop["x"] + stop["width"] / 2, stop["y"] + stop["height"] / 2],
            )
            == "stop"
        )
        assert opened.overflow_px() == 0


def overlap(one: FloatRect, other: FloatRect) -> bool:
    """Whether two boxes have an area in common."""
    return all(
        one[at] < other[at] + other[size] and other[at] < one[at] + one[size]  # type: ignore[literal-required]
        for at, size in (("x", "width"), ("y", "height"))
    )


def test_disarmed_page_says_how_to_arm_in_place_of_a_button_that_would_be_refused(
    browser_page: OpenPage, daemon: Daemon
) -> None:
    page = look(browser_page, daemon, NARROW).page
    page.locator("#how-to-arm", has_text="wayfarer arm").wait_for()
    assert page.locator("#hold").is_hidden()
    stop_at = page.locator("#stop").bounding_box()
    daemon.arm()
    page.locator("#hold").wait_for()
    assert page.locator("#how-to-arm").is_hidden()
    daemon.ask("disarm")
    page.locator("#how-to-arm").wait_for()
    daemon.process.send_signal(signal.SIGSTOP)
    page.locator("#hold").wait_for(timeout=3000)  # a page that is old does not know
    assert page.locator("#stop").bounding_box() == stop_at
    daemon.process.send_signal(signal.SIGCONT)


def test_log_is_in_words_controls_have_names_and_states_are_spoken(browser_page: OpenPage, daemon: Daemon) -> None:
    page = look(browser_page, daemon).page
    daemon.arm()
    page.locator("#lines li", has_text="Backing off: stalled").wait_for(timeout=60_000)
    lines = page.locator("#lines li span").all_inner_texts()
    assert any(line.startswith("Armed: drives towards 0 degrees") for line in lines)
    in_words = [line for line in lines if "stood still" not in line]  # that names functions, on a busy computer
    assert [line for line in in_words if "_" in line] == []
    for role, name in (
        ("button", "Stop"),
        ("button", "Hold"),
        ("textbox", "Mark: a note"),
        ("img", "Map"),
        ("log", ""),
    ):
        assert page.get_by_role(role, name=name).count() >= 1, (role, name)  # type: ignore[arg-type]
    assert page.locator("[aria-live=polite] #mode").count() == 1
    assert page.locator("#banner").get_attribute("role") == "alert"


def test_everything_can_be_read_in_sunlight_and_fits(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon)
    page = opened.page
    daemon.arm()
    daemon.ask("mark", text="a note with averyveryveryveryveryveryveryveryveryveryveryveryverylongword in it")
    page.locator("#lines li", has_text="mark").wait_for()
    assert len(texts(page)) > 40
    assert_readable(opened)
    daemon.process.kill()
    page.locator("body.stale").wait_for()
    assert_readable(opened)


def assert_readable(opened: Opened) -> None:
    """Check contrast, the size and the place of what stops the rover, and that nothing is wider than the window."""
    page = opened.page
    for width, height in (NARROW, PHONE, DESKTOP):
        page.set_viewport_size({"width": width, "height": height})
        for name in ("#stop", "#hold"):
            box = page.locator(name).bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 60, "for gloves"
            assert box["y"] + box["height"] <= height, "without scrolling"
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            assert (weak_texts(page), opened.overflow_px()) == ([], 0), (width, scheme)


def test_end_can_be_read_as_well(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = look(browser_page, daemon, NARROW)
    daemon.ask("stop")
    opened.page.locator("#banner.plain", has_text="The run has ended").wait_for()
    assert (text(opened, "#wheels"), text(opened, "#health")) == (BLANK, "")
    assert opened.page.locator("#sensor-rows td:nth-child(2)").all_inner_texts() == [BLANK, BLANK]
    assert (weak_texts(opened.page), opened.overflow_px()) == ([], 0)
    opened.page.locator("#again").click()
    opened.page.locator("#banner", has_text="There is no new one yet").wait_for()

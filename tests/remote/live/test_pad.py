"""The pad in a real browser, over a real daemon: what drives, and everything that must stop the wheels."""

# ruff: noqa: TID251 - a person's clock
from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.browser import DESKTOP, PHONE, Opened, OpenPage
from tests.remote.live.contrast import weak_texts
from tests.remote.live.daemons import Daemon, poll, running
from tests.remote.live.relay import Relay, relaying

if TYPE_CHECKING:
    from playwright.sync_api import CDPSession, FloatRect, WebSocketRoute

pytest.importorskip("aiohttp", reason="the live page needs aiohttp")
pytestmark = pytest.mark.process

DEADMAN_S = 0.3  # the default of ``[manual]``
TICK_S = 0.05
SLACK_S = 0.15  # a busy computer
NARROW, LANDSCAPE = (360, 640), (640, 360)


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with running("run", "--sim", "--manual", "--live", "--live-port", "0") as found:
        poll(found.sees)
        yield found


@pytest.fixture
def relay(daemon: Daemon) -> Iterator[Relay]:
    with relaying(daemon.port) as found:
        yield found


Turns = Callable[[float, float], bool]  # of the duties, left and right


def any_wheel(left: float, right: float) -> bool:
    return bool(left or right)


class Driver:
    """A person at a page that drives, with one finger."""

    def __init__(self, opened: Opened, daemon: Daemon, port: int | None = None) -> None:
        self.opened, self.page, self.daemon = opened, opened.page, daemon
        self.page.goto(daemon.url.replace(f":{daemon.port}/", f":{port or daemon.port}/"))
        self.page.locator("#age", has_text="live").wait_for()
        self._pad: FloatRect
        self._touch: CDPSession = self.page.context.new_cdp_session(self.page)

    def begin(self) -> None:
        self.page.locator("#drive:enabled").click()
        self.page.locator("#pad").wait_for()

    def drag(self, right: float, up: float) -> None:
        """Put a finger into the middle of the pad, and drag it, in parts of the pad's width."""
        pad = self._pad = self.page.locator("#pad").bounding_box() or self._pad  # or where it was
        x, y = pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2
        self._dispatch("touchStart", (x, y))
        self._dispatch("touchMove", (x + right * pad["width"], y - up * pad["width"]))

    def lift(self) -> None:
        self._dispatch("touchEnd")

    def cancel(self) -> None:
        self._dispatch("touchCancel")

    def _dispatch(self, kind: str, *at: tuple[float, float]) -> None:
        self._touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y} for x, y in at]})

    def wheels(self) -> Any:
        return self.daemon.ask("status")["wheels"]

    def drive(self, right: float, up: float, turns: Turns = any_wheel) -> None:
        """Drag until the wheels turn."""
        self.turn(lambda: self.drag(right, up), self.lift, turns)

    def turn(self, press: Callable[[], object], release: Callable[[], object], turns: Turns = any_wheel) -> None:
        """Press until the wheels turn, in a certain way.

        A late tick, or samples that are late, stop them until everything was released: only after these, which a busy
        computer has, it presses again.
        """
        for _ in range(5):
            late, said = self._late_ticks(), set[str]()
            press()
            ends_s = time.monotonic() + 3.0
            while time.monotonic() < ends_s:
                if turns(*self.wheels()):
                    return
                said.add(self.page.locator("#link").inner_text())
            if self._late_ticks() == late and not any("too slow" in text or "no answer" in text for text in said):
                break
            release()
            time.sleep(0.3)
        pytest.fail(f"the page says {said}, the rover {self.daemon.ask('status')}")

    def _late_ticks(self) -> int:
        return sum(record.get("cause") == "tick_late" for record in self.daemon.log())

    def stand(self) -> float:
        """Wait until the wheels are stopped, and return how long that took, in seconds."""
        began_s = time.monotonic()
        poll(lambda: not any(self.wheels()), 3.0)
        return time.monotonic() - began_s


@pytest.fixture
def driver(browser_page: OpenPage, daemon: Daemon) -> Driver:
    return Driver(browser_page(PHONE, touch=True), daemon)


def ended(driver: Driver) -> None:
    """Wait until nobody drives, and require that the wheels are stopped and the page says so."""
    driver.page.locator("#drive", has_text="Drive by hand").wait_for()
    driver.page.locator("#mode", has_text="Disarmed").wait_for()
    assert driver.page.locator("#pad").is_hidden()
    assert not any(driver.wheels())


def test_finger_that_drags_drives_and_that_lifts_stops(driver: Driver) -> None:
    driver.begin()
    driver.drive(0.0, 0.3)
    left, right = driver.wheels()
    assert left == pytest.approx(right)
    assert left > 0
    driver.lift()
    assert driver.stand() < TICK_S + SLACK_S
    driver.drive(0.3, 0.0, lambda left, right: left > 0 > right)  # clockwise
    driver.cancel()
    assert driver.stand() < TICK_S + SLACK_S
    driver.page.locator("#drive", has_text="End").click()
    ended(driver)
    assert driver.opened.trouble == []


LETTING_GO: dict[str, Callable[[Driver], object]] = {
    "another window": lambda driver: driver.page.evaluate("dispatchEvent(new Event('blur'))"),
    "turned on its side": lambda driver: driver.page.set_viewport_size({"width": 844, "height": 390}),
    "busy page": lambda driver: driver.page.evaluate(
        "setTimeout(() => { const ends = Date.now() + 900; while (Date.now() < ends); })"
    ),
}


def test_finger_that_stays_drives_no_more_after_what_may_hide_its_release(driver: Driver) -> None:
    driver.begin()
    for name, happens in LETTING_GO.items():
        driver.drive(0.0, 0.3)
        happens(driver)
        assert driver.stand() < DEADMAN_S + TICK_S + SLACK_S, name
        time.sleep(0.3)
        if name != "busy page":  # if the finger is still known
            assert not any(driver.wheels()), name
        driver.lift()


ENDING: dict[str, Callable[[Driver], object]] = {
    "hidden": lambda driver: driver.page.evaluate(
        "Object.defineProperty(document, 'hidden', { value: true, configurable: true }),"
        "document.dispatchEvent(new Event('visibilitychange')), delete document.hidden"
    ),
    "left": lambda driver: driver.page.evaluate("dispatchEvent(new Event('pagehide'))"),
    "escape key": lambda driver: driver.page.keyboard.press("Escape"),
    "held elsewhere": lambda driver: driver.daemon.ask("hold"),
    "loaded again": lambda driver: driver.page.reload(),
}


def test_driving_ends_with_the_page_and_by_anybody(driver: Driver) -> None:
    for name, happens in ENDING.items():
        driver.begin()
        driver.drive(0.0, 0.3)
        happens(driver)
        assert driver.stand() < TICK_S + SLACK_S, name
        ended(driver)
        driver.lift()


def test_record_between_the_beginning_and_its_first_tick_does_not_end_driving(
    browser_page: OpenPage, daemon: Daemon
) -> None:
    old_tick: dict[str, Any] = {}
    began_s = math.inf

    def delay_ticks(route: WebSocketRoute) -> None:
        """Keep ticks, but no other records, from the page for 0.3 s after it began to drive."""
        rover = route.connect_to_server()

        def hear(message: str | bytes) -> None:
            nonlocal began_s
            pieces = json.loads(message)
            for piece in pieces:
                state, reply = piece.get("state", {}), piece.get("reply", {})
                if reply.get("do") == "manual_begin":
                    began_s = reply["t_s"]
                elif state and began_s == math.inf:
                    old_tick.update({key: state[key] for key in ("tick_t_s", "mode")})
                elif state and state["t_s"] < began_s + 0.3:
                    state |= old_tick
            route.send(json.dumps(pieces))

        rover.on_message(hear)

    opened = browser_page(PHONE, touch=True)
    opened.page.route_web_socket("**/ws*", delay_ticks)
    driver = Driver(opened, daemon)
    driver.begin()
    driver.drive(0.0, 0.3)
    assert began_s < math.inf
    assert old_tick["mode"] == "disarmed"
    driver.page.locator("#drive", has_text="End").click()
    ended(driver)


def test_second_page_is_refused_and_takes_nothing(driver: Driver, browser_page: OpenPage) -> None:
    driver.begin()
    driver.drive(0.0, 0.3)
    second = Driver(browser_page(PHONE, touch=True), driver.daemon)
    second.page.locator("#mode", has_text="Driven by hand").wait_for()
    second.page.locator("#drive").click()
    second.page.locator("#reply", has_text="Not done").wait_for()
    print(second.page.locator("#reply").inner_text())
    assert second.page.locator("#pad").is_hidden()
    driver.lift()
    driver.drive(0.0, 0.3)
    second.page.locator("#hold").click()
    assert driver.stand() < TICK_S + SLACK_S, "anybody may stop it"
    ended(driver)


def test_network_that_is_cut_stops_the_wheels_and_its_return_does_not_start_them(
    browser_page: OpenPage, daemon: Daemon, relay: Relay
) -> None:
    driver = Driver(browser_page(PHONE, touch=True), daemon, relay.port)
    driver.begin()
    driver.drive(0.0, 0.3)
    relay.set(cut=True)
    took_s = driver.stand()
    print(f"wheels stood {took_s:.2f} s after the network was cut")
    assert took_s < DEADMAN_S + TICK_S + SLACK_S
    driver.page.locator("#reply", has_text="Driving has ended").wait_for()
    relay.set(cut=False)
    driver.page.locator("#age", has_text="live").wait_for()
    ended(driver)
    driver.lift()
    driver.drag(0.0, 0.3)
    time.sleep(0.3)
    assert not any(driver.wheels()), "the button must be pressed first"


@pytest.mark.long
def test_bad_network_drives_in_pieces_and_a_lifted_finger_stops_in_time(
    browser_page: OpenPage, daemon: Daemon, relay: Relay
) -> None:
    driver = Driver(browser_page(PHONE, touch=True), daemon, relay.port)
    driver.begin()
    relay.set(jitter_s=0.15, loss=0.1)  # 0.3 s round trip
    driver.drive(0.0, 0.3)
    turning = []
    ends_s = time.monotonic() + 3.0
    while time.monotonic() < ends_s:
        turning.append(any(driver.wheels()))
        time.sleep(0.02)
    print(f"turned {sum(turning) / len(turning):.0%} of the time: {driver.page.locator('#link').inner_text()}")
    assert any(turning)
    driver.lift()
    assert driver.stand() < DEADMAN_S + TICK_S + SLACK_S


@pytest.mark.long
def test_slow_network_says_why_it_does_not_drive(browser_page: OpenPage, daemon: Daemon, relay: Relay) -> None:
    driver = Driver(browser_page(PHONE, touch=True), daemon, relay.port)
    driver.begin()
    relay.set(delay_s=DEADMAN_S + 0.1)
    driver.page.locator("#link.bad", has_text="The wheels are stopped: the connection is too slow").wait_for()
    driver.drag(0.0, 0.3)
    driver.page.locator("#reply", has_text="Driving has ended").wait_for()
    ended(driver)


def test_keys_drive_while_they_are_held(browser_page: OpenPage, daemon: Daemon) -> None:
    driver = Driver(browser_page(DESKTOP), daemon)
    keyboard = driver.page.keyboard
    keyboard.down("ArrowUp")
    driver.begin()
    keyboard.down("ArrowUp")  # repeats
    time.sleep(0.2)
    assert not any(driver.wheels()), "it was held before"
    keyboard.up("ArrowUp")

    def down(*keys: str) -> None:
        for key in keys:
            keyboard.down(key)

    def up(*keys: str) -> None:
        for key in keys:
            keyboard.up(key)

    driver.turn(lambda: down("KeyW"), lambda: up("KeyW"))
    slow, _ = driver.wheels()
    fast = ("Shift", "KeyW")
    driver.turn(lambda: down(*fast), lambda: up(*fast), lambda left, _: left > 1.5 * slow)
    up(*fast)
    assert driver.stand() < TICK_S + SLACK_S
    driver.turn(lambda: down("KeyA"), lambda: up("KeyA"), lambda left, right: left < 0 < right)
    up("KeyA")
    driver.page.locator("#mark").press_sequentially("wasd")
    assert not any(driver.wheels()), "it is a note"
    driver.page.locator("#drive").click()
    ended(driver)


GAMEPAD = """
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  window.gamepad = { index: 0, connected: true, axes: [0.04, 0, 0, 0], buttons };
  navigator.getGamepads = () => [null, window.gamepad];
"""


def test_gamepad_drives_while_its_shoulder_button_is_held(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = browser_page(DESKTOP)
    opened.page.add_init_script(GAMEPAD)
    driver = Driver(opened, daemon)
    pressed = "gamepad.buttons[4].pressed"
    driver.page.evaluate(f"gamepad.axes[1] = -1, {pressed} = true")
    driver.begin()
    time.sleep(0.2)
    assert not any(driver.wheels()), "its button was held before"
    driver.page.evaluate(f"{pressed} = false")
    time.sleep(0.2)
    driver.page.evaluate(f"{pressed} = true")
    time.sleep(0.2)
    assert not any(driver.wheels()), "its stick was not in the middle"

    def release() -> None:
        driver.page.evaluate(f"gamepad.axes[1] = 0, {pressed} = false")
        time.sleep(0.2)

    release()
    driver.turn(lambda: driver.page.evaluate(f"gamepad.axes[1] = -1, {pressed} = true"), release)
    left, right = driver.wheels()
    assert left == pytest.approx(right), "0.04 is in the dead zone"
    driver.page.evaluate("gamepad.connected = false")
    assert driver.stand() < TICK_S + SLACK_S
    driver.page.locator("#drive").click()
    ended(driver)


def test_page_without_the_token_says_how_to_drive(browser_page: OpenPage, daemon: Daemon) -> None:
    opened = browser_page(PHONE)
    opened.page.goto(daemon.origin)
    opened.page.locator("#how-to-drive", has_text="the address that wayfarer status shows").wait_for()
    assert opened.page.locator("#drive").is_hidden()
    assert (weak_texts(opened.page), opened.overflow_px()) == ([], 0)


def test_pad_can_be_read_and_is_above_stop_at_every_size(browser_page: OpenPage, daemon: Daemon) -> None:
    driver = Driver(browser_page(NARROW), daemon)
    page = driver.page
    for size in (NARROW, PHONE, LANDSCAPE, DESKTOP):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.evaluate("scrollTo(0, 0)")
        driver.begin()
        page.locator("#mode", has_text="Driven by hand").wait_for()
        for name in ("pad", "drive", "stop", "hold"):
            box = page.locator(f"#{name}").bounding_box()
            assert box is not None, (size, name, page.locator("#reply").inner_text())
            assert min(box["width"], box["height"]) >= 48, (size, name)
            middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] - 4]
            assert page.evaluate("([x, y]) => document.elementFromPoint(x, y).id", middle) == name, (size, name)
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme="dark" if scheme == "dark" else "light")
            assert (weak_texts(page), driver.opened.overflow_px()) == ([], 0), (size, scheme)
        page.locator("#drive").click()
        ended(driver)

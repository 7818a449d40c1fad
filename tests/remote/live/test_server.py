"""The page's server, spoken to by a real HTTP client."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import pytest
from yarl import URL

from tests.remote.live.records import run_log, tick
from wayfarer.daemon.socket.protocol import Details, RequestRefused
from wayfarer.errors import BadInput, NotThereYet, WayfarerError
from wayfarer.fieldlog.log import FieldLog
from wayfarer.remote.live import DemoControls
from wayfarer.remote.live.model import LIMITS, ViewerLimits
from wayfarer.remote.live.server import LivePage
from wayfarer.remote.live.session import TURN_S
from wayfarer.safety.permission import Asked

TOKEN = "s3cret"


class Rover:
    """What a page can ask for; keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []
        self.permissions: list[tuple[float, bool]] = []

    async def hold(self) -> Details:
        self.asked.append(("hold", None))
        return {"held": True}

    being_checked = False

    async def resume(self, asked: Asked) -> Details:
        self.permissions.append((asked.at_s, asked.is_there()))
        raise RequestRefused("the rover is not held: there is nothing to resume")

    async def mark(self, text: str, *, keep: bool = True) -> Details:
        self.asked.append(("mark, kept" if keep else "mark", text))
        return {}

    async def stop(self) -> Details:
        self.asked.append(("stop", None))
        return {"log": "logs/1"}

    async def arm(self, asked: Asked, heading_deg: float | None = None, *, without_log: bool = False) -> Details:
        raise AssertionError("armed from a web page")

    async def disarm(self) -> Details:
        raise ZeroDivisionError("a bug")


class Site:
    """A page that is served, with a run that it shows."""

    def __init__(self, page: LivePage, rover: Rover, log: FieldLog, client: aiohttp.ClientSession) -> None:
        self.page, self.rover, self.log, self.client = page, rover, log, client
        self.url = page.url.partition("?")[0].replace("0.0.0.0", "127.0.0.1")
        self.origin = self.url.rstrip("/")

    def connect(self, token: str = TOKEN) -> Any:
        return self.client.ws_connect(f"{self.url}ws?token={token}", headers={"Origin": self.origin})

    @property
    def port(self) -> int:
        return int(self.origin.rpartition(":")[2])

    async def refusal(self, path: str = "ws", **headers: str) -> int:
        """The HTTP status with which a WebSocket is refused."""
        with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
            await self.client.ws_connect(f"{self.url}{path}", headers={"Origin": self.origin, **headers})
        return refused.value.status

    async def answer(self, sent: bytes) -> bytes:
        """The first line of what comes back when bytes are sent as they are."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(sent)
        async with asyncio.timeout(5.0):
            line = await reader.readline()
        writer.close()
        return line


@contextlib.asynccontextmanager
async def serving(
    host: str = "127.0.0.1", limits: ViewerLimits = LIMITS, demo: DemoControls | None = None, rover: Rover | None = None
) -> AsyncIterator[Site]:
    page, rover = LivePage(host, 0, TOKEN, limits, demo), rover or Rover()
    log = run_log(page.show)
    async with aiohttp.ClientSession() as client, page.serving(rover):  # type: ignore[arg-type]
        yield Site(page, rover, log, client)


@pytest.fixture
async def site() -> AsyncIterator[Site]:
    async with serving() as found:
        yield found


@pytest.fixture
def nobody_is_local(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wayfarer.remote.live.access.is_local", lambda _: False)


async def pieces(connection: Any, kind: str, within_s: float = 5.0) -> AsyncIterator[Any]:
    """Give the pieces of a kind as they come, acknowledging each message."""
    seen = 0
    async with asyncio.timeout(within_s):
        async for message in connection:
            told = json.loads(message.data)
            if any("state" in piece for piece in told):
                seen += 1
                await connection.send_json({"seen": seen})
            for piece in told:
                if kind in piece:
                    yield piece[kind]


async def first(connection: Any, kind: str) -> Any:
    async for piece in pieces(connection, kind):
        return piece
    raise AssertionError(f"closed without a {kind}")


# -- the page ----------------------------------------------------------------------------------------------------


async def test_page_is_one_file_that_may_load_nothing_and_run_nothing_else(site: Site) -> None:
    async with site.client.get(site.url) as response:
        html, headers = await response.text(), response.headers
    assert re.findall(r'(?:src|href|srcset|action)="([^"]*)"', html.partition("<script")[0]) == ["data:,"]
    assert (
        re.findall(r"(?:https?:)?//(?!www\.w3\.org/2000/svg)\w[\w.]+", re.sub(r"(?m)^\s*//.*$|// .*$", "", html)) == []
    )
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert (headers["Cache-Control"], headers["Referrer-Policy"]) == ("no-store", "no-referrer")
    assert (response.status, response.content_type) == (200, "text/html")


PATHS = ("favicon.ico", "page/page.css", "ws/", "../server.py", "%2e%2e/server.py", "static/")
METHODS = ("POST", "PUT", "DELETE", "OPTIONS", "HEAD")


@pytest.mark.parametrize(
    ("method", "path"), [*(("GET", path) for path in PATHS), *((method, "") for method in METHODS)]
)
async def test_there_is_nothing_else_and_it_is_only_read(site: Site, method: str, path: str) -> None:
    async with site.client.request(method, URL(site.url + path, encoded=True), data=b"x" * 100) as response:
        assert response.status == 404


async def test_other_name_for_this_computer_is_refused_in_words(site: Site) -> None:
    async with site.client.get(site.url, headers={"Host": "evil.example"}) as response:
        assert response.status == 403
        assert "localhost" in await response.text()


@pytest.mark.usefixtures("nobody_is_local")
async def test_nobody_elsewhere_is_told_anything_without_the_token(site: Site) -> None:
    for path in ("ws", "ws?token=", "ws?token=s3cre", "ws?token=%ff%fe"):
        assert await site.refusal(path) == 403
    assert await site.refusal(Cookie=f"wayfarer-{site.port}={TOKEN}") == 403, "other ports would be sent it"
    async with site.connect() as connection:
        assert (await first(connection, "snapshot"))["about"]["rover"] == "sim"


@pytest.mark.parametrize("query", ["", f"?token={TOKEN}"])
async def test_page_is_the_same_for_everybody_and_leaves_no_cookie(site: Site, query: str) -> None:
    async with site.client.get(site.url) as plain, site.client.get(site.url + query) as response:
        assert await response.text() == await plain.text()
        assert "Set-Cookie" not in response.headers


async def test_who_has_no_token_may_do_everything_but_start_the_wheels_and_keep_the_run(site: Site) -> None:
    for token, why in ((TOKEN, "not held"), ("", "needs the token"), ("s3crets", "needs the token")):
        site.rover.asked.clear()
        async with site.connect(token) as connection:
            assert await first(connection, "may_start") is (token == TOKEN)
            asked_s = asyncio.get_running_loop().time()
            for request in ({"do": "resume", "asked_s": asked_s}, {"do": "mark", "text": "log"}, {"do": "hold"}):
                await connection.send_json(request)
                reply = await first(connection, "reply")
                assert why in reply["why"] if request["do"] == "resume" else reply["ok"], (token, request)
        assert site.rover.asked == [("mark, kept" if token == TOKEN else "mark", "log"), ("hold", None)]


# -- what a page is told and may ask for ---------------------------------------------------------------------------


async def test_viewer_is_told_everything_and_then_what_happens(site: Site) -> None:
    async with site.connect() as connection:
        assert (await first(connection, "snapshot"))["state"]["mode"] == "disarmed"
        site.log.event("arming", 100.0, text="Arming: it drives straight ahead")
        site.log.tick(tick(100.0, mode="arming"))
        async for news in pieces(connection, "news"):
            assert news["lines"][0][1] == "Arming: it drives straight ahead"
            break
        async for state in pieces(connection, "state"):
            if state["mode"] == "arming":
                break


ASKED: list[tuple[dict[str, Any], dict[str, Any], list[Any]]] = [
    ({"do": "hold"}, {"do": "hold", "ok": True, "held": True}, [("hold", None)]),
    ({"do": "stop"}, {"do": "stop", "ok": True}, [("stop", None)]),
    ({"do": "mark", "text": "hit log"}, {"do": "mark", "ok": True}, [("mark, kept", "hit log")]),
    ({"do": "resume"}, {"do": "resume", "ok": False, "why": "an old state"}, []),
    ({"do": "arm"}, {"do": "arm", "ok": False, "why": "not possible from the page"}, []),
    ({"do": "arm", "heading_deg": 0}, {"do": "arm", "ok": False, "why": "not possible from the page"}, []),
    ({"do": "disarm"}, {"do": "disarm", "ok": False, "why": "not possible from the page"}, []),
    ({"do": "mark", "text": "x" * 501}, {"do": "mark", "ok": False, "why": "1 to 500 characters"}, []),
    ({"do": ["stop"]}, {"do": None, "ok": False, "why": "does not say what"}, []),
    ({}, {"do": None, "ok": False, "why": "does not say what"}, []),
]


async def test_page_may_hold_resume_stop_and_mark_and_nothing_else(site: Site) -> None:
    async with site.connect() as connection:
        for request, reply, asked in ASKED:
            site.rover.asked.clear()
            await connection.send_json(request)
            told = await first(connection, "reply")
            assert reply.get("why", "") in told.pop("why", ""), request
            assert told == {key: value for key, value in reply.items() if key != "why"}, request
            assert site.rover.asked == asked, request


async def test_reply_is_for_who_asked(site: Site) -> None:
    async with site.connect() as one, site.connect() as other:
        await one.send_json({"do": "hold"})
        await first(one, "reply")
        await other.send_json({"do": "mark", "text": "mine"})
        assert (await first(other, "reply"))["do"] == "mark"


async def test_nonsense_is_refused_and_the_connection_goes_on(site: Site) -> None:
    async with site.connect() as connection:
        for text in ("", "not JSON", "[]", '"stop"', "[" * 8000, '{"do": "stop"', "\x00"):
            await connection.send_str(text)
            assert (await first(connection, "reply"))["ok"] is False, text
        await connection.send_json({"do": "hold"})
        assert (await first(connection, "reply"))["ok"] is True


async def test_error_inside_is_told_to_the_terminal_and_ends_nothing(
    site: Site, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("wayfarer.remote.live.session.VERBS", ("disarm",))
    async with site.connect() as connection:
        await connection.send_json({"do": "disarm"})
        assert "an error inside wayfarer" in (await first(connection, "reply"))["why"]
    assert "a bug" in caplog.text


# -- bounds ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("send", ["send_str", "send_bytes"])
async def test_message_that_is_too_long_or_no_text_ends_the_connection(site: Site, send: str) -> None:
    too_much = "x" * (LIMITS.message_bytes + 1) if send == "send_str" else b"x"
    async with site.connect() as connection:
        await getattr(connection, send)(too_much)
        async with asyncio.timeout(5.0):
            while (await connection.receive()).type not in {aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED}:
                pass
    assert site.rover.asked == []


async def test_viewers_are_limited_and_a_place_that_is_left_is_free_again() -> None:
    async with serving(limits=LIMITS._replace(viewers=2)) as site:
        looking = [await site.connect(), await site.connect()]
        assert await site.refusal() == 503
        await looking.pop().close()
        async with asyncio.timeout(5.0):
            while True:
                with contextlib.suppress(aiohttp.WSServerHandshakeError):
                    looking.append(await site.connect())
                    break
        assert await first(looking[-1], "snapshot")
        for each in looking:
            await each.close()


async def test_viewers_without_the_token_do_not_keep_the_operator_out() -> None:
    """Any user of the computer may look on; sixteen who do must not take all places."""
    async with serving(limits=LIMITS._replace(viewers=2)) as site:
        looking = [await site.connect(token=""), await site.connect()]
        operator = await site.connect()
        assert await first(operator, "snapshot")
        async with asyncio.timeout(5.0):
            while (await looking[0].receive()).type is aiohttp.WSMsgType.TEXT:
                pass  # what was under way
        assert await first(looking[1], "snapshot"), "who has the token stays"
        assert await site.refusal("ws?token=" + TOKEN) == 503, "and is replaced by nobody"
        for each in (operator, *looking):
            await each.close()


async def test_connections_that_say_nothing_are_limited_and_dropped() -> None:
    async with serving(limits=LIMITS._replace(connections=3, handshake_s=0.2)) as site:
        idle = [await asyncio.open_connection("127.0.0.1", site.port) for _ in range(4)]
        async with asyncio.timeout(5.0):
            assert await idle[0][0].read() == b"", "the fourth takes the place of the first"
            async with site.client.get(site.url) as response:
                assert response.status == 200, "nobody is shut out"
            for reader, _ in idle:
                assert await reader.read() == b"", "the others are dropped when their time is up"
        for _, writer in idle:
            writer.close()
        async with site.client.get(site.url) as response:
            assert response.status == 200


async def test_viewer_that_looks_on_is_not_dropped_with_the_idle() -> None:
    async with serving(limits=LIMITS._replace(handshake_s=0.1)) as site, site.connect() as connection:
        states = 0
        async for _ in pieces(connection, "state"):
            states += 1
            if states == 6:  # half a second
                break
    assert states == 6


@pytest.mark.parametrize(
    "garbage", [b"\x16\x03\x01\x02\x00\x01\x00", b"GET / HTTP/1.1\r\nHost: " + b"x" * 20_000, b"\r\n" * 50]
)
async def test_client_that_speaks_no_http_is_let_go_without_a_word_in_the_log(
    site: Site, garbage: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    reader, writer = await asyncio.open_connection("127.0.0.1", site.port)
    writer.write(garbage)
    writer.write_eof()
    with contextlib.suppress(ConnectionResetError):  # what it did not read
        async with asyncio.timeout(5.0):
            await reader.read()
    writer.close()
    assert capfd.readouterr().err == ""


async def test_flood_of_messages_leaves_time_to_the_loop_and_its_threads(site: Site) -> None:
    """The control tick runs on the same loop: a millisecond is for one message, however many viewers send them."""
    loop = asyncio.get_running_loop()
    async with site.connect() as one, site.connect() as other:
        began_s = loop.time()
        for _ in range(100):
            for connection in (one, other):
                await connection.send_str('{"seen":0}')
        for connection in (one, other):
            await connection.send_json({"do": "hold"})
        for connection in (one, other):
            assert (await first(connection, "reply"))["ok"]
        assert loop.time() - began_s >= 200 * TURN_S


# -- beginning and end ---------------------------------------------------------------------------------------------


async def test_last_words_go_out_before_the_connection_ends() -> None:
    async with serving() as site:
        connection = await site.connect()
        await first(connection, "snapshot")
        site.log.close("escaped", "the rover is out")
        outcome = asyncio.create_task(first(connection, "news"))
    assert (await outcome)["outcome"] == {"reason": "escaped", "text": "the rover is out"}


async def test_viewer_that_does_not_listen_holds_up_no_end() -> None:
    loop = asyncio.get_running_loop()
    async with contextlib.AsyncExitStack() as stack:
        site = await stack.enter_async_context(serving())
        await stack.enter_async_context(site.connect())
        site.log.tick(tick(100.0))
        await asyncio.sleep(0.3)
        began_s = loop.time()
        async with asyncio.timeout(5.0):
            await site.page._end()
        assert loop.time() - began_s < 1.0


async def test_page_that_is_opened_before_the_run_begins_is_answered_then() -> None:
    page = LivePage("127.0.0.1", 0, TOKEN)
    async with aiohttp.ClientSession() as client:
        asking = asyncio.create_task(client.get(page.url))
        await asyncio.sleep(0.05)
        run_log(page.show)
        async with page.serving(Rover()):  # type: ignore[arg-type]
            assert (await asking).status == 200


def test_port_in_use_is_one_line_that_says_what_to_do(taken_port: int) -> None:
    with pytest.raises(NotThereYet, match=rf"^port {taken_port} on 127\.0\.0\.1 is in use.*--live-port$"):
        LivePage("127.0.0.1", taken_port, TOKEN)


@pytest.mark.parametrize(
    ("host", "error"),
    [("192.0.2.77", NotThereYet), ("no-such-host.invalid", NotThereYet), ("a..b", BadInput), ("", BadInput)],
)
def test_address_of_another_computer_is_refused(host: str, error: type[WayfarerError]) -> None:
    with pytest.raises(error, match="--live-host"):
        LivePage(host, 0, TOKEN)


@pytest.mark.parametrize(
    ("host", "pattern"),
    [("127.0.0.1", r"127\.0\.0\.1"), ("localhost", r"127\.0\.0\.1"), ("0.0.0.0", r"(?!0\.0\.0\.0)[^/]+")],
)
def test_address_to_open_has_the_token(host: str, pattern: str) -> None:
    page = LivePage(host, 0, TOKEN)
    assert re.match(rf"http://{pattern}:\d+/\?token={TOKEN}$", page.url)
    page.close()

"""The live page: what a browser, or something that is none, says over HTTP and over a WebSocket."""

from __future__ import annotations

import asyncio
import base64
import logging
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress

from hypothesis import strategies as st

from tests.fuzz.damage import Choices, as_json, bytes_of, json_of
from tests.fuzz.target import Case, Target, Try, reading, shape
from tests.remote.live.records import run_log
from tests.remote.live.test_server import TOKEN, Rover
from wayfarer.remote.live.access import Access
from wayfarer.remote.live.model import LIMITS
from wayfarer.remote.live.server import LivePage

KEY = base64.b64encode(b"0123456789abcdef")
PAGE = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
CONNECT = (
    b"GET /ws HTTP/1.1\r\nHost: localhost\r\nOrigin: http://localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: " + KEY + b"\r\n\r\n"
)
WORDS = [
    b"GET ", b"POST ", b"/ws", b"/?token=", b"HTTP/1.0", b"Host: ", b"[::1]", b"/ws?token=s3cret",
    b"Origin: null\r\n",     b"Transfer-Encoding: chunked\r\n", b"Content-Length: 9\r\n",
    b"Expect: 100-continue\r\n", b"%ff", b"%00", b"//[", b"*",
]  # fmt: skip
MESSAGES = [
    {"seen": 1}, {"do": "hold"}, {"do": "mark", "text": "hit log"}, {"do": "resume", "asked_s": 1.0}, {"do": "stop"},
    {"do": "arm", "heading_deg": 1.0}, {"do": "pause"}, {"do": "speed", "times": 6},
]  # fmt: skip
OPCODES = (1, 1, 1, 1, 1, 0, 2, 8, 9, 10, 3)
CLOSE = bytes([OPCODES.index(8)])
LONG_S = 20.0  # this machine may be busy
QUIET_S = 0.02


def frame(payload: bytes, told: bytes = b"") -> bytes:
    """Return a WebSocket frame (RFC 6455, section 5.2) as a client sends it, or as none should."""
    choices = Choices(told)
    opcode, is_last, length = choices.of(OPCODES), choices.below(8) != 7, len(payload)
    lies = choices.below(16) == 15
    if lies:
        length = choices.of((0, 126, 65_536, 2**62))
    size = bytes([128 | length]) if length < 126 else bytes([254]) + length.to_bytes(2, "big") if length < 65_536 else (
        bytes([255]) + length.to_bytes(8, "big")
    )  # fmt: skip
    mask = b"\x37\xfa\x21\x3d"
    masked = bytes(each ^ mask[place % 4] for place, each in enumerate(payload))
    return bytes([is_last * 128 | opcode]) + size + mask + masked


def _conversations() -> st.SearchStrategy[Case]:
    messages = json_of(MESSAGES, 2).map(as_json) | bytes_of(list(map(as_json, MESSAGES)), [b'"do"', b'"seen"'], 3)
    frames = st.lists(st.builds(frame, messages, st.binary(max_size=4)), max_size=5).map(b"".join)
    sent = st.builds(lambda sent, end: CONNECT + sent + end, frames, st.sampled_from((frame(b"", CLOSE), b"")))
    return bytes_of([PAGE, CONNECT], WORDS, 4) | sent


class Bugs(logging.Handler):
    """Keeps what the page says of errors inside it."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(logging.Formatter().format(record))


@contextmanager
def _shown() -> Iterator[Try]:
    bugs, logger = Bugs(), logging.getLogger("wayfarer.remote.live")
    logger.addHandler(bugs)
    with asyncio.Runner() as runner:
        runner.get_loop().set_exception_handler(lambda _, context: bugs.said.append(str(context)))
        limits = LIMITS._replace(requests=10**9)
        page = LivePage("127.0.0.1", 0, TOKEN, limits=limits)
        port = page._socket.getsockname()[1]
        serving = page.serving(Rover())  # type: ignore[arg-type]
        run_log(page.show)
        runner.run(serving.__aenter__())

        def attempt(sent: bytes) -> str:
            bugs.said.clear()
            said = runner.run(_sent(port, sent))
            assert not bugs.said, bugs.said
            return said

        yield attempt
        runner.run(serving.__aexit__(None, None, None))
    logger.removeHandler(bugs)


async def _sent(port: int, sent: bytes) -> str:
    """Send bytes, then see that the page is still there."""
    async with asyncio.timeout(LONG_S):
        said = await _exchanged(port, sent, QUIET_S)
        page = await _exchanged(port, PAGE, LONG_S)
    assert page.startswith(b"HTTP/1.1 200 "), page[:80]
    return shape(said[:40].decode("latin-1").partition("\r")[0]) + f" {said.count(b'reply')} replies"


async def _exchanged(port: int, sent: bytes, quiet_s: float) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(sent)
        return await _heard(reader, quiet_s)
    except ConnectionError:
        return b"reset"
    finally:
        writer.transport.abort()


async def _heard(reader: asyncio.StreamReader, quiet_s: float) -> bytes:
    """Return what comes until the server hangs up, or has said nothing for so long: it waits for more."""
    said = b""
    with suppress(TimeoutError):
        while more := await asyncio.wait_for(reader.read(65_536), quiet_s):
            said += more
    return said


LIVE = Target(
    "live",
    _conversations(),
    _shown,
    quick=20,
)  # fmt: skip


# -- who may look on -------------------------------------------------------------------------------------------------

HOSTS = ("localhost", "127.0.0.1", "127.0.0.1:80", "[::1]:80", "::1", "::ffff:127.0.0.1", "[", "1.2.3.4%eth0", "null")
TEXT = st.text(max_size=20) | st.sampled_from((*HOSTS, TOKEN))
HEADERS = st.dictionaries(
    st.sampled_from(("Host", "Origin", "Via", "Forwarded")), TEXT | TEXT.map("http://{}".format)
) | TEXT.map(lambda host: {"Host": host, "Origin": f"http://{host}"})


def _judge(peer: str, headers: dict[str, str], token: str) -> str:
    assert Access(TOKEN).check_socket(peer, headers, token) is (token == TOKEN)
    assert "Via" not in headers and headers["Origin"] == f"http://{headers['Host']}"
    return "is let in"


ACCESS = Target(
    "access",
    st.tuples(TEXT | st.ip_addresses().map(str), HEADERS, TEXT),
    lambda: nullcontext(lambda visitor: reading(lambda: _judge(*visitor))),
)

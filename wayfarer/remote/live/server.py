"""Web server of the live page, on the daemon's loop: the page at ``/`` and a WebSocket at ``/ws``.

It costs the control tick little, with any clients: states go out ten times per second at most, each is encoded
once for all, and all that clients can use up is bounded (``model.ViewerLimits``).
"""

from __future__ import annotations

import asyncio
import json
import logging
from base64 import b64encode
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from hashlib import sha256
from importlib.resources import files
from typing import Any, NamedTuple

from aiohttp import web

from wayfarer.daemon.socket.protocol import Commands, RequestRefused
from wayfarer.fieldlog.record import AnyRecord
from wayfarer.logview import palette
from wayfarer.remote.live import DemoControls
from wayfarer.remote.live.access import Access, address_to_open, bind, check_page
from wayfarer.remote.live.model import LIMITS, Broadcaster, PageModel, PageViewer, ViewerLimits
from wayfarer.remote.live.session import ClientSession
from wayfarer.vocabulary import PHASE_TEXTS

# In this order they make one script; each is about one thing.
SCRIPTS = (
    "words.js", "map.js", "zoom.js", "dial.js", "curves.js", "panel.js", "legend.js", "demo.js",
    "rover_clock.js", "hands.js", "manual.js", "connection.js", "main.js",
)  # fmt: skip


class Document(NamedTuple):
    """The page and its headers."""

    html: bytes
    headers: dict[str, str]


def document() -> Document:
    """Make the page of the files in ``page/``; its own style and script are all that a browser may run."""
    folder = files("wayfarer.remote.live") / "page"
    style = palette.css() + (folder / "page.css").read_text(encoding="utf-8")
    scripts = ((folder / name).read_text(encoding="utf-8") for name in SCRIPTS)
    script = "\n".join([f"const PHASES = {json.dumps(PHASE_TEXTS)};", *scripts])
    html = (folder / "page.html").read_text(encoding="utf-8").replace("/* style */", style)
    policy = (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; connect-src 'self'; img-src data:;"
        " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return Document(
        html.replace("/* script */", script).encode(),
        {
            "Content-Security-Policy": policy,
            "Content-Type": "text/html; charset=utf-8",
            "Cache-Control": "no-store",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Referrer-Policy": "no-referrer",  # the address may hold the token
            "X-Content-Type-Options": "nosniff",
        },
    )


def _hash(text: str) -> str:
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


STATE_S = 0.1
REST_S = 0.02  # between two floods of events
ACCEPT_S = 0.005  # between two connections, each of which takes the loop a millisecond or two; chosen by us
NO_FILES_S = 0.1  # until accepting is tried again, if the process has no file descriptor left for it

_bugs = logging.getLogger("wayfarer.remote.live")
_clients = logging.getLogger("wayfarer.remote.live.clients")  # clients that do not speak HTTP are not reported
_clients.addHandler(logging.NullHandler())
_clients.propagate = False


class LivePage:
    """Shows a run to browsers; implements ``daemon.daemon.Viewer``.

    ``url`` is the address to open.

    Args:
        host: the address to serve at.
        port: 0 takes any that is free.
        token: who starts the wheels, or looks on from another computer, needs it; make a new one at each start.
        limits: bounds on what viewers use.
        demo: the demo that is shown, whose clock the page may change; None for any other run. On this computer it needs
            no token, because no wheels turn; a program that opens a browser would show it in the list of processes.
    """

    def __init__(
        self, host: str, port: int, token: str, limits: ViewerLimits = LIMITS, demo: DemoControls | None = None
    ) -> None:
        self._socket = bind(host, port)
        self.url = address_to_open(self._socket, "" if demo else token)
        self._access = Access(token)
        self._limits = limits
        self._demo = demo
        self._model = PageModel()
        self._broadcaster = Broadcaster(self._snapshot, limits)
        self._page = document()
        self._soon = asyncio.Event()
        self._turn = asyncio.Lock()
        self._sessions: dict[web.RequestHandler, ClientSession] = {}

    def close(self) -> None:
        """Release the port of a page that was never served. Safe twice."""
        self._socket.close()

    def show(self, record: AnyRecord) -> None:
        """Show a record; see ``daemon.daemon.Viewer``."""
        if self._model.add(record):
            self._soon.set()

    @property
    def is_watched(self) -> bool:
        """Whether anybody has the page open."""
        return bool(self._broadcaster.viewers)

    @asynccontextmanager
    async def serving(self, commands: Commands) -> AsyncIterator[None]:
        """Serve while entered; see ``daemon.daemon.Viewer``. The last records are still sent at the end."""
        self._commands = commands
        loop = asyncio.get_running_loop()
        self._http = web.Server(self._answer, access_log=None, logger=_clients, lingering_time=0.0)
        working = (self._accept_all(), self._drop_idle(), self._tell_regularly())
        tasks = [loop.create_task(each, name="live page") for each in working]
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._socket.close()
            await self._end()

    # -- what viewers get ---------------------------------------------------------------------------------------

    async def _tell_regularly(self) -> None:
        try:
            while True:
                with suppress(TimeoutError):
                    async with asyncio.timeout(STATE_S):
                        await self._soon.wait()
                self._soon.clear()
                self._tell()
                await asyncio.sleep(REST_S)
        except Exception:
            _bugs.exception("in sending to viewers: the live page is not updated any more")

    def _tell(self) -> None:
        news = self._model.news()
        if self._broadcaster.viewers:
            self._broadcaster.tell(news, self._state())

    def _state(self) -> dict[str, Any]:
        now = {"now_s": asyncio.get_running_loop().time()}
        if self._demo is not None:
            return self._model.state() | now | {"demo": self._demo.now()._asdict()}
        return self._model.state() | now | {"being_checked": self._commands.being_checked}

    def _snapshot(self) -> dict[str, Any]:
        self._tell()  # what is in the snapshot must not be news afterwards
        return self._model.snapshot() | {"state": self._state()}

    async def _end(self) -> None:
        """Send the last news and close all connections; each of the three steps has a time limit."""
        self._tell()
        limit_s = self._limits.end_s
        with suppress(TimeoutError):
            async with asyncio.timeout(limit_s):
                await asyncio.gather(*(viewer.catch_up() for viewer in self._broadcaster.viewers))
        with suppress(TimeoutError):
            async with asyncio.timeout(limit_s):
                await asyncio.gather(*(session.end("the run has ended") for session in self._sessions.values()))
        for connection in self._http.connections:
            _abort(connection)
        await self._http.shutdown(limit_s)

    # -- connections ---------------------------------------------------------------------------------------------

    async def _accept_all(self) -> None:
        """Accept connections one at a time, with a pause after each: a crowd must not delay the control tick.

        If all places are taken, or no file descriptor is left, the oldest connection that is not a viewer's is closed.
        """
        loop = asyncio.get_running_loop()
        self._socket.setblocking(False)
        while True:
            try:
                connection, _ = await loop.sock_accept(self._socket)
            except (OSError, MemoryError):
                self._make_place()
                await asyncio.sleep(NO_FILES_S)
                continue
            if len(self._open()) < self._limits.connections or self._make_place():
                try:
                    await loop.connect_accepted_socket(self._http, connection)
                except Exception as error:  # for any error, the next client gets in
                    connection.close()
                    if not isinstance(error, OSError | MemoryError):  # it has gone already
                        _bugs.exception("in accepting a connection")
            else:
                connection.close()
            await asyncio.sleep(ACCEPT_S)

    def _open(self) -> list[web.RequestHandler]:
        """Return all connections, those that came first at the start."""
        return [each for each in self._http.connections if each.transport and not each.transport.is_closing()]

    def _make_place(self) -> bool:
        """Close the oldest connection that is not a viewer's, and return whether there was one."""
        idle = next((each for each in self._open() if each not in self._sessions), None)
        if idle is not None:
            _abort(idle)
        return idle is not None

    async def _drop_idle(self) -> None:
        """Close each connection that has not become a viewer's within ``handshake_s``, up to a tenth of it later."""
        limit_s = self._limits.handshake_s
        since_s: dict[web.RequestHandler, float] = {}
        while True:
            now_s = asyncio.get_running_loop().time()
            since_s = {each: since_s.get(each, now_s) for each in self._open() if each not in self._sessions}
            for connection, came_s in since_s.items():
                if now_s - came_s > limit_s:
                    _abort(connection)
            await asyncio.sleep(limit_s / 10.0)

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        try:
            match request.method, request.path:
                case "GET", "/ws":
                    return await self._answer_socket(request)
                case "GET", "/":
                    check_page(request.remote or "", request.headers)
                    response = web.Response(body=self._page.html, headers=self._page.headers)
                    response.force_close()
                    return response
            return _plain(404, "only the page at / and its WebSocket at /ws are served here")
        except RequestRefused as refusal:
            return _plain(403, str(refusal))
        except web.HTTPBadRequest:
            return _plain(400, "only the page itself connects here, with a WebSocket: open / instead")
        except OSError:
            raise  # the client has gone
        except Exception:
            _bugs.exception("in answering %s", request.path)
            return _plain(500, "an error inside wayfarer")

    async def _answer_socket(self, request: web.BaseRequest) -> web.StreamResponse:
        has_token = self._access.check_socket(request.remote or "", request.headers, request.query.get("token", ""))
        limits = self._limits
        if len(self._sessions) >= limits.viewers and not (has_token and self._make_room()):
            return _plain(503, f"{limits.viewers} viewers are connected already, which is the limit")
        socket = web.WebSocketResponse(
            timeout=limits.end_s, compress=False, max_msg_size=limits.message_bytes, autoping=False
        )
        viewer = PageViewer(self._broadcaster, socket.send_str, limits.silent_s, limits.unseen)
        session = self._sessions[request.protocol] = ClientSession(
            socket, request, viewer, self._commands, self._turn, limits, self._demo, has_token or self._demo is not None
        )
        try:
            try:
                await socket.prepare(request)
            except ValueError as error:  # aiohttp does not expect headers that are not text
                raise web.HTTPBadRequest from error
            self._broadcaster.viewers.add(viewer)
            await session.run()
        finally:
            self._broadcaster.viewers.discard(viewer)
            del self._sessions[request.protocol]
        return socket

    def _make_room(self) -> bool:
        """Disconnect the oldest viewer without the token, so that no other user of the computer keeps the operator out.

        Returns whether there was one.
        """
        for connection, session in self._sessions.items():
            if not session.may_start and connection.transport and not connection.transport.is_closing():
                _abort(connection)
                return True
        return False


def _abort(connection: web.RequestHandler) -> None:
    if connection.transport is not None:
        connection.transport.abort()


def _plain(status: int, text: str) -> web.Response:
    response = web.Response(status=status, text=f"wayfarer: {text}\n")
    response.force_close()
    return response

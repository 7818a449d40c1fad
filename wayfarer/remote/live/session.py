"""One viewer's connection: sends updates, and receives a few commands.

Requests are handled as those of the control socket. A page cannot arm: wheels must not start from a web page. Only one
with the token can resume or drive by hand (``ManualLease``), because every user of the rover's computer can open the
page (``access``). An old page cannot either: the request may have waited in a network, or for a blocked daemon, until
the viewer has gone. So its ``asked_s`` is the newest time that the page had from the daemon (``now_s`` of a state). A
demo, where no wheels turn, asks for neither. Only its page can pause or change the speed.

A page that drives never gets its lease. It is kept here, with the connection: no other page can use it, and it ends
when the connection ends. A sample of the pad says when it was taken, on the daemon's clock as the page knows it from
the answers to earlier samples (``page/rover_clock.js``). That is late by what a message takes to the page, and never
ahead. So the daemon can refuse what waited in a network or in a busy browser.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from contextlib import suppress

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

from wayfarer.control.rate import RateLimiter
from wayfarer.daemon.socket import protocol
from wayfarer.daemon.socket.protocol import Commands, Details, RequestRefused, check, perform, read_line
from wayfarer.daemon.socket.server import has_gone
from wayfarer.errors import WayfarerError
from wayfarer.remote.live import DEMO_VERBS, DemoControls, checked_speed
from wayfarer.remote.live.model import PageViewer, TooSlow, ViewerLimits

VERBS = ("hold", "resume", "stop", "mark")
STOPPING = ("hold", "stop")  # never limited
STARTING = ("resume",)  # what can make wheels turn: only with the token, and from a page that is not old
BY_HAND = ("manual_begin", "manual_drive", "manual_end")
TURN_S = 0.001  # chosen by us

_bugs = logging.getLogger("wayfarer.remote.live")


class ManualLease:
    """What one viewer may drive: nothing before ``begin``, and nothing after ``end``.

    Args:
        commands: what the daemon can do.
        is_there: returns whether the viewer has the page open.
    """

    def __init__(self, commands: Commands, is_there: Callable[[], bool]) -> None:
        self._commands = commands
        self._is_there = is_there
        self._lease: object = None
        self._asking = False

    async def begin(self, asked_s: object) -> Details:
        """Ask for the wheels, and return ``deadman_s``; ``asked_s`` is when the person asked, on the daemon's clock."""
        if self._asking:
            raise RequestRefused("this page has asked to drive by hand already: wait for the answer")
        self._asking = True
        try:
            details = await self._perform({"do": "manual_begin", "asked_s": asked_s, "driver": "page"})
        finally:
            self._asking = False
        self._lease = details["lease"]
        return {"deadman_s": details["deadman_s"]}

    async def drive(self, fields: Mapping[str, object]) -> Details:
        """Drive by a sample: ``seq``, ``forward``, ``turn`` and ``sent_s``, as ``Commands.manual_drive`` takes them."""
        if self._lease is None:
            raise RequestRefused("this page does not drive the rover: press Drive by hand first")
        sample = {key: fields.get(key) for key in ("seq", "forward", "turn", "sent_s")}
        return await self._perform({"do": "manual_drive", "lease": self._lease, **sample})

    async def end(self) -> None:
        """Give up the wheels; safe if this viewer does not drive."""
        lease, self._lease = self._lease, None
        if lease is not None:
            with suppress(WayfarerError):  # it has ended already: somebody stopped the rover, or it fell silent
                await self._perform({"do": "manual_end", "lease": lease})

    async def _perform(self, fields: Mapping[str, object]) -> Details:
        return await perform(check(fields), self._commands, None, self._is_there)


class ClientSession:
    """The connection of one viewer.

    Args:
        socket: its connection.
        request: what opened it.
        viewer: how far it has got with the news.
        commands: what the daemon can do.
        turn: shared by all: one message is taken in ``TURN_S``, so that a flood waits for the control tick and the
            threads of its buses, and not they for the flood.
        limits: what a viewer may use up.
        demo: the demo that is shown, None for any other run.
        may_start: whether it may start the wheels.
    """

    def __init__(
        self, socket: web.WebSocketResponse, request: web.BaseRequest, viewer: PageViewer, commands: Commands,
        turn: asyncio.Lock, limits: ViewerLimits, demo: DemoControls | None, may_start: bool,
    ) -> None:  # fmt: skip
        self._socket = socket
        self._request = request
        self._viewer = viewer
        self._commands = commands
        self._turn = turn
        self._old_s = limits.old_s
        self._rate_limiter = RateLimiter(limits.requests, limits.requests_hz)
        self._demo = demo
        self.may_start = may_start
        self._lease = ManualLease(commands, self._is_there)
        self._beginning: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Serve until the viewer leaves or is disconnected."""
        following = asyncio.create_task(self._follow(), name="live viewer")
        try:
            await self._send(may_start=self.may_start)
            async for message in self._socket:
                async with self._turn:
                    await asyncio.sleep(TURN_S)
                if message.type is not WSMsgType.TEXT:
                    break
                await self._receive(message.data)
        except ConnectionError:
            pass  # it went away while it was being answered
        finally:
            following.cancel()
            await self._let_go()
            await asyncio.gather(following, return_exceptions=True)

    async def end(self, why: str) -> None:
        """Close the connection."""
        with suppress(ConnectionError, RuntimeError):  # it is gone already, or has not quite come
            await self._socket.close(code=WSCloseCode.GOING_AWAY, message=why.encode())

    async def _follow(self) -> None:
        try:
            await self._viewer.follow()
        except TooSlow:
            await self.end("no update was acknowledged for too long")
        except ConnectionError:
            pass
        except Exception:
            _bugs.exception("in sending a viewer what is new")

    async def _receive(self, text: str) -> None:
        """Take an acknowledgement, or do what is asked for and reply."""
        try:
            fields = read_line(text.encode())
        except WayfarerError as refusal:
            await self._send(reply={"do": None, "ok": False, "why": str(refusal)})
            return
        if "seen" in fields:
            self._viewer.acknowledge(fields["seen"])
            if self._demo is not None:
                self._demo.seen()
        elif fields.get("do") == "manual_begin" and (self._beginning is None or self._beginning.done()):
            self._beginning = asyncio.create_task(self._begin(fields), name="live viewer begins to drive")
        else:
            await self._answer(fields)

    async def _answer(self, fields: dict[str, object]) -> None:
        """Do what is asked for, and say what became of it."""
        try:
            reply: dict[str, object] = {"ok": True, **await self._do(fields)}
        except WayfarerError as refusal:
            reply = {"ok": False, "why": str(refusal)}
        except Exception:
            _bugs.exception("in doing what a page asked for")
            reply = {"ok": False, "why": "an error inside wayfarer: look at its terminal before you go on"}
        do, seq = fields.get("do"), fields.get("seq")
        if do in BY_HAND:  # its page must know which sample this is for, and what time it is
            reply |= {"seq": seq if isinstance(seq, int) else None, "t_s": asyncio.get_running_loop().time()}
        await self._send(reply={"do": do if isinstance(do, str) else None, **reply})  # another one may be too deep

    async def _begin(self, fields: dict[str, object]) -> None:
        """Answer beside other requests: checks and motors take a while, and a stop must not wait for them."""
        with suppress(ConnectionError):  # it went away meanwhile
            await self._answer(fields)

    async def _let_go(self) -> None:
        """Drive no more, also if driving has not quite begun."""
        if self._beginning is not None:
            self._beginning.cancel()
            await asyncio.wait([self._beginning])
        await self._lease.end()

    async def _send(self, **piece: object) -> None:
        """Send it what is for this viewer only."""
        await self._socket.send_str(msgspec.json.encode([piece]).decode())

    async def _do(self, fields: dict[str, object]) -> Details:
        """Do what is asked for, and return details for the page."""
        do = fields.get("do")
        if do in DEMO_VERBS:
            if self._demo is None:
                raise RequestRefused(f"{do} is only for wayfarer demo: the clock of this run is the real one")
            if do == "speed":  # what only a demo can is not limited: it writes nothing into the log
                self._demo.run_at(checked_speed(fields.get("times")))
            else:
                self._demo.pause(do == "pause")
        elif do in BY_HAND:
            return await self._do_by_hand(fields)
        else:
            if do not in VERBS and isinstance(do, str) and do in protocol.VERBS:
                raise RequestRefused(f"{do} is not possible from the page: use wayfarer {do} in a terminal")
            if do in STARTING and self._demo is None:
                self._check_start(str(do), fields.get("asked_s"), f", or use wayfarer {do} in a terminal")
            request = check(fields)
            if request.do not in STOPPING:
                self._check_rate()
            if request.do == "mark":  # the log is everybody's, but only who has the token fills the card for good
                return await self._commands.mark(text=request.keys["text"], keep=self.may_start)
            details = await perform(request, self._commands, None, self._is_there)
            if request.do == "hold":  # who holds a rover that a person drives ends that; it may be disarmed then
                return {"held": details.get("held")}
        return {}

    async def _do_by_hand(self, fields: dict[str, object]) -> Details:
        """Do what drives the rover by hand. Samples are not limited: they are not written into the log one by one."""
        if self._demo is not None:
            raise RequestRefused("the rover of a demo cannot be driven by hand: use wayfarer run --sim --live --manual")
        match fields["do"]:
            case "manual_begin":
                self._check_rate()
                self._check_start("to drive by hand", fields.get("asked_s"))
                return await self._lease.begin(fields.get("asked_s"))
            case "manual_drive":
                return await self._lease.drive(fields)
            case _:
                await self._let_go()
                return {}

    def _check_rate(self) -> None:
        if not self._rate_limiter.take(asyncio.get_running_loop().time()):
            raise RequestRefused("too many requests at once: wait a second and try again")

    def _is_there(self) -> bool:
        """Return whether the viewer still has the page open."""
        line = self._request.transport
        if line is None or line.is_closing() or self._socket.closed:
            return False
        return not has_gone(line.get_extra_info("socket"))

    def _check_start(self, what: str, asked_s: object, other_way: str = "") -> None:
        """Raise an error unless a request to start wheels has the token, and what its page shows is of now."""
        if not self.may_start:
            raise RequestRefused(
                f"{what} needs the token: open the page at the address that wayfarer status shows{other_way}"
            )
        now_s = asyncio.get_running_loop().time()
        # What is not a time is not new, and a state from the future is of another run.
        if not (isinstance(asked_s, int | float) and abs(now_s - asked_s) <= self._old_s):
            raise RequestRefused(
                "the page showed an old state: look at the new one, and press again if it is still right"
            )

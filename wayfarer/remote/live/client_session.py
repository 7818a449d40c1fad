"""One viewer's connection: sends updates, and receives a few commands.

Requests are handled as those of the control socket. A page cannot arm: wheels must not start from a web page. Only one
with the token can resume or drive by hand (``manual_lease``), because every user of the rover's computer can open the
page (``access``). Nor can an old page: the request may have waited in a network, or for a blocked daemon, until the
viewer has gone. So its ``asked_s`` is the newest time that the page had from the daemon (``now_s`` of a state). A demo,
where no wheels turn, asks for neither. Only its page can pause, change the speed or begin another run
(``demo_controls``).
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

import msgspec
from aiohttp import WSCloseCode, WSMsgType, web

from wayfarer.control.rate import RateLimiter
from wayfarer.daemon.socket import protocol
from wayfarer.daemon.socket.protocol import Commands, Details, RequestRefused, check, perform, read_line
from wayfarer.daemon.socket.server import has_gone
from wayfarer.errors import WayfarerError
from wayfarer.remote.live import demo_controls, manual_lease
from wayfarer.remote.live.broadcaster import PageViewer, TooSlow, ViewerLimits

VERBS = ("hold", "resume", "stop", "mark")
STOPPING = ("hold", "stop")  # never limited
STARTING = ("resume",)  # what can make wheels turn: only with the token, and from a page that is not old
TURN_S = 0.001  # chosen by us

_bugs = logging.getLogger("wayfarer.remote.live")


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
        turn: asyncio.Lock, limits: ViewerLimits, demo: demo_controls.DemoControls | None, may_start: bool,
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
        self._lease = manual_lease.ManualLease(commands, self._is_there)
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
                await self._take(message.data)
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
            _bugs.exception("in telling a viewer what is new")

    async def _take(self, text: str) -> None:
        """Take an acknowledgement, or do what is asked for and reply."""
        try:
            fields = read_line(text.encode())
        except WayfarerError as refusal:
            await self._reply({}, {"ok": False, "why": str(refusal)})
            return
        if "seen" in fields:
            self._viewer.acknowledge(fields["seen"])
            if self._demo is not None:
                self._demo.seen()
        elif fields.get("do") == manual_lease.BEGIN and (self._beginning is None or self._beginning.done()):
            self._beginning = asyncio.create_task(self._begin(fields), name="live viewer begins to drive")
        else:
            await self._answer(fields)

    async def _answer(self, fields: dict[str, object]) -> None:
        try:
            reply: dict[str, object] = {"ok": True, **await self._do(fields)}
        except WayfarerError as refusal:
            reply = {"ok": False, "why": str(refusal)}
        except Exception:
            _bugs.exception("in doing what a page asked for")
            reply = {"ok": False, "why": "an error inside wayfarer: look at its terminal before you go on"}
        await self._reply(fields, reply)

    async def _reply(self, fields: dict[str, object], reply: dict[str, object]) -> None:
        """Say what became of a request; what is no verb may be too deep to be sent back."""
        do = fields.get("do")
        told = {"do": do if isinstance(do, str) else None, **reply}
        if do in manual_lease.VERBS:  # its page must know which sample this is for, and what time it is
            seq = fields.get("seq")
            told |= {"seq": seq if isinstance(seq, int) else None, "t_s": asyncio.get_running_loop().time()}
        await self._send(reply=told)

    async def _begin(self, fields: dict[str, object]) -> None:
        """Answer beside other requests: checks and motors take a while, and a stop must not wait for them."""
        with suppress(ConnectionError):  # it went away meanwhile
            await self._answer(fields)

    async def _let_go(self) -> None:
        """Drive no more, also where driving has not quite begun."""
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
        if do in demo_controls.VERBS:
            self._do_in_demo(fields)
        elif do in manual_lease.VERBS:
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
            case manual_lease.BEGIN:
                self._check_rate()
                self._check_start("to drive by hand", fields.get("asked_s"))
                return await self._lease.begin(fields.get("asked_s"))
            case manual_lease.DRIVE:
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
        # What is no time is not new, and a state from the future is of another run.
        if not (isinstance(asked_s, int | float) and abs(now_s - asked_s) <= self._old_s):
            raise RequestRefused(
                "the page showed an old state: look at the new one, and press again if it is still right"
            )

    def _do_in_demo(self, fields: dict[str, object]) -> None:
        """Do what only a demo can; it writes nothing into the log, and so is not limited."""
        if self._demo is None:
            raise RequestRefused(f"{fields['do']} is only for wayfarer demo: the clock of this run is the real one")
        demo_controls.perform(fields, self._demo)

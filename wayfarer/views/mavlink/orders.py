"""Carries out what a station asks for, and says who may ask."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from pymavlink.dialects.v20 import common

from wayfarer.config.mavlink_settings import MavlinkSettings
from wayfarer.control.rate import RateLimiter
from wayfarer.daemon.socket.protocol import Commands, Refused
from wayfarer.errors import WayfarerError
from wayfarer.views.mavlink.link import Received
from wayfarer.views.mavlink.manual import StickDriving
from wayfarer.views.mavlink.modes import STARTING, Order
from wayfarer.views.mavlink.telemetry import Telemetry

_log = logging.getLogger("wayfarer.views.mavlink")

Answer = Callable[[int], None]  # takes a MAV_RESULT
NEEDS_KEY = "needs a signed message: put a passphrase into mavlink.key_file of the rover file, and into the station"


class Orders:
    """What stations ask for; at most one of a kind is under way.

    Args:
        commands: those of the daemon.
        stick: the station's stick, for manual mode.
        settings: what a station may do.
        telemetry: the run so far.
        tell: takes a text for the person at the station.
    """

    def __init__(
        self, commands: Commands, stick: StickDriving, settings: MavlinkSettings, telemetry: Telemetry,
        tell: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._commands = commands
        self._stick = stick
        self._settings = settings
        self._telemetry = telemetry
        self._tell = tell
        self._running: dict[Order, asyncio.Task[None]] = {}
        self._starts = RateLimiter()

    def take(self, order: Order, received: Received, answer: Answer) -> None:
        """Begin to carry out an order, or refuse it; ``answer`` is told how that goes. Does not wait."""
        if why := self.why_not(order, received):
            self._tell(f"{order.value} refused: {why}")
            answer(common.MAV_RESULT_DENIED)
        elif order in self._running:
            answer(common.MAV_RESULT_IN_PROGRESS)  # asked again, because the first answer has not come yet
        elif order in STARTING and not self._starts.take(asyncio.get_running_loop().time()):
            answer(common.MAV_RESULT_TEMPORARILY_REJECTED)
        else:
            doing = self._carry_out(order, received, answer)
            self._running[order] = asyncio.get_running_loop().create_task(doing, name=f"mavlink {order.value}")

    def why_not(self, order: Order, received: Received) -> str:
        """Say why this sender may not ask for this; empty where it may.

        Where there is a key, only signed messages come so far. Without one a program on the rover's computer is
        believed, which may be anybody's and may relay what comes from elsewhere: it can stop the wheels, and start
        only those of a simulation.
        """
        if not (received.signed or received.local):
            return f"a message from another computer {NEEDS_KEY}"
        if order is Order.ARM and not self._settings.may_arm:
            return "may_arm in [mavlink] of the rover file is false: use wayfarer arm"
        if order in STARTING and not received.signed and self._telemetry.wheels_turn:
            return f"what starts the wheels {NEEDS_KEY}"
        return ""

    async def end(self) -> None:
        """Cancel what is under way."""
        for task in self._running.values():
            task.cancel()
        await asyncio.gather(*self._running.values(), return_exceptions=True)

    async def _carry_out(self, order: Order, received: Received, answer: Answer) -> None:
        result = common.MAV_RESULT_FAILED
        try:
            await self._do(order, received)
            result = common.MAV_RESULT_ACCEPTED
        except Refused as refusal:
            result = common.MAV_RESULT_TEMPORARILY_REJECTED
            self._tell(f"{order.value} refused: {refusal}")
        except WayfarerError as error:
            self._tell(f"{order.value} failed: {error}")
        except Exception:
            _log.exception("in carrying out %s", order.value)
            self._tell(f"{order.value} failed: an error inside wayfarer")
        finally:
            del self._running[order]
        answer(result)

    async def _do(self, order: Order, received: Received) -> None:
        run = self._telemetry.state
        match order:
            case Order.ARM:
                await self._commands.arm()
            case Order.DISARM:
                await self._commands.disarm()
            case Order.HOLD:
                await self._commands.hold()
            case Order.MANUAL:
                await self._stick.begin((received.system, received.component))
            case Order.RESUME:
                await self._stick.end()
                if run.mode != "armed" or run.operator_hold:
                    await self._commands.resume()

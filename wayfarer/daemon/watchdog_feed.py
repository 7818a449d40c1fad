"""Feeds the stall guard and systemd's watchdog from log events."""

from __future__ import annotations

from wayfarer.control.run_log import PartialLog
from wayfarer.control.tick_record import TickRecord
from wayfarer.daemon.watchdog import StallGuard, SystemdNotifier


class WatchdogFeed(PartialLog):
    """Each tick is a beat for the guard, and the first says that the service is up."""

    def __init__(self, notifier: SystemdNotifier, guard: StallGuard) -> None:
        self._notifier = notifier
        self._guard = guard
        self._ready = False

    def tick(self, record: TickRecord) -> None:  # noqa: ARG002
        """Beat."""
        if not self._ready:
            self._ready = True
            self._guard.start()
            self._notifier.tell("READY=1")
            self._notifier.status("disarmed")
        self._guard.beat()

    def event(self, name: str, t_s: float, **details: object) -> None:  # noqa: ARG002
        """Show what systemctl should; once the wheels are stopped for good nobody need guard them."""
        if name == "wheels_stopped":
            self._guard.stop()
            self._notifier.tell("STOPPING=1")
        elif name in {"arming", "armed", "disarmed", "health"}:
            shown = ", ".join(str(value) for value in details.values() if isinstance(value, str))
            self._notifier.status(f"{name}: {shown}" if shown else name)

    def close(self, reason: str, text: str) -> None:  # noqa: ARG002
        """Say how it ended."""
        self._notifier.status(text)

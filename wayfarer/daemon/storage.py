"""The storage side of a daemon: what the card's health says, old runs that are deleted, and both for ``status``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from wayfarer.commissioning.checks.card import CardHealth, card_troubles
from wayfarer.config.rover_file import LogSettings
from wayfarer.control.run_log import RunLog
from wayfarer.fieldlog.clock import wall_clock
from wayfarer.fieldlog.retention import Pruned, prune
from wayfarer.fieldlog.writer_thread import WriterThread


class Storage:
    """Watches where a run is logged; each kind of trouble is told once in a run, and shown while it lasts.

    Args:
        run: the folder of the run, among all others.
        settings: how much of the past is kept.
        writer: writes the run's log.
        log: takes the events; the methods that are given a time call it, so they are for the event loop.
        may_delete: whether old runs may be deleted now, from any thread.
    """

    def __init__(
        self,
        run: Path,
        settings: LogSettings,
        writer: WriterThread,
        log: RunLog,
        may_delete: Callable[[], bool],
    ) -> None:
        self._run = run
        self._settings = settings
        self._writer = writer
        self._log = log
        self._may_delete = may_delete
        self._card: list[str] = []
        self._kept: str | None = None
        self._told: set[str] = set()
        self._deleted = 0

    @property
    def deletes(self) -> bool:
        """Whether the rover file lets old runs be deleted."""
        return self._settings.keep_days is not None or self._settings.keep_mb is not None

    def status(self) -> dict[str, Any]:
        """Return what ``wayfarer status`` says of it."""
        return {
            "log_trouble": self._writer.trouble,
            "storage_warnings": [*self._card, *([self._kept] if self._kept else [])],
            "runs_deleted": self._deleted,
        }

    def take_health(self, t_s: float, health: CardHealth) -> float:
        """Take the card's health, and return the longest time in ms that the card has taken to store records since."""
        sync_ms = round(1000.0 * self._writer.take_slowest_sync_s(), 1)
        troubles = card_troubles(health, sync_ms)
        self._card = [trouble.found for trouble in troubles]
        for trouble in troubles:
            if self._is_new(trouble.kind):
                self._log.event("card", t_s, text=f"{trouble.found}: {trouble.remedy}")
        return sync_ms

    def delete_old_runs(self) -> Pruned | None:
        """Delete the runs that are over the limits unless the rover is armed; may take seconds, so not on the loop."""
        if not self._may_delete():
            return None
        return prune(self._run.parent, self._settings, wall_clock(0.0), self._run.name)

    def take_pruned(self, t_s: float, pruned: Pruned) -> None:
        """Tell what was deleted and what was not."""
        self._kept = pruned.trouble
        self._deleted += len(pruned.deleted)
        if pruned.deleted:
            names, mb, _, left_mb, _ = pruned
            self._log.event("runs_deleted", t_s, runs=list(names), deleted_mb=mb, left_mb=left_mb)
        if pruned.trouble is not None and self._is_new(pruned.trouble):
            self._log.event("runs_not_deleted", t_s, text=pruned.trouble)

    def _is_new(self, kind: str) -> bool:
        new = kind not in self._told
        self._told.add(kind)
        return new

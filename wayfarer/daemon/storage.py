"""What a daemon looks after on its computer: the card, runs that are kept or deleted, heat and power."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from wayfarer.commissioning.checks.system import THROTTLED, CardHealth, card_troubles, system_text
from wayfarer.config.rover_file import LogSettings
from wayfarer.control.run_log import RunLog
from wayfarer.fieldlog.folders import error_advice, free_mb
from wayfarer.fieldlog.retention import Pruned, keep_run, prune
from wayfarer.fieldlog.sink import Sink
from wayfarer.waiting_thread import OneCall

# -- the computer ----------------------------------------------------------------------------------------------------
# Health of the computer: temperature, power, load, disk. A hot or under-powered Pi slows down.
#
# It is read in threads, because a hanging card may block a call that asks for its free space; the power flags have a
# separate thread, because the rover drives more gently by them.

EVERY_S = 10.0  # chosen by us: heat that slows the processor builds up over minutes
POWER_EVERY_S = 1.0  # fault catalogue, fault 32
OLD_RUNS_EVERY_S = 3600.0
CPU_TEMPERATURE = "/sys/class/thermal/thermal_zone0/temp"  # thousandths of a degree Celsius, on every Linux board

Health = Mapping[str, float | str | None]


class Watch(NamedTuple):
    """What is called again and again, at once and every so many seconds, in a thread of this name."""

    name: str
    every_s: float
    call: Callable[[], None]


@contextmanager
def watching(*watches: Watch) -> Iterator[None]:
    """Call each in a separate thread while entered: none waits for another that a hanging card holds."""
    ended = threading.Event()

    def work(watch: Watch) -> None:
        while not ended.is_set():
            with suppress(RuntimeError):  # the loop that gets it has ended
                watch.call()
            ended.wait(watch.every_s)

    for watch in watches:
        threading.Thread(target=work, args=(watch,), name=watch.name, daemon=True).start()
    try:
        yield
    finally:
        ended.set()


def health(logs: Path, root: Path = Path("/")) -> Health:
    """Return what the computer reports, None for what it does not: not every one is a Raspberry Pi."""
    cpu_mc = system_text(CPU_TEMPERATURE, root)
    return {
        "cpu_c": int(cpu_mc) / 1000.0 if cpu_mc and cpu_mc.lstrip("-").isdecimal() else None,
        "throttled": system_text(THROTTLED, root),
        "load_1min": round(os.getloadavg()[0], 2),
        "disk_free_mb": _free_mb(logs),
    }


def _free_mb(folder: Path) -> float | None:
    try:
        return round(free_mb(folder), 1)
    except OSError:
        return None


NOT_KEPT = "this run can be deleted, although it was marked: {}"


class Storage:
    """Watches where a run is logged; each kind of trouble is reported once in a run, and shown while it lasts.

    Args:
        run: the folder of the run, among all others.
        settings: how much is kept.
        sink: writes the run's log.
        log: takes the events; the methods that are given a time call it, so they are for the event loop.
        may_delete: whether runs may be deleted now, from any thread.
    """

    def __init__(
        self,
        run: Path,
        settings: LogSettings,
        sink: Sink,
        log: RunLog,
        may_delete: Callable[[], bool],
    ) -> None:
        self._run = run
        self._settings = settings
        self._sink = sink
        self._log = log
        self._may_delete = may_delete
        self._card: list[str] = []
        self._not_deleted: str | None = None
        self._not_kept: str | None = None
        self._keeping = OneCall(self._keep)
        self._told: set[str] = set()
        self._deleted = 0

    def status(self) -> dict[str, Any]:
        """Return what ``wayfarer status`` says of it."""
        return {
            "log_trouble": self._sink.trouble,
            "storage_warnings": [*self._card, *filter(None, [self._not_deleted, self._not_kept])],
            "runs_deleted": self._deleted,
        }

    def take_health(self, t_s: float, health: CardHealth) -> float:
        """Take the card's health, and return the longest time in ms that the card has taken to store records since."""
        sync_ms = round(1000.0 * self._sink.take_slowest_sync_s(), 1)
        troubles = card_troubles(health, sync_ms)
        self._card = [trouble.text for trouble in troubles]
        for trouble in troubles:
            if self._is_new(trouble.name):
                text = f"The card with the logs: {trouble.text}: {trouble.remedy}"
                self._log.logger.warning("card", t_s=t_s, text=text)
        return sync_ms

    def keep(self) -> None:
        """Let nobody delete this run. A thread does that: a disk that does not answer must not delay the loop."""
        try:
            self._keeping.start()
        except RuntimeError as error:
            self._not_kept = NOT_KEPT.format(error)

    def _keep(self) -> None:
        try:
            keep_run(self._run)
            self._not_kept = None
        except OSError as error:
            self._not_kept = NOT_KEPT.format(error_advice(error))

    def delete_old_runs(self) -> Pruned | None:
        """Delete what is beyond ``keep_mb`` while the rover is not armed; may take seconds, so not on the loop."""
        if self._settings.keep_mb is None or not self._may_delete():
            return None
        return prune(self._run.parent, self._settings.keep_mb, self._may_delete)

    def take_pruned(self, t_s: float, pruned: Pruned) -> None:
        """Report what was deleted and what was not."""
        self._not_deleted = pruned.trouble
        self._deleted += len(pruned.deleted)
        if pruned.deleted:
            runs, deleted_mb, left_mb = list(pruned.deleted), pruned.deleted_mb, pruned.left_mb
            text = f"Old runs were deleted, {deleted_mb:.0f} MB, {left_mb:.0f} MB are left: {', '.join(runs)}"
            self._log.logger.info("runs_deleted", t_s=t_s, text=text, runs=runs, deleted_mb=deleted_mb, left_mb=left_mb)
        if pruned.trouble is not None and self._is_new(pruned.trouble):
            text = f"Old runs were not deleted: {pruned.trouble}"
            self._log.logger.warning("runs_not_deleted", t_s=t_s, text=text)

    def _is_new(self, kind: str) -> bool:
        new = kind not in self._told
        self._told.add(kind)
        return new

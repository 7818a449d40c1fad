"""Checks of the computer: device files and permissions, power, disk, clock, and the card that the logs are on."""

from __future__ import annotations

import asyncio
import os
import pwd
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from wayfarer.commissioning.checks.api import Finding, HostEnvironment, Inspection, fail, ok, skipped, warn
from wayfarer.config.rover_file import LogSettings, RoverConfig, part_settings
from wayfarer.errors import NotThereYet
from wayfarer.fieldlog.clock import CLOCK_SET_S
from wayfarer.fieldlog.folders import ADVICE, free_mb, total_mb
from wayfarer.safety.power import SLOWED_NOW, UNDER_VOLTAGE_NOW, UNDER_VOLTAGE_SINCE_BOOT

# The debug connector of a Raspberry Pi 5, which its /dev/serial0 leads to. Second hand, from the issue tracker of the
# Raspberry Pi documentation (issue 3239, pull request 3294).
PI5_DEBUG_PORT = "ttyAMA10"
# The firmware's power and heat flags (``wayfarer.safety.power``), in hexadecimal.
THROTTLED = "/sys/devices/platform/soc/soc:firmware/get_throttled"


class DeviceProblem(NamedTuple):
    """What is wrong with a device file, with the likely cause, and what to do."""

    text: str
    remedy: str


class DeviceKind(NamedTuple):
    """Device files of one kind: their names, the group that may use them, how they come to be there."""

    prefixes: tuple[str, ...]
    group: str
    absent: str
    enable: str


# Groups: udev rules of Raspberry Pi OS (docs/reference/hardware.md). raspi-config takes 0 for yes.
DEVICE_KINDS = (
    DeviceKind(("/dev/i2c-",), "i2c", "the I2C bus is not enabled", "sudo raspi-config nonint do_i2c 0 && sudo reboot"),
    DeviceKind(
        ("/dev/spidev",), "spi", "the SPI bus is not enabled", "sudo raspi-config nonint do_spi 0 && sudo reboot"
    ),
    DeviceKind(
        ("/dev/serial/", "/dev/ttyUSB", "/dev/ttyACM"),
        "dialout",
        "the USB serial adapter is not plugged in, or has another name",
        "plug it in; its name is what `ls /dev/serial/by-id` shows",
    ),
    DeviceKind(
        ("/dev/serial", "/dev/ttyAMA", "/dev/ttyS"),
        "dialout",
        "the serial port is not enabled",
        "sudo raspi-config nonint do_serial_hw 0 && sudo raspi-config nonint do_serial_cons 1 && sudo reboot; "
        "on a Pi 5: dtparam=uart0=on in /boot/firmware/config.txt",
    ),
    DeviceKind(("/dev/gpiochip",), "gpio", "this computer has no such GPIO", "correct the rover file: `ls /dev/gpio*`"),
    DeviceKind(
        ("/dev/video",), "video", "the camera is not connected", "check its ribbon; rpicam-hello --list-cameras"
    ),
)
OTHER_DEVICE = DeviceKind(("",), "root", "no such device", "correct its name in the rover file")


def diagnose(host: HostEnvironment, device: str) -> DeviceProblem | None:
    """Return why a device file cannot be used, None if it can."""
    kind = next((kind for kind in DEVICE_KINDS if device.startswith(kind.prefixes)), OTHER_DEVICE)
    path = host.path(device)
    if not path.exists():
        return DeviceProblem(f"{device} is not there; {kind.absent}", kind.enable)
    if not os.access(path, os.R_OK | os.W_OK):
        text = f"{device} may not be used; this user is not in group '{kind.group}', or was added since logging in"
        return DeviceProblem(text, f"sudo usermod -aG {kind.group} {_user()}, then log out and in again")
    return None


async def device(name: str, inspection: Inspection) -> Finding:
    """Check that a device file is there and may be used."""
    if trouble := diagnose(inspection.host, name):
        inspection.unusable.add(name)
        return fail(name, trouble.text.removeprefix(f"{name} "), trouble.remedy)
    if inspection.host.path(name).resolve().name == PI5_DEBUG_PORT:
        return warn(
            name,
            f"it is {PI5_DEBUG_PORT}, the debug connector of a Pi 5; its header's pins 14 and 15 are /dev/ttyAMA0",
            "dtparam=uart0=on in /boot/firmware/config.txt, reboot, and /dev/ttyAMA0 in the rover file",
        )
    return ok(name, "present, and this user may use it")


def device_files(config: RoverConfig) -> tuple[str, ...]:
    """Return the device files that a rover's parts are on, each once, in their order."""
    return tuple(dict.fromkeys(device for _, device in _ports(config)))


def refuse_missing_ports(config: RoverConfig, where: str, host: HostEnvironment) -> None:
    """Refuse a rover if a device file does not exist or may not be used: perhaps not yet, as of a late adapter.

    Args:
        config: the rover; only the Raspberry Pi's own buses have device files.
        where: the rover's file, or the name of a shipped one.
        host: where device files are looked up.

    Raises:
        NotThereYet: the text names file, key and device, and what to do, such as which group to join.
    """
    for key, device in _ports(config):
        trouble = diagnose(host, device)
        if trouble is not None:
            raise NotThereYet(f"{where}: key '{key}': {trouble.text}: {trouble.remedy}")


def _ports(config: RoverConfig) -> Iterator[tuple[str, str]]:
    """Give each device file and the key that names it; only buses of Linux have device files.

    Of a part that can be on either, ``bus`` does not count if it has a ``port``.
    """
    if config.buses != "linux":
        return
    for part, table in config.parts.items():
        _, settings = part_settings(part, table)
        unused = "bus" if getattr(settings, "port", "") else None
        for field in fields(settings):
            value = getattr(settings, field.name)
            if isinstance(value, str) and value.startswith("/dev/") and field.name != unused:
                yield f"parts.{part}.{field.name}", value


def _user() -> str:
    """Return whom this runs as: under sudo -u that is another one than the shell's $USER."""
    try:
        return pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:  # a container may run as a number that has no name
        return str(os.geteuid())


def system_text(path: str, root: Path = Path("/")) -> str | None:
    """Return what a system file says, None if it cannot be read: not every computer has it."""
    try:
        return (root / path.lstrip("/")).read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return None


def power_flags(root: Path = Path("/")) -> int | None:
    """Return the flags of ``wayfarer.safety.power``, None if the computer does not report it."""
    try:
        return int(system_text(THROTTLED, root) or "", 16)
    except ValueError:
        return None


async def power(inspection: Inspection) -> Finding:
    """Check whether the computer gets its voltage and keeps cool, as the Raspberry Pi's firmware sees it."""
    name, flags = "computer power", power_flags(inspection.host.root)
    if flags is None:
        return skipped(name, "this computer does not report it")
    sags = f"(flags {flags:#x}); its supply sags, most of all when the motors start"
    remedy = "give it a separate 5 V supply, thick wires"
    if flags & UNDER_VOLTAGE_NOW:
        return fail(name, f"under-voltage now {sags}", remedy)
    if flags & SLOWED_NOW:
        text = f"slowed down now (flags {flags:#x}); it is too hot"
        return warn(name, text, "put it in the shade, let air into its case")
    if flags & UNDER_VOLTAGE_SINCE_BOOT:
        return warn(name, f"there was under-voltage since boot {sags}", remedy)
    return ok(name, "no under-voltage since boot")


async def disk(inspection: Inspection) -> Finding:
    """Check that the log folder can be written and has room for a part of a log beside what the log leaves free."""
    return await asyncio.to_thread(_disk, inspection.host.log_folder, inspection.config.log)


def _disk(folder: Path, settings: LogSettings) -> Finding:
    there = folder.absolute()
    try:
        there = next(path for path in (there, *there.parents) if path.exists())
        with tempfile.NamedTemporaryFile(dir=there, prefix=".wayfarer-") as file:
            file.write(b"wayfarer")
            file.flush()
            os.fsync(file.fileno())
        left_mb, size_mb = free_mb(there), total_mb(there)
    except OSError as error:
        remedy = ADVICE.get(error.errno or 0, "look at the disk (df, dmesg)")
        if isinstance(error, PermissionError):
            remedy = f"sudo chown {_user()} {there}, or choose another --log-dir"
        return fail("disk", f"{there} cannot be written: {error.strerror}", remedy)
    text = f"{left_mb:.0f} MB free in {there}"
    needed_mb = settings.free_mb + settings.part_mb
    if left_mb < needed_mb:
        wanted = f"free_mb ({settings.free_mb:g}) and part_mb ({settings.part_mb:g}) under [log] in the rover file"
        remedy = f"copy old runs from {folder} and delete them; {needed_mb:g} MB are needed: {wanted}"
        return fail("disk", f"{text}; old runs fill it", remedy)
    if (settings.keep_mb or 0.0) + needed_mb > size_mb:
        text += f"; keep_mb ({settings.keep_mb:g}) under [log] in the rover file is more than this disk can hold"
        return warn("disk", text, f"set at most {size_mb - needed_mb:.0f}, or it runs full before runs are deleted")
    return ok("disk", text)


async def log(trouble: Callable[[], str | None], inspection: Inspection) -> Finding:  # noqa: ARG001 - as any check
    """Check that the log of this run is being written: a mission that nobody can look at is not begun (fault 40).

    Args:
        trouble: returns why records are being lost, None if they are not.
        inspection: not looked at.
    """
    text = trouble()
    if text is None:
        return ok("log", "is being written")
    return fail("log", f"records of this run are being lost: {text}", "fix that; the log continues within a second")


async def clock(inspection: Inspection) -> Finding:
    """Check that the wall clock was set; only the names and dates in logs depend on it."""
    now = datetime.fromtimestamp(inspection.host.t_wall, UTC)
    if inspection.host.t_wall < CLOCK_SET_S:
        return warn(
            "clock",
            f"it is {now:%Y-%m-%d}; no network since power-up, and no clock chip with a battery",
            "sudo date --set '2026-05-31 14:00', or connect to a network once",
        )
    return ok("clock", f"{now:%Y-%m-%d %H:%M} UTC")


# -- the card or disk of the logs -------------------------------------------------------------------------------------
# SD cards do not say how worn they are. What shows it is slow writing, measured while the log is written, and a file
# system that the kernel has made read-only after an error.

MOUNTS = "/proc/self/mountinfo"  # man 5 proc
# What a person reads of each: the upper layer of an overlay is nearly always a tmpfs.
MEMORY = {"tmpfs": "tmpfs", "ramfs": "ramfs", "overlay": "an overlay, as it seems"}
# A card pauses for up to 500 ms (docs/reference/hardware.md); one that works is not four times as slow.
SLOW_SYNC_MS = 2000.0


class CardHealth(NamedTuple):
    """How the disk of the logs is mounted, None if this computer does not say; ``disk_memory``: empty on a disk."""

    disk_read_only: bool | None = None
    disk_memory: str | None = None


def card_health(folder: Path, root: Path = Path("/")) -> CardHealth:
    """Return how the disk of a folder is; the folder need not be there. ``root``: what system files are below."""
    path, health, longest = os.path.realpath(folder), CardHealth(), -1
    for line in (system_text(MOUNTS, root) or "").splitlines():
        mount, _, disk = (part.split() for part in line.partition(" - "))
        point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), mount[4])
        within = path == point or path.startswith(point.rstrip("/") + "/")
        if within and len(point) >= longest:  # of two at one point the later is seen
            options = f"{mount[5]},{disk[-1]}".split(",")
            health, longest = CardHealth("ro" in options, MEMORY.get(disk[0], "")), len(point)
    return health


def card_troubles(health: CardHealth, sync_ms: float = 0.0) -> list[Finding]:
    """Say what is wrong, by kind, the worst first; ``sync_ms``: the longest that it lately took to store records."""
    told = (
        (health.disk_read_only, "read_only", "it is mounted read-only: so /etc/fstab says, or it failed (see dmesg)",
         "mount it for writing; replace a card that mounts itself read-only"),
        (sync_ms > SLOW_SYNC_MS, "slow",
         f"it took {sync_ms / 1000.0:.1f} s to store records: it is worn, or other programs write a lot",
         "see which (iotop), else replace the card"),
        (health.disk_memory, "memory",
         f"the logs are in memory ({health.disk_memory}), lost at power-off: the root is read-only, or it is a tmpfs",
         "log to a partition that is written, such as a separate one at /var/lib/wayfarer"),
    )  # fmt: skip
    return [warn(kind, text, remedy) for wrong, kind, text, remedy in told if wrong]


async def card(inspection: Inspection) -> Finding:
    """Check whether the card with the logs can be written and keeps them."""
    health = await asyncio.to_thread(card_health, inspection.host.log_folder, inspection.host.root)
    if troubles := card_troubles(health):
        return warn("card", "; ".join(trouble.text for trouble in troubles), troubles[0].remedy)
    if health == CardHealth():
        return skipped("card", "this computer does not say what the logs are on")
    return ok("card", "it can be written and keeps the logs")

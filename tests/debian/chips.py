"""The bus factory of the rover in the container: simulated chips, for a service that imports what Debian packages."""

from importlib import import_module
from pathlib import Path

import picamera2
import serial
import spidev

buses = import_module("simulated_chips").buses  # of examples/, copied beside this file
# What the service's Python found where, for protocol.py.
FOUND = Path("/run/wayfarer/imported.txt")
if FOUND.parent.is_dir():
    FOUND.write_text("".join(f"{module.__file__}\n" for module in (picamera2, serial, spidev)), encoding="utf-8")

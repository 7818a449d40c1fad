"""The detector: from readings and commands to "something is wrong". Pure: time comes in as data.

It tells two things apart. *Anomalies* are what the forest does (blocked, tilted, touched) and go to the escape
handler. *Conditions* are what the rover's own senses and wheels do (stale, implausible, blind, lopsided, running away)
and go to the safety gate.
"""

from wayfarer.detector.detector import Detector
from wayfarer.detector.settings import DetectorSettings
from wayfarer.detector.stall import StallMonitor

__all__ = ["Detector", "DetectorSettings", "StallMonitor"]

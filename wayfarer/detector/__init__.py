"""The detector: from readings and commands to "something is wrong". Pure: time comes in as data.

It separates two things. *Anomalies* come from the forest (blocked, tilted, touched) and go to the escape handler.
*Conditions* come from the rover's own sensors and wheels (stale, implausible, blind, one-sided, running away) and go to
the safety gate.
"""

from wayfarer.detector.detector import Detector
from wayfarer.detector.response import StallMonitor
from wayfarer.detector.settings import DetectorSettings

__all__ = ["Detector", "DetectorSettings", "StallMonitor"]

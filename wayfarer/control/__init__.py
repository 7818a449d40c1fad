"""The loop of the rover: control tick, sensor tasks, supervisor, and how every run ends (``shutdown.py``)."""

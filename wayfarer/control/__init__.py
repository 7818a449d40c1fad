"""The control loop of the rover: control tick, sensor tasks, supervisor, and shutdown (``shutdown.py``)."""

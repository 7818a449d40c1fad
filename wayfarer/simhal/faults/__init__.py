"""Fault injection into a simulated rover; ``kinds.py`` lists every kind of fault, as data.

Each kind of fault is a context manager: entered when the fault begins, left when it ends, so that what it changed is
restored however the run ends. ``Injector`` enters and leaves them at their times, on the run's own loop.
"""

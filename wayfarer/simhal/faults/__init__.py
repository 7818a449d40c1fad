"""Fault injection into a simulated rover; ``kinds.py`` lists every kind of fault.

Each kind is a class in the module of its layer, with what it does as a context manager: entered when the fault begins,
left when it ends. ``Injector`` enters and leaves them at their times, on the run's own loop. At the end of the run
``Injector.end`` leaves those that still last, the latest first, so that what they changed is restored.
"""

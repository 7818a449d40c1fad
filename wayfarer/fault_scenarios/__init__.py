"""Scenarios: faults on purpose, and whether the rover does what it must, within which time.

``scenario.py`` is the data and its file format, ``runner.py`` runs one in virtual time, ``judge.py`` judges it. The
field catalogue is here as scenarios too: ``catalogue``.
"""

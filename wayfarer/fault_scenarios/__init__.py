"""Fault scenarios: faults are injected, and the rover's response is checked against a time bound.

``scenario.py`` is the data and its file format, ``runner.py`` runs one in virtual time, ``judge.py`` judges it. The
fault catalogue is here as scenarios too: ``catalogue``.
"""

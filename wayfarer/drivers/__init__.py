"""Drivers of real parts, one file for each part, over buses that are passed in (``buses.py``).

A driver is a class with the methods of its protocol in ``hal`` and two class attributes: ``part``, the member of
``hal.Rover`` that it can be (``"compass"``), and ``Settings``, a frozen dataclass of its settings in a rover file. Its
``__init__`` takes such settings and a ``buses.Buses``. No driver module imports a bus library; ``linux.py`` does, when
a bus is used.
"""

"""Drivers of real parts, one file a part, over buses that are handed in (``buses.py``).

A driver is a class with three class attributes beside its capability's methods: ``part``, the member of ``hal.Rover``
that it can be (``"compass"``); ``Settings``, a frozen dataclass of what a rover file may say about it; and ``__init__``
takes one of those and a ``buses.Buses``. No driver module imports a bus library; ``linux.py`` does, when a bus is used.
"""

"""The fakes that tests share: one kit, from whole parts down to the wire. Take the first that a test can do with.

* ``boards``: the real driver of a motor board over its simulated chip; the wire between them can be troubled.
* ``rover``: a simulated rover whose parts can be broken, on blocks or on the ground, and a person with a script.
* ``motors``: motors that turn no wheel and remember what they were told.
* ``workshop``: a supervisor over parts that do nothing but write down what was done to them, and when.

The senses and clocks of chips without a driver are in ``tests/simhal/chips/bench.py``; a daemon as a process over
chips in another process is ``tests/system/hil_setup.py``.
"""

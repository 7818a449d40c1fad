"""Pure safety guards: what may stop the wheels, and when a mission ends. Time is an input.

``conditions.py`` is the table of everything that can be wrong with the rover itself, ``gate.py`` the last step before
the wheels. The other modules judge one thing each: arming, the limits
of a mission, progress, motor board, supply.
"""

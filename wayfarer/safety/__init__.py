"""The pure guards: what may keep the wheels from turning, and when a mission ends. Time comes in as data.

``conditions.py`` is the table of everything that can be wrong with the rover itself, ``gate.py`` the last step before
the wheels. The other modules judge one thing each: arming, the limits of a mission, entrapment, motor board, supply.
"""

"""Pure safety guards: what may stop the wheels, and when a mission ends. Time is an input.

``conditions.py`` names everything that can be wrong with the rover itself, ``responses.py`` is the table of what is
done about it, ``gate.py`` the last step before the wheels. The other modules judge one thing each: arming, the limits
of a mission, entrapment, motor board, supply.
"""

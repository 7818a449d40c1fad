"""Clocks of the simulation: virtual time, and real time scaled by a factor."""

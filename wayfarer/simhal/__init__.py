"""Simulated hardware: clock, world, chips, faults, and parts that implement the protocols of ``wayfarer.hal``.

No field code imports it.
"""

"""The simulator ("simulated HAL"): a world, a rover's chips and parts in it, their faults, and a virtual clock.

The parts implement the protocols of ``wayfarer.hal``, so that the code of the field runs on them. No field code imports
this package.
"""

"""The simulated HAL: virtual time, a physics-light world, and parts that implement the protocols of ``wayfarer.hal``.

Nothing outside this package but the command line and the tests imports it.
"""

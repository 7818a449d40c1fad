"""wayfarer: an escape controller for ground rovers without vision.

The package is laid out as the data flows: ``drivers`` (or ``simhal``) behind the protocols of ``hal``, the pure
``detector``, ``escape`` and ``safety``, and the ``supervisor`` that runs them. See ``ARCHITECTURE.md``.
"""

__version__ = "0.1.0"

"""wayfarer: an escape controller for ground rovers without vision.

The package is laid out as the data flows: ``drivers`` (or ``simhal``) behind the protocols of ``hal``, the pure
``detector``, ``escape`` and ``safety``, and the ``supervisor`` that runs them. See ``ARCHITECTURE.md``.
"""

from wayfarer.version import __version__ as __version__


def main() -> None:
    """Run the command line and exit; the console entry point.

    It is here because each process of a pool imports the script that started its parent, and needs no commands.
    """
    from wayfarer import cli

    cli.main()

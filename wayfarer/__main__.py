"""``python -m wayfarer``: the same as the command ``wayfarer``."""

from wayfarer import main

if __name__ == "__main__":  # and not where a process of a pool imports it
    main()

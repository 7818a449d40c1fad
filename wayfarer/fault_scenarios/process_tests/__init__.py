"""What needs processes, or a person beside the rover: tried on the real daemon and the real commands."""

"""``wayfarer drive``: what a person presses, and the loop that sends it to the daemon."""

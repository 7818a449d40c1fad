"""Time in the simulation: virtual, or as many times faster than the clock."""

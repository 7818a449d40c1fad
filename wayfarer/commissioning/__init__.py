"""Getting a rover ready to drive: checks, guided calibration, and what both need of a person beside it."""

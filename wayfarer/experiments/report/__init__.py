"""Reports of campaigns and sweeps: one HTML page with its figures beside it."""

"""Reports of campaigns and sweeps: one HTML page each, with figures to zoom."""

"""HTML pages that are kept: the reports of runs, campaigns and sweeps, with figures to zoom."""

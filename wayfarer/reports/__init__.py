"""HTML pages that are kept: the report of one run (a map of its path, and time series), and the frame of all pages."""

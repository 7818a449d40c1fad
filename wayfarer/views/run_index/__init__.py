"""The HTML page that lists all runs of a folder, with search, filters and what people noted."""

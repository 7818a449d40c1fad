"""A run in the formats of other tools: one file for each format, and a table of them all (``formats``)."""

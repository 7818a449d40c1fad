"""``wayfarer tune``: a search for better settings of a rover, confirmed on forests that it never saw."""

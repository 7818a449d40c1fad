"""The HTML report of one run: a map of the path, and time lines; drawn with Bokeh."""

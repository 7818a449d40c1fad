"""The HTML report of one run: a map of the path, and time series; drawn with Bokeh."""

"""One run's log as an HTML page, with a map of the way and panels over time; matplotlib draws them."""

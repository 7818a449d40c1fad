"""Reports: what a folder of results says, as one HTML page with its figures beside it."""

"""Field logs: a folder for each run, written beside control and read back through whatever cut it short."""

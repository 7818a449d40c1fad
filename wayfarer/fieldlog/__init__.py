"""Field logs: one folder per run, written without delaying control, and readable after damage."""

"""Text views of field logs: lists, events, summaries, integrity checks and tables."""

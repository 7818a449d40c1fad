"""What is done with field logs once they are written: lists, stories, summaries, verdicts and tables."""

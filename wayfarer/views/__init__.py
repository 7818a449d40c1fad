"""Views of a run: text, HTML report, live page, Foxglove. All read the same records."""

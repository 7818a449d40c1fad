"""Views of a run: text, HTML report, live page, exports. All read the same records."""

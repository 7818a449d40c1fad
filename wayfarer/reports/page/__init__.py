"""Offline HTML pages with figures that can be zoomed: their frame, their style, and their building blocks."""

"""The documentation: Markdown by what a reader needs it for, and the two programs that generate and build it."""

"""The implementation of the public names of ``wayfarer``; import them from there."""

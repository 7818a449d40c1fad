"""Sweeps: the same trials at each point of a grid of settings."""

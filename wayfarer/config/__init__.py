"""Rover files: reading, validation, finding what a file names, and building the rover.

``registry.py`` needs no pydantic, so that the escape handler can be had without it.
"""

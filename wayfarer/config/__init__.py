"""Everything of rover files: reading and checking one, finding what it names, and the rover that comes out of it.

``registry.py`` needs no pydantic, so that the escape handler can be had without it.
"""

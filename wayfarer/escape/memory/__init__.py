"""Memory-Pledge: remembers where the rover was stopped, plans a way around it, and falls back on Pledge.

Theory of operation
-------------------
``obstacle_map`` keeps *trunks*: lines through the places where the rover was stopped. ``slip`` decides whether it was
stopped at all, or only spun its wheels. ``route`` finds the cheapest way to the goal line among the trunks, where all
that was not met counts as free (the free-space assumption; Koenig and others, AIJ 147). ``handler`` drives along that
way: it follows a waypoint's heading as other algorithms follow the goal heading, and at each contact it backs off,
plans again, and turns to the new way. ``fallback`` says when Pledge drives instead.
"""

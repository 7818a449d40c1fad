"""Where a simulated rover drives: forests and sites, and what happens to its body there, physics-light.

``simulated_world.py`` is what parts, faults and experiments need of a world; MuJoCo's is ``simhal/mujoco``.
"""

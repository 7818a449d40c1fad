"""The simulated world: forests and sites, and the rover's body in them (physics-light).

``simulated_world.py`` is what parts, faults and experiments need of a world; MuJoCo's is ``simhal/mujoco``.
"""

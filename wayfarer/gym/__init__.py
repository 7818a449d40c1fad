"""The simulated rover as a Gymnasium environment, to train or compare agents (extra ``gym``).

Importing this module registers it::

    import gymnasium
    import wayfarer.gym

    env = gymnasium.make("Wayfarer-Forest-v0")

or, in one: ``gymnasium.make("wayfarer.gym:Wayfarer-Forest-v0")``. Gymnasium 1 loads no plugins by itself.
"""

from __future__ import annotations

from gymnasium import register

ENV_ID = "Wayfarer-Forest-v0"

register(id=ENV_ID, entry_point="wayfarer.gym.env:ForestEnv")

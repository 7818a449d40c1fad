"""A rigid-body world in the engine MuJoCo: four driven wheels that grip and slip (extra ``physics``)."""

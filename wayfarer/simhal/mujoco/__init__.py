"""A world of rigid bodies: four driven wheels that grip and slip, in the engine MuJoCo (extra ``[physics]``)."""

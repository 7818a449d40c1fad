"""Films of a trial: ``wayfarer sim --physics mujoco --video``. Drawn after the trial, without effect on it."""

"""A trial as a film: ``wayfarer sim --physics mujoco --video``. It is drawn after the trial and changes nothing."""

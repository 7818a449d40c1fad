"""The daemon, ``wayfarer run``: the supervisor of one rover, with everything that a service needs around it."""

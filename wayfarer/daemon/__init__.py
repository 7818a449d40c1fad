"""The daemon, ``wayfarer run``: the supervisor of one rover as a service, with log, socket and watchdogs."""

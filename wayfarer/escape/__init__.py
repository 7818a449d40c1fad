"""Pure decision logic: what to do next when something is wrong. See ``phases`` for the theory of operation."""

"""Pure decision logic: what to do after an anomaly. ``phases`` holds the theory of operation."""

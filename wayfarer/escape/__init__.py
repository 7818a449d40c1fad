"""Pure decision logic: what to do after an anomaly. ``phases`` explains how an escape works."""

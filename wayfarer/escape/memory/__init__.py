"""The algorithm that remembers contacts: a map of trunks, the way around them, and the handler that drives it."""

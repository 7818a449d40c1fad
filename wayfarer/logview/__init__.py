"""What a field log says, as text (list, events, summary, damage), and what all viewers share: path and colours."""

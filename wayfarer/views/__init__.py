"""What people see of a run: as text, as a page while it lasts or afterwards, in Foxglove. All read the same records."""

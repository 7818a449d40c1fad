"""Files whose folder may belong to another user: read without waiting, written whole and not through a symlink."""

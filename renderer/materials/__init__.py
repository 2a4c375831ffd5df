"""Materials, one kind a file."""

"""PLY files: vertices and faces as they stand in the file."""

"""The reference backends, a file each."""

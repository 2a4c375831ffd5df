"""Image files: reading, writing, and pbrt-v4's resizing before look-ups."""

"""pbrt-v4 as a reference."""

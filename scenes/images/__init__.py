"""Image files in and out, and what pbrt-v4 does to them before any look-up."""

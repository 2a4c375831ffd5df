"""Directives, one file a family, with pbrt-v4's own defaults."""

"""Scenes of other programs as pbrt-v4 text; in `pipeline`, since a command alone needs them."""

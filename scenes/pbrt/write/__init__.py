"""A `SceneDescription` as pbrt-v4 text."""

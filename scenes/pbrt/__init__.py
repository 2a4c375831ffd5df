"""pbrt-v4 text to a frozen `SceneDescription`, and back."""

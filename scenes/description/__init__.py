"""Scenes, once their text is read: frozen, in world space, in float64, free of any renderer."""

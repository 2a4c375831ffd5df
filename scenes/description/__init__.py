"""Scenes as data: frozen, in world space, in float64, free of any renderer."""

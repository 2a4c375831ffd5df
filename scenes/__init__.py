"""Scenes: pbrt-v4 text is read into a frozen `SceneDescription`. This package imports none of the others."""

from scenes.catalog import library, load
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError, SceneError

__all__ = ["PenumbraError", "SceneDescription", "SceneError", "library", "load"]

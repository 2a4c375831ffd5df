"""Scenes: pbrt-v4 text in, a frozen `SceneDescription` out. The ground floor; imports no sibling package."""

from scenes.catalog import library, load
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError, SceneError

__all__ = ["PenumbraError", "SceneDescription", "SceneError", "library", "load"]

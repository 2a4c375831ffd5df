"""The scenes of the library as cases of a test."""

from __future__ import annotations

from typing import Any

import pytest

import scenes

LARGE = {"forest"}  # a million triangles: seconds for what takes the others a moment


def library_cases() -> list[Any]:
    """The names of all scenes; what is large is marked so, and left out by `make test-fast`."""
    names = [scene.name for scene in scenes.library()]
    return [pytest.param(name, marks=pytest.mark.large) if name in LARGE else name for name in names]

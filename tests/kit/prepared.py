"""A library scene, read and built as a worker has it."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.run.job import PreparedScene, build_scene, read_scene


def prepare(name: str, parameters: Mapping[str, float]) -> PreparedScene:
    """Read and build a scene by its library name or path."""
    return build_scene(read_scene(name, parameters))

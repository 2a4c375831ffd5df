"""Exported scenes on disk."""

from __future__ import annotations

from pathlib import Path

from scenes.description.scene import SceneDescription
from scenes.images.exr import write_exr
from scenes.pbrt.write.scene import ExportedScene, export


def written(scene: SceneDescription, folder: Path) -> Path:
    """The scene as a file in `folder`, its images beside it."""
    return laid_out(export(scene, "scene"), folder)


def laid_out(exported: ExportedScene, folder: Path) -> Path:
    """What was exported as a file in `folder`, its images beside it."""
    for name, image in exported.images.items():
        write_exr(folder / name, {channel: image[..., i] for i, channel in enumerate("RGB")})
    path = folder / "scene.pbrt"
    path.write_text(exported.text)
    return path

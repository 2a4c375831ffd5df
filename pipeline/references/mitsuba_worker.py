# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""Renders one task with Mitsuba 3, in a process of its own: `python -m pipeline.references.mitsuba_worker FOLDER`.

The only import of mitsuba. Its variant is global to a process and a wrong LLVM aborts it: both are reasons for a process
of its own. FOLDER holds task.pickle (a `Task`, written by the parent) and gets result.npz; progress goes to stdout,
one line `penumbra-progress SHARE` a pass. What it is given is declared here, and it imports nothing of the project: a worker
starts in the time that mitsuba takes.
"""

from __future__ import annotations

import pickle
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import mitsuba as mi

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

PROGRESS = "penumbra-progress"
TASK, RESULT = "task.pickle", "result.npz"
RAY_LIFT = 9e-5  # times 1 + max|p| in Mitsuba's units: how far a ray starts off its surface


@dataclass(frozen=True, eq=False)
class MitsubaShape:
    """One Mitsuba shape. kind: rectangle, disk, sphere or mesh; to_world: (4, 4), local to normalised world, for the first three.

    flip: normals the other way (spheres only; elsewhere it is in the geometry). vertices (m, 3), faces (t, 3): of a mesh.
    """

    kind: str
    reflectance: Array
    radiance: Array | None
    to_world: Array | None = None
    flip: bool = False
    vertices: Array | None = None
    faces: Faces | None = None


@dataclass(frozen=True, eq=False)
class MitsubaScene:
    """A scene as the worker builds it. camera_to_world: (4, 4), right-handed as Mitsuba's; fov: degrees over the shorter side."""

    camera_to_world: Array
    fov: float
    clip: tuple[float, float]
    width: int
    height: int
    shapes: tuple[MitsubaShape, ...]


@dataclass(frozen=True, eq=False)
class Task:
    """batches runs of `passes` calls of `spp` samples a pixel each; seeds: (batches * passes,), one a call, in that order."""

    variant: str
    scene: MitsubaScene
    batches: int
    passes: int
    spp: int
    seeds: tuple[int, ...]


def main(folder: Path) -> None:
    """Render the task in `folder` and leave there mean, m2 (sum of squared deviations of the batch means), lift and seconds."""
    import mitsuba as mi

    task: Task = pickle.loads((folder / TASK).read_bytes())
    mi.set_variant(task.variant)
    mi.set_log_level(mi.LogLevel.Error)
    scene = _build(mi, task.scene)
    start = time.perf_counter()
    mean, m2 = _accumulate(mi, scene, task)
    np.savez(folder / RESULT, mean=mean, m2=m2, lift=_lift(mi, scene, task.scene), seconds=time.perf_counter() - start)


def _accumulate(mi: Any, scene: Any, task: Task) -> tuple[Array, Array]:
    """Welford's mean and m2 of the batch means, (h, w, 3) float64 each; a batch's mean is over its passes."""
    shape = (task.scene.height, task.scene.width, 3)
    mean, m2, seeds = np.zeros(shape), np.zeros(shape), iter(task.seeds)
    for batch in range(task.batches):
        total = np.zeros(shape)
        for part in range(task.passes):
            total += np.array(mi.render(scene, seed=next(seeds), spp=task.spp), dtype=np.float64)
            print(PROGRESS, (batch * task.passes + part + 1) / len(task.seeds), flush=True)
        delta = total / task.passes - mean
        mean += delta / (batch + 1)
        m2 += delta * (total / task.passes - mean)
    return mean, m2


def _lift(mi: Any, scene: Any, task: MitsubaScene) -> float:
    """How far rays start off the surfaces in view, in pixels at their distance, at its worst: the image is blind to finer gaps."""
    integrator = mi.load_dict({"type": "aov", "aovs": "p:position,t:depth"})
    x, y, z, depth = np.moveaxis(np.array(mi.render(scene, integrator=integrator, spp=1), dtype=np.float64), -1, 0)
    lift = RAY_LIFT * (1.0 + np.abs([x, y, z]).max(axis=0))
    pixel = depth * 2 * np.tan(np.radians(task.fov) / 2) / min(task.width, task.height)
    return float(np.max(lift[depth > 0] / pixel[depth > 0], initial=0.0))


def _build(mi: Any, scene: MitsubaScene) -> mi.Scene:
    """One emitter and one BSDF sample a camera ray, weighted by MIS: pbrt's `path` at maxdepth 1. Lights are seen directly."""
    spec: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1, "hide_emitters": False},
        "sensor": _sensor(mi, scene),
    }
    return mi.load_dict(spec | {f"shape{i}": _shape(mi, shape) for i, shape in enumerate(scene.shapes)})


def _sensor(mi: Any, scene: MitsubaScene) -> dict[str, Any]:
    film = {
        "type": "hdrfilm",
        "width": scene.width,
        "height": scene.height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    return {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f(scene.camera_to_world),
        "fov": scene.fov,
        "fov_axis": "smaller",
        "near_clip": scene.clip[0],
        "far_clip": scene.clip[1],
        "film": film,
        "sampler": {"type": "independent"},
    }


def _shape(mi: Any, shape: MitsubaShape) -> Any:
    # `diffuse` is black from behind and pbrt's is not.
    parts: dict[str, Any] = {
        "bsdf": {"type": "twosided", "one": {"type": "diffuse", "reflectance": _rgb(shape.reflectance)}}
    }
    if shape.radiance is not None:
        parts["emitter"] = {"type": "area", "radiance": _rgb(shape.radiance)}
    if shape.kind == "mesh":
        return _mesh(mi, shape, parts)
    spec = {"type": shape.kind, "to_world": mi.ScalarTransform4f(shape.to_world)} | parts
    return spec | {"flip_normals": shape.flip} if shape.kind == "sphere" else spec


def _mesh(mi: Any, shape: MitsubaShape, parts: dict[str, Any]) -> Any:
    """Flat normals: mesh emitters with vertex normals disagree with themselves."""
    assert shape.vertices is not None and shape.faces is not None
    properties = mi.Properties("mesh")
    properties["face_normals"] = True
    for name, part in parts.items():
        properties[name] = mi.load_dict(part)
    mesh = mi.Mesh("mesh", len(shape.vertices), len(shape.faces), properties)
    buffers = mi.traverse(mesh)
    buffers["vertex_positions"] = shape.vertices.astype(np.float32).ravel()
    buffers["faces"] = shape.faces.astype(np.uint32).ravel()
    buffers.update()
    return mesh


def _rgb(value: Array) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(x) for x in value]}


if __name__ == "__main__":
    main(Path(sys.argv[1]))

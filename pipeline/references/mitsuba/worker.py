# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The worker that renders a task with Mitsuba 3: `python -m pipeline.references.mitsuba.worker FOLDER`.

The only import of mitsuba, in a process of its own: Mitsuba's variant is global to a process, and a wrong
LLVM aborts it. FOLDER holds task.pickle, a `Task` that the parent wrote. The worker prints `penumbra-lift
PIXELS` (see `_lift`), and for each batch `penumbra-batch NUMBER` once its file is whole. The classes of tasks
are declared here, so that the worker imports little besides mitsuba and starts fast.
"""

from __future__ import annotations

import pickle
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.references.mitsuba.plugins import register

if TYPE_CHECKING:
    import mitsuba as mi

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

BATCH, LIFT = "penumbra-batch", "penumbra-lift"
TASK = "task.pickle"
RAY_LIFT = 9e-5  # times 1 + max|p| in Mitsuba's units: how far a ray starts off its surface


@dataclass(frozen=True, eq=False)
class Plugin:
    """One Mitsuba object. tag: its XML element (shape, bsdf, emitter, texture); kind: its `type` there.

    values, by Mitsuba's names: float, int, bool or str; (3,) a colour; (4, 4) or (3, 3) a transformation; (h,
    w, c) a bitmap; or a Plugin. The kind "mesh" has vertices (m, 3), faces (t, 3) int64 and uv, (m, 2) or
    None, beside them.
    """

    tag: str
    kind: str
    values: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MitsubaScene:
    """A scene as the worker builds it.

    camera_to_world: (4, 4), right-handed as Mitsuba's. sensor: the camera's plug-in. filter: the pixel filter
    in x and in y, as offsets from the pixel's middle at equal steps of probability; None for the box of one
    pixel. film: (3, 3), from homogeneous film points in [0, 1]^2 to the sensor's; None for the identity.
    pixel: its width at distance 1. notes: remarks for a reader of the reference, by name.
    """

    camera_to_world: Array
    sensor: Plugin
    clip: tuple[float, float]
    width: int
    height: int
    objects: tuple[Plugin, ...]
    pixel: float
    filter: tuple[Array, Array] | None = None
    film: Array | None = None
    notes: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Task:
    """One batch of `spp` samples a pixel for each of `seeds`.

    hide_lights: whether the camera sees no lights; pixels that meet nothing then read 0.
    """

    variant: str
    scene: MitsubaScene
    spp: int
    seeds: tuple[int, ...]
    hide_lights: bool = False


def batch_file(folder: Path, number: int) -> Path:
    """The file of batch `number` of a task, (h, w, 3) in Mitsuba's own float32."""
    return folder / f"{number}.npy"


def main(folder: Path) -> None:
    """Render the task in `folder`, batch by batch."""
    import drjit as dr
    import mitsuba as mi

    task: Task = pickle.loads((folder / TASK).read_bytes())
    mi.set_variant(task.variant)
    mi.set_log_level(mi.LogLevel.Error)
    register(mi, dr, task.scene.filter, task.scene.film)
    scene = _build(mi, task)
    print(LIFT, _lift(mi, scene, task.scene), flush=True)
    for number, seed in enumerate(task.seeds):
        image = np.array(mi.render(scene, seed=seed, spp=task.spp), dtype=np.float32)  # pyright: ignore[reportArgumentType]
        np.save(batch_file(folder, number), image)
        print(BATCH, number, flush=True)


def _lift(mi: Any, scene: Any, task: MitsubaScene) -> float:
    """The largest distance that rays start off a surface in view, in pixels: the image misses finer gaps."""
    integrator = mi.load_dict({"type": "aov", "aovs": "p:position,t:depth"})
    x, y, z, depth = np.moveaxis(
        np.array(mi.render(scene, integrator=integrator, spp=1), dtype=np.float64), -1, 0
    )
    lift = RAY_LIFT * (1.0 + np.abs([x, y, z]).max(axis=0))
    return float(np.max(lift[depth > 0] / (depth * task.pixel)[depth > 0], initial=0.0))


def _build(mi: Any, task: Task) -> mi.Scene:
    """One emitter and one BSDF sample a camera ray, weighted by MIS: pbrt's `path` at maxdepth 1.

    Lights are seen directly.
    """
    spec: dict[str, Any] = {
        "type": "scene",
        "integrator": {
            "type": "direct",
            "emitter_samples": 1,
            "bsdf_samples": 1,
            "hide_emitters": task.hide_lights,
        },
        "sensor": _sensor(mi, task.scene),
    }
    return mi.load_dict(
        spec | {f"object{i:06}": _value(mi, item) for i, item in enumerate(task.scene.objects)}
    )


def _sensor(mi: Any, scene: MitsubaScene) -> dict[str, Any]:
    film = {
        "type": "hdrfilm",
        "width": scene.width,
        "height": scene.height,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    camera = {
        **_value(mi, scene.sensor),
        "to_world": mi.ScalarTransform4f(scene.camera_to_world),
        "near_clip": scene.clip[0],
        "far_clip": scene.clip[1],
        "film": film,
        "sampler": {"type": "independent"},
    }
    if scene.filter is None:
        return camera
    return {
        "type": "penumbra_filtered",
        "camera": camera,
        "film": dict(film),
        "sampler": {"type": "independent"},
    }


def _value(mi: Any, value: Any) -> Any:
    """Convert a value of a `Plugin` to the form that mi.load_dict takes."""
    if isinstance(value, Plugin):
        if value.kind == "mesh":
            return _mesh(mi, value)
        return {"type": value.kind} | {name: _value(mi, part) for name, part in value.values.items()}
    if not isinstance(value, np.ndarray):
        return value
    if value.ndim == 1:
        return {"type": "rgb", "value": [float(x) for x in value]}
    if value.ndim == 2:
        return mi.ScalarTransform4f(value) if len(value) == 4 else mi.ScalarTransform3f(value)
    return mi.Bitmap(np.ascontiguousarray(value, dtype=np.float32))


def _mesh(mi: Any, mesh: Plugin) -> Any:
    """The mesh as Mitsuba's; without vertex normals each face is shaded by its own."""
    values = dict(mesh.values)
    vertices, faces, uv = values.pop("vertices"), values.pop("faces"), values.pop("uv", None)
    normals = values.pop("normals", None)
    properties = mi.Properties("mesh")
    properties["face_normals"] = normals is None
    for name, part in values.items():
        properties[name] = mi.load_dict(_value(mi, part))
    made = mi.Mesh(
        "mesh",
        len(vertices),
        len(faces),
        properties,
        has_vertex_normals=normals is not None,
        has_vertex_texcoords=uv is not None,
    )
    buffers = mi.traverse(made)
    buffers["vertex_positions"] = vertices.astype(np.float32).ravel()
    buffers["faces"] = faces.astype(np.uint32).ravel()
    if uv is not None:
        buffers["vertex_texcoords"] = uv.astype(np.float32).ravel()
    if normals is not None:
        buffers["vertex_normals"] = normals.astype(np.float32).ravel()
    buffers.update()
    return made


if __name__ == "__main__":
    # By the module's name: pickled tasks are of its classes, not of __main__'s.
    from pipeline.references.mitsuba import worker as mitsuba_worker

    mitsuba_worker.main(Path(sys.argv[1]))

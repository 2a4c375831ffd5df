"""SceneDescription -> RenderScene: the one place where the renderer reads descriptions of shapes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.arrays import Floats
from renderer.bounds import TOLERANCE, ShapeBounds, shape_bounds
from renderer.camera import Camera, make_camera
from renderer.intersect import Triangles, make_triangles
from renderer.lights.protocol import LIGHTS, LightKind
from renderer.materials.protocol import MATERIALS, MaterialKind
from renderer.quadrics import Quadrics, disk, join, rectangle, sphere
from scenes.description import BilinearMesh, Disk, SceneDescription, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import PenumbraError, SceneError


@dataclass(frozen=True, eq=False)
class RenderScene:
    """A scene as arrays. s shapes, K lights in all, numbered kind by kind.

    emission: (3, s) radiance, 0 for shapes that do not emit. two_sided: (s,).
    light_shape, light_quadric: (K,) which shape and which quadric each light is. quadric_light: its inverse, -1 for none.
    material_of: (s,) which of the materials each shape has. touch: world units; surfaces nearer than this to each other count as touching. seconds_build: wall clock.
    """

    description: SceneDescription
    camera: Camera
    triangles: Triangles | None
    quadrics: Quadrics
    lights: tuple[LightKind, ...]
    materials: tuple[MaterialKind, ...]
    bounds: tuple[ShapeBounds, ...]
    emission: Floats
    two_sided: NDArray[np.bool_]
    light_shape: NDArray[np.int64]
    light_quadric: NDArray[np.int64]
    quadric_light: NDArray[np.int64]
    material_of: NDArray[np.int64]
    light_names: tuple[str, ...]
    touch: float
    seconds_build: float

    def rows_of_materials(self, shape: NDArray[np.int64]) -> Iterator[tuple[MaterialKind, NDArray[np.int64]]]:
        """Each kind of material with the rows (m,) of shape (n,) that are of it."""
        own = self.material_of[shape]
        for i, kind in enumerate(self.materials):
            rows = np.flatnonzero(own == i)
            if rows.size:
                yield kind, rows


def build(scene: SceneDescription) -> RenderScene:
    """Arrays, BVH and lights of a scene. Raises SceneError where a shape is beyond this renderer, PenumbraError without lights."""
    start = time.perf_counter()
    shapes = scene.shapes
    if not any(s.emission is not None for s in shapes):
        raise PenumbraError(f"scene {scene.name!r} has no lights: nothing in it would be lit or seen")
    quadrics = _quadrics(shapes)
    lights, names = _lights(shapes)
    light_shape = np.concatenate([kind.shape for kind in lights])
    black = np.zeros(3)
    light_quadric = _own_quadrics(light_shape, quadrics)
    quadric_light = np.full(len(quadrics), -1)
    quadric_light[light_quadric] = np.arange(light_quadric.size)
    materials, bounds = _materials(shapes), tuple(shape_bounds(s) for s in shapes)
    return RenderScene(
        description=scene,
        camera=make_camera(scene.camera, scene.film),
        triangles=_triangles(shapes),
        quadrics=quadrics,
        lights=lights,
        materials=materials,
        bounds=bounds,
        emission=np.stack([s.emission.radiance if s.emission else black for s in shapes], axis=1),
        two_sided=np.array([s.emission is not None and s.emission.two_sided for s in shapes]),
        light_shape=light_shape,
        light_quadric=light_quadric,
        quadric_light=quadric_light,
        material_of=np.array([[kind.accepts(s) for kind in materials].index(True) for s in shapes]),
        light_names=names,
        touch=4 * TOLERANCE * _size(bounds, scene),
        seconds_build=time.perf_counter() - start,
    )


def _size(bounds: Sequence[ShapeBounds], scene: SceneDescription) -> float:
    """The largest coordinate of the scene and its camera: what the rounding of points scales with."""
    extents = np.array([b.extent(np.eye(3)) for b in bounds])
    return float(max(np.abs(extents).max(), np.abs(scene.camera.camera_to_world[:3, 3]).max()))


def _lights(shapes: Sequence[ShapeDescription]) -> tuple[tuple[LightKind, ...], tuple[str, ...]]:
    """All lights kind by kind, and a name for each."""
    emitting = [i for i, s in enumerate(shapes) if s.emission is not None]
    kinds: list[LightKind] = []
    names: list[str] = []
    for name, kind in LIGHTS.items():
        mine = [i for i in emitting if kind.accepts(shapes[i])]
        emitting = [i for i in emitting if i not in mine]
        if mine:
            made = kind.make([shapes[i] for i in mine], mine)
            names += [f"{name} {len(names) + j}" for j in range(made.shape.size)]
            kinds.append(made)
    for i in emitting:
        kind_name = type(shapes[i].geometry).__name__
        raise SceneError(
            f"an emitting {kind_name} is not supported; lights are: {', '.join(LIGHTS.names())}", shapes[i].where
        )
    return tuple(kinds), tuple(names)


def _materials(shapes: Sequence[ShapeDescription]) -> tuple[MaterialKind, ...]:
    kinds = [kind for _, kind in MATERIALS.items() if any(kind.accepts(s) for s in shapes)]
    for s in shapes:
        if not any(kind.accepts(s) for kind in kinds):
            raise SceneError(f"material {type(s.material).__name__} is not supported", s.where)
    return tuple(kind.make(shapes) for kind in kinds)


def _quadrics(shapes: Sequence[ShapeDescription]) -> Quadrics:
    """Spheres, disks, and the rectangles that emit, in the order of shapes."""
    return join([one for i, s in enumerate(shapes) for one in _own(i, s)])


def _own(i: int, s: ShapeDescription) -> list[Quadrics]:
    """The quadrics of shape i."""
    g = s.geometry
    if isinstance(g, Sphere):
        return [sphere(i, g.center, g.radius, g.reverse)]
    if isinstance(g, Disk):
        return [disk(i, g.center, g.normal, g.radius)]
    if isinstance(g, BilinearMesh) and s.emission is not None:
        return [rectangle(i, corners, g.reverse) for corners in g.vertices[g.faces]]
    return []


def _triangles(shapes: Sequence[ShapeDescription]) -> Triangles | None:
    """All triangles and all patches that do not emit, as one mesh; None without any."""
    vertices: list[Floats] = []
    faces: list[NDArray[np.int64]] = []
    shape: list[NDArray[np.int64]] = []
    reverse: list[NDArray[np.bool_]] = []
    offset = 0
    for i, s in enumerate(shapes):
        g = s.geometry
        if isinstance(g, TriangleMesh):
            own = g.faces
        elif isinstance(g, BilinearMesh) and s.emission is None:
            own = np.concatenate([g.faces[:, [0, 1, 3]], g.faces[:, [0, 3, 2]]])
        else:
            continue
        vertices.append(g.vertices)
        faces.append(own + offset)
        shape.append(np.full(len(own), i, dtype=np.int64))
        reverse.append(np.full(len(own), g.reverse))
        offset += len(g.vertices)
    if not vertices:
        return None
    return make_triangles(
        np.concatenate(vertices), np.concatenate(faces), np.concatenate(shape), np.concatenate(reverse)
    )


def _own_quadrics(light_shape: NDArray[np.int64], quadrics: Quadrics) -> NDArray[np.int64]:
    """(K,) the quadric that each light is: the j-th light of a shape is the shape's j-th quadric."""
    first = np.searchsorted(quadrics.shape, light_shape)
    same = light_shape[:, None] == light_shape
    return first + np.tril(same, -1).sum(axis=1)

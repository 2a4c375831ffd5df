"""SceneDescription -> RenderScene: the one place where the renderer reads descriptions of shapes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera, make_camera
from renderer.geometry.analytic import AnalyticPrimitives
from renderer.geometry.primitives import (
    TOLERANCE,
    all_triangles,
    analytic_primitives,
    is_analytic,
    without_skew,
)
from renderer.geometry.shading_normals import ShadingNormals, shading_normals
from renderer.geometry.triangles import Triangles
from renderer.geometry.uv import Coordinates, coordinates
from renderer.interfaces.light import LIGHTS, LightGroup, Source, Surroundings
from renderer.interfaces.material import MATERIALS, Lobes, MaterialKind, lobes_of, material_kind
from renderer.math.vectors import Floats
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Bounds, ShapeDescription, vertex_normals
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class Sources:
    """All that sends out light: the shapes that emit, in their order, then the lights that are no shapes.

    shape: (q,) which shape each is, -1 for none. of_shape: (s,) its inverse, -1 for shapes that do not emit.
    names: (q,).
    """

    all: tuple[Source, ...]
    shape: NDArray[np.int64]
    of_shape: NDArray[np.int64]
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Lights:
    """K lights in all, numbered kind by kind: a source is one light, or one for each face of a mesh.

    source: (K,) what each is part of. pmf, cdf: (K,) the chance of choosing it, every source being equally
    likely, and the running sum of that. delta: (K,) whether it is never met by chance. primitive, triangle:
    (K,) the analytic primitive and the triangle that it is, -1 for none; of_primitive, of_triangle: inverses.
    environment: what surrounds the scene, and the number of its light.
    """

    kinds: tuple[LightGroup, ...]
    source: NDArray[np.int64]
    pmf: Floats
    cdf: Floats
    delta: NDArray[np.bool_]
    primitive: NDArray[np.int64]
    triangle: NDArray[np.int64]
    of_primitive: NDArray[np.int64]
    of_triangle: NDArray[np.int64]
    environment: tuple[Surroundings, int] | None

    def __len__(self) -> int:
        return self.source.size


@dataclass(frozen=True, eq=False)
class RenderScene:
    """A scene as arrays, of s shapes.

    emissive_triangles: the triangles that emit alone; None where none does.
    emission: (3, s) radiance, 0 for shapes that do not emit. two_sided: (s,). emission_images: images (h, w,
    3) that shapes multiply their radiance by. coordinates: what textures are laid by; None where nothing
    varies. shading_normals: None without vertex normals.
    material_of: (s,) which of the materials each shape has. lobes: (s,) the `Lobes` of each.
    contact_epsilon: world units; surfaces nearer than this to each other count as touching. scene_diameter:
    world units, beyond everything from any point of the scene.
    seconds_build: wall clock.
    """

    description: SceneDescription
    camera: Camera
    triangles: Triangles | None
    analytic: AnalyticPrimitives
    sources: Sources
    lights: Lights
    emissive_triangles: Triangles | None
    materials: tuple[MaterialKind, ...]
    bounds: tuple[Bounds, ...]
    emission: Floats
    two_sided: NDArray[np.bool_]
    emission_images: tuple[tuple[int, Floats], ...]
    coordinates: Coordinates | None
    shading_normals: ShadingNormals | None
    material_of: NDArray[np.int64]
    lobes: NDArray[np.int64]
    contact_epsilon: float
    scene_diameter: float
    seconds_build: float

    @property
    def specular(self) -> bool:
        """Whether any material has a delta lobe."""
        return bool((self.lobes & Lobes.SPECULAR).any())

    @property
    def transmits(self) -> NDArray[np.bool_]:
        """(s,): shapes that let light through."""
        return (self.lobes & Lobes.TRANSMISSION) != 0

    @property
    def smooth(self) -> NDArray[np.bool_]:
        """(s,): shapes with vertex normals."""
        return np.array(
            [vertex_normals(s.geometry) is not None for s in self.description.shapes], dtype=np.bool_
        )

    def rows_of_materials(self, shape: NDArray[np.int64]) -> Iterator[tuple[MaterialKind, NDArray[np.int64]]]:
        """Each kind of material with the rows (m,) of shape (n,) that are of it."""
        own = self.material_of[shape]
        for i, kind in enumerate(self.materials):
            rows = np.flatnonzero(own == i)
            if rows.size:
                yield kind, rows


def build(scene: SceneDescription) -> RenderScene:
    """Arrays, BVH and lights of a scene.

    Raises SceneError where a shape or a light is beyond this renderer.
    """
    start = time.perf_counter()
    shapes = tuple(without_skew(s) for s in scene.shapes)
    scene = replace(scene, shapes=shapes)
    sources, triangles, analytic = _sources(scene), all_triangles(shapes), analytic_primitives(shapes)
    lights = _lights(sources, triangles, analytic)
    glowing = lights.of_triangle >= 0
    materials, bounds = _materials(shapes), tuple(s.geometry.bounds() for s in shapes)
    camera = make_camera(scene.camera, scene.film)
    size, scene_diameter = _size(bounds, camera.eyes)
    black = np.zeros(3)
    return RenderScene(
        description=scene,
        camera=camera,
        triangles=triangles,
        analytic=analytic,
        sources=sources,
        lights=lights,
        emissive_triangles=triangles.only(glowing) if triangles is not None and glowing.any() else None,
        materials=materials,
        bounds=bounds,
        emission=np.stack([s.emission.radiance if s.emission else black for s in shapes] or [black], axis=1),
        two_sided=np.array([s.emission is not None and s.emission.two_sided for s in shapes], dtype=np.bool_),
        emission_images=tuple(
            (i, s.emission.image) for i, s in enumerate(shapes) if s.emission and s.emission.image is not None
        ),
        coordinates=coordinates(shapes, analytic),
        shading_normals=shading_normals(shapes),
        material_of=np.array(
            [[kind.accepts(s) for kind in materials].index(True) for s in shapes], dtype=np.int64
        ),
        lobes=np.array([lobes_of(s) for s in shapes], dtype=np.int64),
        contact_epsilon=4 * TOLERANCE * size,
        scene_diameter=scene_diameter,
        seconds_build=time.perf_counter() - start,
    )


def _size(bounds: Sequence[Bounds], eyes: Floats) -> tuple[float, float]:
    """The largest coordinate of the scene and of eyes (3, m), which the rounding of points scales with; and
    a length from any point of the scene to beyond all of it.
    """
    axes = np.eye(3)
    low = np.min([*eyes.T, *(b.extent(axes)[0] for b in bounds)], axis=0)
    high = np.max([*eyes.T, *(b.extent(axes)[1] for b in bounds)], axis=0)
    return float(np.abs([low, high]).max()), 2 * float(np.linalg.norm(high - low))


def _sources(scene: SceneDescription) -> Sources:
    emitting = [i for i, s in enumerate(scene.shapes) if s.emission is not None]
    everything: tuple[Source, ...] = (*(scene.shapes[i] for i in emitting), *scene.lights)
    of_shape = np.full(len(scene.shapes), -1, dtype=np.int64)
    of_shape[emitting] = np.arange(len(emitting))
    shape = np.array([*emitting, *(-1 for _ in scene.lights)], dtype=np.int64)
    names = tuple(f"{_kind(source)} {i}" for i, source in enumerate(everything))
    return Sources(everything, shape, of_shape, names)


def _kind(source: Source) -> str:
    """The name of the kind of light that takes a source; SceneError where none does."""
    for name, kind in LIGHTS.items():
        if kind.accepts(source):
            return name
    what = type(source.geometry).__name__ if isinstance(source, ShapeDescription) else type(source).__name__
    raise SceneError(
        f"an emitting {what} is not supported; lights are: {', '.join(LIGHTS.names())}", source.where
    )


def _lights(sources: Sources, triangles: Triangles | None, analytic: AnalyticPrimitives) -> Lights:
    kinds: list[LightGroup] = []
    certain: list[NDArray[np.bool_]] = [np.zeros(0, dtype=np.bool_)]
    for name, kind in LIGHTS.items():
        mine = [i for i, source in enumerate(sources.all) if _kind(source) == name]
        if mine:
            kinds.append(kind.make([sources.all[i] for i in mine], mine))
            certain.append(np.full(kinds[-1].parts.source.size, kind.delta))
    source = np.concatenate([np.zeros(0, dtype=np.int64), *(kind.parts.source for kind in kinds)])
    share = np.concatenate([np.zeros(0), *(kind.parts.share for kind in kinds)])
    pmf = share / max(len(sources.all), 1)
    primitive, triangle = _primitives(sources, source, triangles, analytic)
    return Lights(
        kinds=tuple(kinds),
        source=source,
        pmf=pmf,
        cdf=np.cumsum(pmf),
        delta=np.concatenate(certain),
        primitive=primitive,
        triangle=triangle,
        of_primitive=_inverse(primitive, len(analytic)),
        of_triangle=_inverse(triangle, 0 if triangles is None else triangles.shape.size),
        environment=_environment(kinds),
    )


def _environment(kinds: Sequence[LightGroup]) -> tuple[Surroundings, int] | None:
    """What surrounds the scene; SceneError where a scene has more than one environment."""
    first = 0
    for kind in kinds:
        if isinstance(kind, Surroundings):
            if kind.parts.source.size > 1:
                raise SceneError("the scene has more than one environment light: one at most is supported")
            return kind, first
        first += kind.parts.source.size
    return None


def _primitives(
    sources: Sources, source: NDArray[np.int64], triangles: Triangles | None, analytic: AnalyticPrimitives
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(K,) each: the analytic primitive and the triangle that each light is.

    The j-th light of a shape is its j-th primitive.
    """
    shape = sources.shape[source]
    _, first, own = np.unique(source, return_index=True, return_inverse=True)
    order = np.arange(source.size) - first[own]
    exact = np.array(
        [isinstance(s, ShapeDescription) and is_analytic(s) for s in sources.all], dtype=np.bool_
    )[source]
    none = np.full(source.size, -1, dtype=np.int64)
    primitive = np.where(exact, np.searchsorted(analytic.shape, shape) + order, none)
    if triangles is None:
        return primitive, none
    return primitive, np.where((shape >= 0) & ~exact, np.searchsorted(triangles.shape, shape) + order, none)


def _inverse(which: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,): the position of each number in which (K,), -1 for those that are not in it."""
    out = np.full(count, -1, dtype=np.int64)
    rows = np.flatnonzero(which >= 0)
    out[which[rows]] = rows
    return out


def _materials(shapes: Sequence[ShapeDescription]) -> tuple[MaterialKind, ...]:
    used = {material_kind(s) for s in shapes}
    return tuple(kind.make(shapes) for _, kind in MATERIALS.items() if kind in used)

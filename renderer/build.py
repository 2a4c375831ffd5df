"""SceneDescription -> RenderScene: the one place where the renderer reads descriptions of shapes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from renderer.camera import Camera, make_camera
from renderer.geometry.analytic import AnalyticPrimitives
from renderer.geometry.cutouts import Cutouts, cutouts
from renderer.geometry.normal_perturbation import NormalPerturbations, normal_perturbations
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
from renderer.light_sampling.coincident import Coincident, coincident_lights
from renderer.light_sampling.surroundings import with_one_surroundings
from renderer.math.vectors import Floats
from renderer.shading.mixtures import Mixtures, mixtures
from scenes.arrays import Index, Mask
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Bounds, ShapeDescription, boxes, vertex_normals
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class Sources:
    """The scene's sources of light: emitting shapes in their order, then the lights that have no shape.

    shape: (q,) the shape of each source, -1 for a light without one. of_shape: (s,) the source of each shape,
    -1 for a shape that does not emit. names: (q,).
    """

    all: tuple[Source, ...]
    shape: Index
    of_shape: Index
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Lights:
    """K lights, numbered kind by kind. A source is one light, or one light for each face of a mesh.

    source: (K,) the source that each light belongs to. pmf, cdf: (K,) the probability of choosing a light,
    where all sources are equally likely, and its running sum. delta: (K,) lights that no ray meets by chance:
    they have no extent, or an alpha of 0. primitive, triangle: (K,) the analytic primitive and the triangle
    of each light, -1 for none; of_primitive, of_triangle: the light of each primitive and triangle.
    coincident: None where no two lights share a place. environment: the light that surrounds the scene, and
    its number.
    """

    kinds: tuple[LightGroup, ...]
    source: Index
    pmf: Floats
    cdf: Floats
    delta: Mask
    primitive: Index
    triangle: Index
    of_primitive: Index
    of_triangle: Index
    environment: tuple[Surroundings, int] | None
    coincident: Coincident | None

    def __len__(self) -> int:
        return self.source.size


@dataclass(frozen=True, eq=False)
class RenderScene:
    """A scene of s shapes as arrays.

    emissive_triangles: the triangles that emit, None without any. emission: (3, s) radiance, 0 for shapes
    that do not emit. two_sided: (s,). emission_images: images (h, w, 3) that multiply the radiance of a
    shape. coordinates: texture coordinates, None where nothing varies. shading_normals: None without vertex
    normals. cutouts, perturbations, mixtures: None where no shape has an alpha, a normal or
    bump map, or several materials.
    material_of: (s + r,) the kind of material of each shape, then of the r rows that stand for the materials
    of mixes; -1 for a mix itself. lobes: (s,). boxes: two arrays (s, 3), least and greatest coordinates of
    each shape. contact_epsilon: world units; surfaces nearer than this to each other count as touching.
    scene_diameter: world units, from any point of the scene to beyond all of it. seconds_build: wall clock.
    """

    description: SceneDescription
    camera: Camera
    triangles: Triangles | None
    analytic: AnalyticPrimitives
    sources: Sources
    lights: Lights
    emissive_triangles: Triangles | None
    materials: tuple[MaterialKind, ...]
    boxes: tuple[Floats, Floats]
    emission: Floats
    two_sided: Mask
    emission_images: tuple[tuple[int, Floats], ...]
    coordinates: Coordinates | None
    shading_normals: ShadingNormals | None
    cutouts: Cutouts | None
    perturbations: NormalPerturbations | None
    mixtures: Mixtures | None
    material_of: Index
    lobes: Index
    contact_epsilon: float
    scene_diameter: float
    seconds_build: float

    def __len__(self) -> int:
        """The number of shapes."""
        return len(self.description.shapes)

    @cached_property
    def bounds(self) -> tuple[Bounds, ...]:
        """The bounds of each shape, made on demand: those of thousands of shapes cost more than
        their arrays.
        """
        return tuple(s.geometry.bounds() for s in self.description.shapes)

    @property
    def specular(self) -> bool:
        """Whether any material has a delta lobe."""
        return bool((self.lobes & Lobes.SPECULAR).any())

    @property
    def transmits(self) -> Mask:
        """(s,): whether a shape lets light through."""
        return (self.lobes & Lobes.TRANSMISSION) != 0

    @property
    def smooth(self) -> Mask:
        """(s,): whether a shape has shading normals of its own."""
        shapes = self.description.shapes
        own = [vertex_normals(s.geometry) is not None or s.perturbs_normals for s in shapes]
        return np.array(own, dtype=np.bool_)

    def rows_of_materials(self, shape: Index) -> Iterator[tuple[MaterialKind, Index]]:
        """Each kind of material, with the rows (m,) of a wavefront whose shapes (n,) are of that kind."""
        own = self.material_of[shape]
        for i, kind in enumerate(self.materials):
            rows = np.flatnonzero(own == i)
            if rows.size:
                yield kind, rows


def build(scene: SceneDescription) -> RenderScene:
    """Make arrays, BVH and lights of a scene. Raises SceneError for a shape or a light that this renderer
    does not know.
    """
    start = time.perf_counter()
    shapes = tuple(without_skew(s) for s in scene.shapes)
    scene = replace(scene, shapes=shapes)
    sources, triangles, analytic = _sources(scene), all_triangles(shapes), analytic_primitives(shapes)
    lights = _lights(sources, triangles, analytic)
    met = lights.of_triangle >= 0
    met[met] = ~lights.delta[lights.of_triangle[met]]
    rows, mixed = mixtures(shapes)
    materials, material_of = _materials(rows, mixed)
    boxed = boxes([s.geometry for s in shapes])
    camera = make_camera(scene.camera, scene.film)
    size, scene_diameter = _size(*boxed, camera.eyes)
    black = np.zeros(3)
    uv, smooth = coordinates(shapes, analytic), shading_normals(shapes)
    return RenderScene(
        description=scene,
        camera=camera,
        triangles=triangles,
        analytic=analytic,
        sources=sources,
        lights=lights,
        emissive_triangles=triangles.only(met) if triangles is not None and met.any() else None,
        materials=materials,
        boxes=boxed,
        emission=np.stack([s.emission.radiance if s.emission else black for s in shapes] or [black], axis=1),
        two_sided=np.array([s.emission is not None and s.emission.two_sided for s in shapes], dtype=np.bool_),
        emission_images=tuple(
            (i, s.emission.image) for i, s in enumerate(shapes) if s.emission and s.emission.image is not None
        ),
        coordinates=uv,
        shading_normals=smooth,
        cutouts=cutouts(shapes, uv),
        perturbations=normal_perturbations(rows, uv, smooth),
        mixtures=mixed,
        material_of=material_of,
        lobes=_lobes(shapes),
        contact_epsilon=4 * TOLERANCE * size,
        scene_diameter=scene_diameter,
        seconds_build=time.perf_counter() - start,
    )


def _size(low: Floats, high: Floats, eyes: Floats) -> tuple[float, float]:
    """The scale of rounding errors, which is the largest coordinate of boxes from low to high (s, 3) and of
    eyes (3, m); and a length that reaches from any point of the scene to beyond all of it.
    """
    least = np.min([*eyes.T, *low], axis=0)
    greatest = np.max([*eyes.T, *high], axis=0)
    return float(np.abs([least, greatest]).max()), 2 * float(np.linalg.norm(greatest - least))


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
    certain: list[LightGroup] = []
    kind_of = [_kind(source) for source in sources.all]
    for name, kind in LIGHTS.items():
        mine = [i for i, own in enumerate(kind_of) if own == name]
        if mine:
            kinds.append(kind.make([sources.all[i] for i in mine], mine))
            certain += kinds[-1:] if kind.delta else []
    kinds = with_one_surroundings(kinds)
    source = np.concatenate([np.zeros(0, dtype=np.int64), *(kind.parts.source for kind in kinds)])
    share = np.concatenate([np.zeros(0), *(kind.parts.share for kind in kinds)])
    pmf = share / max(np.unique(source).size, 1)
    primitive, triangle = _primitives(sources, source, triangles, analytic)
    # Sources that are shapes come first, in their order.
    shapes = [s for s in sources.all if isinstance(s, ShapeDescription)]
    coincident = coincident_lights(shapes, source, sources.shape[source] >= 0)
    if coincident is not None:
        pmf = coincident.mean(pmf)
    unmet = np.array([_is_unmet(one) for one in sources.all], dtype=np.bool_)
    delta = (unmet[g.parts.source] | any(g is one for one in certain) for g in kinds)
    return Lights(
        kinds=tuple(kinds),
        source=source,
        pmf=pmf,
        cdf=np.cumsum(pmf),
        delta=np.concatenate([np.zeros(0, dtype=np.bool_), *delta]),
        primitive=primitive,
        triangle=triangle,
        of_primitive=_inverse(primitive, len(analytic)),
        of_triangle=_inverse(triangle, 0 if triangles is None else triangles.shape.size),
        environment=_environment(kinds),
        coincident=coincident,
    )


def _is_unmet(source: Source) -> bool:
    """Whether a light is a shape of alpha 0, which every ray goes through."""
    alpha = source.alpha if isinstance(source, ShapeDescription) else None
    return isinstance(alpha, np.ndarray) and not alpha.any()


def _environment(kinds: Sequence[LightGroup]) -> tuple[Surroundings, int] | None:
    """The light that surrounds the scene, and its number."""
    first = 0
    for kind in kinds:
        if isinstance(kind, Surroundings):
            return kind, first
        first += kind.parts.source.size
    return None


def _primitives(
    sources: Sources, source: Index, triangles: Triangles | None, analytic: AnalyticPrimitives
) -> tuple[Index, Index]:
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


def _inverse(which: Index, count: int) -> Index:
    """(count,): the position of each number in `which` (K,), -1 for a number that is not there."""
    out = np.full(count, -1, dtype=np.int64)
    rows = np.flatnonzero(which >= 0)
    out[which[rows]] = rows
    return out


def _materials(
    rows: Sequence[ShapeDescription], mixed: Mixtures | None
) -> tuple[tuple[MaterialKind, ...], Index]:
    """The kinds of material in use, and the kind of each row by its position among them, -1 for a mix."""
    mixes = {choice.row for choice in mixed.choices} if mixed is not None else frozenset[int]()
    known: dict[int, type[MaterialKind]] = {}  # by material: thousands of shapes share a few
    for i, s in enumerate(rows):
        if i not in mixes and id(s.material) not in known:
            known[id(s.material)] = material_kind(s)
    used = set(known.values())
    kinds = [kind for _, kind in MATERIALS.items() if kind in used]
    number = {kind: i for i, kind in enumerate(kinds)}
    own = [-1 if i in mixes else number[known[id(s.material)]] for i, s in enumerate(rows)]
    return tuple(kind.make(rows) for kind in kinds), np.array(own, dtype=np.int64)


def _lobes(shapes: Sequence[ShapeDescription]) -> Index:
    """(s,)."""
    known: dict[int, Lobes] = {}
    for s in shapes:
        if id(s.material) not in known:
            known[id(s.material)] = lobes_of(s)
    return np.array([known[id(s.material)] for s in shapes], dtype=np.int64)

"""`ObjectInstance`s written out: every instance in world space, those of one material as one mesh.

Nothing is shared between instances, so their number is bounded; but a thousand trees are two shapes, not a
thousand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenes.description.shapes import BilinearMesh, Disk, Geometry, Sphere, TriangleMesh
from scenes.errors import Location, Report, SceneError
from scenes.pbrt.directives.shapes import moved_disk, moved_sphere, range_problem
from scenes.pbrt.state import InstanceUse, MaterialUse, PlacedShape
from scenes.pbrt.transforms import Transform

Array = NDArray[np.float64]

FACES = 50_000_000  # of all instances together: some 4 GB
SINGLES = 1_000_000  # spheres and disks, each a shape of its own


@dataclass(eq=False)
class _Pool:
    """The meshes that become one. It stands where its first instance does."""

    kind: type[TriangleMesh] | type[BilinearMesh]
    material: MaterialUse
    reverse: bool
    where: Location
    vertices: list[Array] = field(default_factory=list[Array])
    faces: list[NDArray[np.int64]] = field(default_factory=list[NDArray[np.int64]])
    uv: list[Array] = field(default_factory=list[Array])
    count: int = 0

    def add(self, mesh: TriangleMesh | BilinearMesh, moved: Array) -> None:
        self.vertices.append(moved)
        self.faces.append(mesh.faces + self.count)
        if mesh.uv is not None:
            self.uv.append(mesh.uv)
        self.count += len(moved)

    def shape(self) -> PlacedShape:
        uv = np.concatenate(self.uv) if self.uv else None
        mesh = self.kind(np.concatenate(self.vertices), np.concatenate(self.faces), self.reverse, uv)
        return PlacedShape(mesh, self.material, None, self.where)


def written_out(
    uses: Sequence[InstanceUse], objects: Mapping[str, Sequence[PlacedShape]], report: Report
) -> Iterable[PlacedShape]:
    """All instances as shapes of the world; SceneError for an unknown object, for too much, and for what
    leaves the range of coordinates.
    """
    _check_size(uses, objects)
    pools: dict[tuple[object, ...], _Pool] = {}
    single: list[PlacedShape] = []
    for use in uses:
        mirrored = use.transform.swaps_handedness
        for shape in objects[use.name]:
            mesh = shape.geometry
            if isinstance(mesh, Sphere | Disk):
                single += _moved(mesh, shape, use, report)
                continue
            reverse = mesh.reverse != mirrored
            key = (type(mesh), id(shape.material), reverse, mesh.uv is None)
            pool = pools.setdefault(key, _Pool(type(mesh), shape.material, reverse, use.where))
            pool.add(mesh, use.transform.points(mesh.vertices))
    shapes = [*(pool.shape() for pool in pools.values()), *single]
    for shape in shapes:
        problem = range_problem(shape.geometry)
        if problem is not None:
            raise SceneError(problem, shape.where)
    return shapes


def _check_size(uses: Sequence[InstanceUse], objects: Mapping[str, Sequence[PlacedShape]]) -> None:
    sizes = {name: [_faces(shape.geometry) for shape in shapes] for name, shapes in objects.items()}
    faces = singles = 0
    for use in uses:
        if use.name not in sizes:
            raise SceneError(
                f"no object is called {use.name!r}; there are: {', '.join(objects) or 'none'}", use.where
            )
        faces += sum(sizes[use.name])
        singles += sizes[use.name].count(0)
        if faces > FACES or singles > SINGLES:
            raise SceneError(
                (
                    f"the instances have more than {FACES:,} faces or {SINGLES:,} spheres and disks in all: "
                    "that is too much to write out"
                ),
                use.where,
            )


def _faces(geometry: Geometry) -> int:
    return len(geometry.faces) if isinstance(geometry, TriangleMesh | BilinearMesh) else 0


def _moved(
    geometry: Sphere | Disk, shape: PlacedShape, use: InstanceUse, report: Report
) -> list[PlacedShape]:
    moved = _quadric(geometry, use.transform)
    if moved is None:
        report.add(
            "the instance stretches a sphere or a disk; ellipsoids and ellipses are not supported", use.where
        )
        return []
    return [PlacedShape(moved, shape.material, None, use.where)]


def _quadric(geometry: Sphere | Disk, transform: Transform) -> Sphere | Disk | None:
    if isinstance(geometry, Sphere):
        return moved_sphere(geometry, transform)
    return moved_disk(geometry, transform)

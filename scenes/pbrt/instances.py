"""`ObjectInstance`s expanded: every instance in world space, with those of one material as one mesh.

Instances share nothing, so that their number is bounded. A thousand trees are two shapes, not a thousand.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenes.description.shapes import Array, Faces, Mesh, TriangleMesh, vertex_normals
from scenes.errors import SceneError
from scenes.pbrt.directives.shapes import place, range_problem
from scenes.pbrt.state import InstanceUse, PlacedShape
from scenes.pbrt.transforms import FLAT

FACES = 50_000_000  # of all instances together: some 4 GB
SINGLES = 1_000_000  # spheres and disks, each a shape of its own


@dataclass(eq=False)
class _Pool:
    """Meshes that become one, in the place of the `first` instance."""

    first: PlacedShape
    vertices: list[Array] = field(default_factory=list[Array])
    faces: list[Faces] = field(default_factory=list[Faces])
    uv: list[Array] = field(default_factory=list[Array])
    normals: list[Array] = field(default_factory=list[Array])
    count: int = 0

    def add(self, mesh: Mesh) -> None:
        self.vertices.append(mesh.vertices)
        self.faces.append(mesh.faces + self.count)
        if mesh.uv is not None:
            self.uv.append(mesh.uv)
        if (normals := vertex_normals(mesh)) is not None:
            self.normals.append(normals)
        self.count += len(mesh.vertices)

    def shape(self) -> PlacedShape:
        uv = np.concatenate(self.uv) if self.uv else None
        vertices, faces = np.concatenate(self.vertices), np.concatenate(self.faces)
        mesh = replace(self.first.geometry, vertices=vertices, faces=faces, uv=uv)
        if self.normals and isinstance(mesh, TriangleMesh):
            mesh = replace(mesh, normals=np.concatenate(self.normals))
        return replace(self.first, geometry=mesh)


def expand_instances(
    uses: Sequence[InstanceUse], objects: Mapping[str, Sequence[PlacedShape]]
) -> Iterable[PlacedShape]:
    """All instances as shapes of the world; SceneError for an unknown object, for too much, and for what
    leaves the range of coordinates.
    """
    _check_size(uses, objects)
    pools: dict[tuple[object, ...], _Pool] = {}
    single: list[PlacedShape] = []
    for use in uses:
        for shape in objects[use.name]:
            if use.transform.flattens and not isinstance(shape.geometry, Mesh):
                raise SceneError(FLAT, use.where)
            moved = place(shape.geometry, use.transform)
            placed = PlacedShape(moved, shape.material, None, use.where, shape.alpha)
            if isinstance(moved, Mesh):
                key = (
                    type(moved),
                    id(shape.material),
                    shape.alpha,
                    moved.reverse,
                    moved.uv is None,
                    vertex_normals(moved) is None,
                )
                pools.setdefault(key, _Pool(placed)).add(moved)
            else:
                single.append(placed)
    shapes = [*(pool.shape() for pool in pools.values()), *single]
    for shape in shapes:
        problem = range_problem(shape.geometry)
        if problem is not None:
            raise SceneError(problem, shape.where)
    return shapes


def _check_size(uses: Sequence[InstanceUse], objects: Mapping[str, Sequence[PlacedShape]]) -> None:
    geometries = {name: [shape.geometry for shape in shapes] for name, shapes in objects.items()}
    sizes = {name: [len(g.faces) for g in own if isinstance(g, Mesh)] for name, own in geometries.items()}
    faces = singles = 0
    for use in uses:
        if use.name not in sizes:
            raise SceneError(
                f"no object is called {use.name!r}; there are: {', '.join(objects) or 'none'}", use.where
            )
        faces += sum(sizes[use.name])
        singles += len(geometries[use.name]) - len(sizes[use.name])
        if faces > FACES or singles > SINGLES:
            raise SceneError(
                f"the instances have more than {FACES:,} faces or {SINGLES:,} spheres and disks in all: "
                "that is too much to write out",
                use.where,
            )

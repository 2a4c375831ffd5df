"""Shapes in world space, with material and emission, and the questions that every layer asks of them.

A kind of shape is one frozen class here, with its corners, areas, bounds, triangles and flipped side. The
parts that one layer needs stand in that layer: pbrt text, analytic primitives, Mitsuba's plugins, closed
forms.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.materials import Material, MixedMaterial
from scenes.description.normal_perturbation import NormalPerturbation
from scenes.description.textures import ColorMap, Texture
from scenes.errors import Location

Array = NDArray[np.float64]
Faces = NDArray[np.int64]

# Corners given as decimal text are right-angled to some 1e-16 of their size; a sheared patch is far off that.
RIGHT_ANGLE = 1e-9
# Vertices given as decimal text lie in a common plane to some 1e-16 of their coordinates.
FLAT = 1e-12
# Corners given as decimal text close a parallelogram to some 1e-16 of their size, float32 to 1e-7.
CLOSED = 1e-6
BLOCK = 2**15  # faces whose normals are worked out at a time
AREA_NODES = 64  # of the quadrature, along each parameter
SEGMENTS = 512  # of a disk's rim, where nothing else is asked for
TRIANGLE_UV = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
PATCH_UV = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class Emission:
    """Diffuse area emission. radiance: (3,) float64, W/(m^2 sr), `scale`, `power` and the like already in it.

    image: (h, w, 3) float64, what to multiply the radiance by over a rectangle, first row at v = 1; looked up
    bilinearly and clamped at the edges, as pbrt does.
    """

    radiance: Array
    two_sided: bool = False
    image: Array | None = None

    def map_colors(self, change: ColorMap) -> Emission:
        image = None if self.image is None else change(self.image)
        return replace(self, radiance=change(self.radiance), image=image)


@dataclass(frozen=True, eq=False)
class Bounds:
    """The hull of points (m, 3), each widened by a ball or a disk of `radius`, which holds the shape.

    axis: (3,) the normal of the disks, None for balls. normal: (3,) of a planar shape. one_way: whether all
    faces turn the same way. linear: (3, 3) the map from the unit ball to an ellipsoid that replaces the ball,
    None without.
    """

    points: Array
    radius: float = 0.0
    axis: Array | None = None
    normal: Array | None = None
    one_way: bool = True
    linear: Array | None = None

    def extent(self, directions: Array) -> tuple[Array, Array]:
        """Least and greatest n . x over the shape, (q,) each, for unit n (q, 3), exact but for rounding."""
        along = np.einsum("qc,mc->qm", directions, self.points)
        pad = np.full(len(directions), self.radius)
        if self.axis is not None:
            cosine = np.einsum("qc,c->q", directions, self.axis)
            pad *= np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        if self.linear is not None:
            pad = np.linalg.norm(np.einsum("qc,ck->qk", directions, self.linear), axis=1)
        return along.min(axis=1) - pad, along.max(axis=1) + pad


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles; a face's normal is (p1-p0) x (p2-p0), turned round where `reverse` is set.

    vertices: (m, 3) float64, world space. faces: (t, 3) int64. uv: (m, 2), or None: every face is (0,0),
    (1,0), (1,1), as in pbrt. normals: (m, 3) vertex normals in world space, of any length, on the side that
    the surface calls its outside; None: every face is shaded by its own.
    """

    vertices: Array
    faces: Faces
    reverse: bool = False
    uv: Array | None = None
    normals: Array | None = None

    @property
    def corners(self) -> Array:
        """(m, 3) points whose bounding box holds the shape."""
        return self.vertices

    def areas(self) -> Array:
        """(t,) the area of each face."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    def bounds(self) -> Bounds:
        """Bounds of the vertices in use."""
        return _mesh_bounds(self)

    def triangulated(self, segments: int = SEGMENTS) -> TriangleMesh:
        """The mesh itself."""
        return self

    def identity(self) -> tuple[Array, Array]:
        """Points (f, m, 3) by which faces are compared, and a vector (f, 3) that flips with a face's side."""
        return _mesh_identity(self)

    def flipped(self) -> TriangleMesh:
        """The mesh turned inside out."""
        return replace(
            self, reverse=not self.reverse, normals=None if self.normals is None else -self.normals
        )

    def untextured(self) -> TriangleMesh:
        """The mesh without texture coordinates."""
        return self if self.uv is None else replace(self, uv=None)

    def corner_uv(self) -> Array:
        """(t, 3, 2) texture coordinates at the corners of the faces."""
        return _corner_uv(self, TRIANGLE_UV)

    def triangle_uv(self) -> Array:
        """(t, 3, 2) texture coordinates at the corners of the triangles."""
        return self.corner_uv()


@dataclass(frozen=True, eq=False)
class BilinearMesh:
    """Planar bilinear patches, corners in pbrt's order p00 p10 p01 p11; normal (p10-p00) x (p01-p00), turned
    if `reverse`.

    vertices: (m, 3) float64, world space. faces: (q, 4) int64. uv: (m, 2), or None: a patch's own parameters,
    p10 at (1, 0).
    """

    vertices: Array
    faces: Faces
    reverse: bool = False
    uv: Array | None = None

    @property
    def corners(self) -> Array:
        """(m, 3) points whose bounding box holds the shape."""
        return self.vertices

    def areas(self) -> Array:
        """(q,) the area of each patch."""
        p00, p10, p01, p11 = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.linalg.norm(np.cross(p11 - p00, p01 - p10), axis=1) / 2

    def bounds(self) -> Bounds:
        """Bounds of the vertices in use."""
        return _mesh_bounds(self)

    def triangulated(self, segments: int = SEGMENTS) -> TriangleMesh:
        """Two triangles for each patch, without texture coordinates, in the order of `halves`."""
        return TriangleMesh(self.vertices, halves(self.faces), self.reverse)

    def identity(self) -> tuple[Array, Array]:
        """Points (f, m, 3) by which faces are compared, and a vector (f, 3) that flips with a face's side."""
        return _mesh_identity(self)

    def flipped(self) -> BilinearMesh:
        """The mesh turned inside out."""
        return replace(self, reverse=not self.reverse)

    def untextured(self) -> BilinearMesh:
        """The mesh without texture coordinates."""
        return self if self.uv is None else replace(self, uv=None)

    def corner_uv(self) -> Array:
        """(q, 4, 2) texture coordinates at the corners of the patches."""
        return _corner_uv(self, PATCH_UV)

    def triangle_uv(self) -> Array:
        """(2 q, 3, 2) texture coordinates at the corners of the triangles."""
        uv, (first, second) = self.corner_uv(), halves(np.arange(4)[None])
        return np.concatenate([uv[:, first], uv[:, second]])

    def are_rectangles(self) -> bool:
        """Whether all patches are rectangles with an area, within RIGHT_ANGLE."""
        corners = self.vertices[self.faces]
        p00, p10, p01, p11 = np.moveaxis(corners, 1, 0)
        x, y = p10 - p00, p01 - p00
        size = np.sqrt((x * x).sum(axis=1) * (y * y).sum(axis=1))
        skew = np.abs((x * y).sum(axis=1)) > RIGHT_ANGLE * size
        apart = np.abs(p11 - p10 - y).max(axis=1) > RIGHT_ANGLE * np.abs(corners).max()
        return not bool(((size == 0) | skew | apart).any())

    def are_parallelograms(self) -> bool:
        """Whether every patch and its texture coordinates form a parallelogram, within CLOSED."""
        return all(_gap(values) <= CLOSED for values in (self.vertices[self.faces], self.corner_uv()))


@dataclass(frozen=True, eq=False)
class Sphere:
    """A full sphere, whose normal points outwards, or inwards if `reverse`. center: (3,) float64, world
    space. frame: (3, 3) float64, its columns the object's axes in world space, unit and orthogonal
    (left-handed under a mirror); None if no texture needs them.
    """

    center: Array
    radius: float
    reverse: bool = False
    frame: Array | None = None

    @property
    def corners(self) -> Array:
        """(2, 3) points whose bounding box holds the shape."""
        return _box(self)

    def areas(self) -> Array:
        """(1,) the area."""
        return np.array([4 * np.pi * self.radius**2])

    def bounds(self) -> Bounds:
        """The ball itself."""
        return Bounds(self.center[None], self.radius)

    def triangulated(self, segments: int = SEGMENTS) -> TriangleMesh:
        """An icosahedron subdivided log2(segments / 16) times: 20,480 triangles, 2.85e-4 of the radius below
        the sphere at most, for 512 segments.
        """
        unit, faces = _icosphere(max(0, (segments // 16).bit_length() - 1))
        return TriangleMesh(self.center + self.radius * unit, faces, self.reverse)

    def identity(self) -> tuple[Array, Array]:
        """The point and the vector of its single face; see `TriangleMesh`."""
        points = np.stack([self.center, self.center + self.radius, np.full(3, self.radius)])
        return points[None], np.array([[-1.0 if self.reverse else 1.0, 0.0, 0.0]])

    def flipped(self) -> Sphere:
        """The sphere turned inside out."""
        return replace(self, reverse=not self.reverse)

    def untextured(self) -> Sphere:
        """The sphere without its frame."""
        return self if self.frame is None else replace(self, frame=None)


@dataclass(frozen=True, eq=False)
class Disk:
    """A full disk. center: (3,) float64. normal: (3,) float64, unit, the side it emits on,
    `ReverseOrientation` included. frame: as of `Sphere`.
    """

    center: Array
    normal: Array
    radius: float
    frame: Array | None = None

    @property
    def corners(self) -> Array:
        """(2, 3) points whose bounding box holds the shape."""
        return _box(self)

    def areas(self) -> Array:
        """(1,) the area."""
        return np.array([np.pi * self.radius**2])

    def bounds(self) -> Bounds:
        """The disk itself."""
        return Bounds(self.center[None], self.radius, axis=self.normal, normal=self.normal)

    def triangulated(self, segments: int = SEGMENTS) -> TriangleMesh:
        """A fan of `segments` triangles, with the centre as last vertex."""
        angle = np.linspace(0.0, 2 * np.pi, segments, endpoint=False)[:, None]
        x, y, _ = basis(self.normal).T
        rim = self.center + self.radius * (np.cos(angle) * x + np.sin(angle) * y)
        i = np.arange(segments)
        faces = np.stack([np.full(segments, segments), i, (i + 1) % segments], axis=1)
        return TriangleMesh(np.vstack([rim, self.center]), faces)

    def identity(self) -> tuple[Array, Array]:
        """The point and the vector of its single face; see `TriangleMesh`."""
        up = self.radius * self.normal
        return np.stack([self.center, self.center + up, self.center - up])[None], self.normal[None]

    def flipped(self) -> Disk:
        """The disk turned over."""
        return replace(self, normal=-self.normal)

    def untextured(self) -> Disk:
        """The disk without its frame."""
        return self if self.frame is None else replace(self, frame=None)


@dataclass(frozen=True, eq=False)
class Quadric:
    """Part of a sphere, a disk or a cylinder about z, under an affine map. `Sphere` and `Disk` are the whole
    ones under similarities.

    form: "sphere", "disk" or "cylinder". matrix: (3, 4) float64, object to world. radius, zmin, zmax, inner,
    phimax: pbrt's, in object space, phimax in degrees. A disk lies at zmin = zmax, with `inner` as
    innerradius. The normal points outwards, a disk's along z; `reverse` turns it.
    """

    form: str
    matrix: Array
    radius: float
    zmin: float
    zmax: float
    inner: float = 0.0
    phimax: float = 360.0
    reverse: bool = False

    @property
    def frame(self) -> None:
        """None: the matrix lays texture coordinates."""
        return None

    @property
    def corners(self) -> Array:
        """(2, 3) points whose bounding box holds the shape."""
        return np.stack(self.bounds().extent(np.eye(3)))

    @property
    def area_in_object(self) -> float:
        """The area in object space."""
        phi = np.radians(self.phimax)
        if self.form == "disk":
            return float(phi * max(self.radius**2 - self.inner**2, 0.0) / 2)
        return float(phi * self.radius * (self.zmax - self.zmin))

    def areas(self) -> Array:
        """(1,) the area: the mean of |det M| |M^-T n| over the part, by Gauss-Legendre quadrature.

        Exact to rounding where the matrix stretches up to ten times, and to 1e-6 up to a hundred times.
        """
        linear = self.matrix[:, :3]
        cofactors = np.stack(
            [
                np.cross(linear[:, 1], linear[:, 2]),
                np.cross(linear[:, 2], linear[:, 0]),
                np.cross(linear[:, 0], linear[:, 1]),
            ],
            axis=1,
        )
        x, weight = _nodes()
        angle, around = np.radians(self.phimax) * (x + 1) / 2, weight / 2
        if self.phimax == 360.0:  # of a whole turn every sum over equal steps is as good
            angle, around = (
                2 * np.pi * np.arange(4 * x.size) / (4 * x.size),
                np.full(4 * x.size, 0.25 / x.size),
            )
        if self.form == "sphere":
            cosine = (self.zmin + (self.zmax - self.zmin) * (x + 1) / 2) / self.radius
        else:
            cosine = np.full(1, 1.0 if self.form == "disk" else 0.0)
        share = weight / 2 if self.form == "sphere" else np.ones(1)
        sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
        normal = np.stack(
            [
                sine[:, None] * np.cos(angle),
                sine[:, None] * np.sin(angle),
                np.broadcast_to(cosine[:, None], (cosine.size, angle.size)),
            ]
        )
        stretch = np.linalg.norm(np.einsum("ik,kab->iab", cofactors, normal), axis=0)
        return np.array([self.area_in_object * float(share @ (stretch @ around))])

    def bounds(self) -> Bounds:
        """The bounds of the whole ellipsoid, ellipse or cylinder."""
        linear, origin = self.matrix[:, :3], self.matrix[:, 3]
        if self.form == "sphere":
            return Bounds(origin[None], linear=linear * self.radius)
        across = linear * (np.array([1.0, 1.0, 0.0]) * self.radius)
        ends = origin + np.array([[self.zmin], [self.zmax]]) * linear[:, 2]
        if self.form == "cylinder":
            return Bounds(ends, linear=across)
        normal = np.cross(linear[:, 0], linear[:, 1])
        side = (-1.0 if self.reverse else 1.0) * np.sign(np.linalg.det(linear))
        return Bounds(ends[:1], linear=across, normal=side * normal / np.linalg.norm(normal))

    def triangulated(self, segments: int = SEGMENTS) -> TriangleMesh:
        """A grid of `segments` steps about z and half as many along it, with texture coordinates.

        Chords lie 1.9e-5 of the radius below the surface at most, for 512 segments.
        """
        return self.as_mesh(segments, False)

    def as_mesh(self, segments: int, smooth: bool) -> TriangleMesh:
        """The triangulation. smooth: whether it has the surface's normals."""
        a = np.linspace(0.0, 1.0, max(segments, 8) + 1)
        b = np.linspace(0.0, 1.0, (max(segments, 8) // 2 if self.form == "sphere" else 1) + 1)[:, None]
        x, y = np.cos(np.radians(self.phimax) * a), np.sin(np.radians(self.phimax) * a)
        if self.phimax == 360.0:
            x[-1], y[-1] = x[0], y[0]
        if self.form == "sphere":
            low, high = (np.arccos(np.clip(z / self.radius, -1.0, 1.0)) for z in (self.zmin, self.zmax))
            theta = low + (high - low) * b
            away, up, lean = self.radius * np.sin(theta), self.radius * np.cos(theta), np.cos(theta)
            away = np.where(np.abs(up) >= self.radius, 0.0, away)
        elif self.form == "disk":
            away, up = self.radius + (self.inner - self.radius) * b, np.full_like(b, self.zmin)
            lean = np.ones_like(b)
        else:
            away, up, lean = np.full_like(b, self.radius), self.zmin + (self.zmax - self.zmin) * b, b * 0.0
        local = np.stack(np.broadcast_arrays(away * x, away * y, up), axis=-1).reshape(-1, 3)
        flat = np.sqrt(np.maximum(1.0 - lean * lean, 0.0))
        normal = np.stack(np.broadcast_arrays(flat * x, flat * y, lean), axis=-1).reshape(-1, 3)
        linear = self.matrix[:, :3]
        i = np.arange(b.size - 1)[:, None] * a.size + np.arange(a.size - 1)
        square = np.stack([i, i + 1, i + a.size, i + a.size + 1], axis=-1).reshape(-1, 4)
        side = -1.0 if self.reverse else 1.0
        uv = np.stack(np.broadcast_arrays(a, b), axis=-1).reshape(-1, 2)
        made = TriangleMesh(
            local @ linear.T + self.matrix[:, 3],
            halves(square),
            self.reverse != bool(np.linalg.det(linear) < 0),
            uv,
            side * normal @ np.linalg.inv(linear) if smooth else None,
        )
        return replace(made, faces=made.faces[made.areas() > 0])  # half of those at a pole have none

    def identity(self) -> tuple[Array, Array]:
        """The point and the vector of its single face; see `TriangleMesh`."""
        lengths = np.array([self.radius, self.zmin, self.zmax, self.inner, self.phimax, 0.0])
        points = np.concatenate([self.matrix.T, lengths.reshape(2, 3), self.corners])
        return points[None], np.array([[-1.0 if self.reverse else 1.0, 0.0, 0.0]])

    def flipped(self) -> Quadric:
        """The surface turned inside out."""
        return replace(self, reverse=not self.reverse)

    def untextured(self) -> Quadric:
        """The shape itself: its matrix is its geometry."""
        return self


Mesh = TriangleMesh | BilinearMesh
Geometry = Mesh | Sphere | Disk | Quadric


@dataclass(frozen=True, eq=False)
class ShapeDescription:
    """One `Shape` of the scene file. `where` is for messages and no part of the content.

    alpha: how likely a ray is to meet the shape where it lies, equal in all three components; None: it always
    does. perturbation: the map that turns its shading normals.
    """

    geometry: Geometry
    material: Material
    emission: Emission | None = None
    where: Location | None = field(default=None, metadata={"content": False})
    alpha: Texture | None = None
    perturbation: NormalPerturbation | None = None

    @property
    def needs_uv(self) -> bool:
        """Whether the shape depends on texture coordinates."""
        textured = self.alpha is not None and not isinstance(self.alpha, np.ndarray)
        return (
            textured
            or self.perturbs_normals
            or self.material.needs_uv
            or (self.emission is not None and self.emission.image is not None)
        )

    @property
    def perturbs_normals(self) -> bool:
        """Whether a normal map or displacement turns shading normals, of the whole shape or of a part of its
        mix.
        """
        mixed = isinstance(self.material, MixedMaterial) and self.material.perturbs_normals
        return self.perturbation is not None or mixed

    def scaled(self, factor: float) -> ShapeDescription:
        """The shape with its emission multiplied."""
        if self.emission is None:
            return self
        return replace(self, emission=replace(self.emission, radiance=self.emission.radiance * factor))

    def map_colors(self, change: ColorMap) -> ShapeDescription:
        """The shape with `change` applied to the colours (..., 3) of its material and emission."""
        emission = None if self.emission is None else self.emission.map_colors(change)
        return replace(self, material=self.material.map_colors(change), emission=emission)


def vertex_normals(geometry: Geometry) -> Array | None:
    """(m, 3) of a mesh that is shaded smoothly, else None."""
    return geometry.normals if isinstance(geometry, TriangleMesh) else None


def pbrt_samples(geometry: Geometry) -> bool:
    """Whether pbrt-v4 samples a light of this geometry without bias. It samples parts of spheres and disks as
    if they were whole, and takes areas before the transformation.
    """
    if not isinstance(geometry, Quadric):
        return True
    linear = geometry.matrix[:, :3]
    return geometry.form == "cylinder" and float(np.abs(linear.T @ linear - np.eye(3)).max()) <= RIGHT_ANGLE


@functools.cache
def _nodes() -> tuple[Array, Array]:
    """Nodes in [-1, 1] and weights of the Gauss-Legendre quadrature."""
    x, weight = np.polynomial.legendre.leggauss(AREA_NODES)
    return np.asarray(x, dtype=np.float64), np.asarray(weight, dtype=np.float64)


def halves(patches: Faces) -> Faces:
    """Patches (q, 4), corners p00 p10 p01 p11, as triangles (2 q, 3): first the half at p10 of each, then the
    half at p01.
    """
    return np.concatenate([patches[:, [0, 1, 3]], patches[:, [0, 3, 2]]])


def basis(normal: Array) -> Array:
    """A right-handed orthonormal basis (3, 3), columns x y z, whose z is `normal` (3,)."""
    x = np.asarray(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]), dtype=np.float64)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal], axis=1)


_ENDS = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])


def _box(shape: Sphere | Disk) -> Array:
    return shape.center + shape.radius * _ENDS


def _corner_uv(mesh: Mesh, default: Array) -> Array:
    return np.broadcast_to(default, (*mesh.faces.shape, 2)) if mesh.uv is None else mesh.uv[mesh.faces]


def _gap(corners: Array) -> float:
    """The largest |p11 - p01 - p10 + p00| of corners (q, 4, c), relative to the largest coordinate."""
    off = np.abs(corners[:, 3] - corners[:, 1] - corners[:, 2] + corners[:, 0]).max()
    return float(off / max(np.abs(corners).max(), 1e-300))


def boxes(geometries: Sequence[Geometry]) -> tuple[Array, Array]:
    """Least and greatest coordinates (s, 3) of s shapes, from their bounds along the axes."""
    hulls = [Bounds(_used(g)) if isinstance(g, Mesh) else g.bounds() for g in geometries]
    first = np.cumsum([0, *(len(hull.points) for hull in hulls)])[:-1]
    if not hulls:
        return np.zeros((0, 3)), np.zeros((0, 3))
    points = np.concatenate([hull.points for hull in hulls]) if len(hulls) > 1 else hulls[0].points
    axis = np.array([np.zeros(3) if hull.axis is None else hull.axis for hull in hulls])
    pad = np.sqrt(np.maximum(1.0 - axis * axis, 0.0)) * np.array([[hull.radius] for hull in hulls])
    low, high = (reduce.reduceat(points, first, axis=0) for reduce in (np.minimum, np.maximum))
    return low - pad, high + pad


def _used(mesh: Mesh) -> Array:
    """The vertices (m, 3) in use by faces."""
    met = np.zeros(len(mesh.vertices), dtype=np.bool_)
    met[mesh.faces.ravel()] = True
    return mesh.vertices if met.all() else mesh.vertices[met]


def _mesh_identity(mesh: Mesh) -> tuple[Array, Array]:
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners, normals * (-1.0 if mesh.reverse else 1.0)


def _mesh_bounds(mesh: Mesh) -> Bounds:
    used = _used(mesh)
    normal = _plane(mesh, used)
    if normal is None:
        return Bounds(used)
    along = [np.einsum("tc,c->t", cross, normal) for cross in _face_normals(mesh)]
    one_way = all((a >= 0).all() for a in along) or all((a <= 0).all() for a in along)
    return Bounds(used, normal=normal * (-1.0 if mesh.reverse else 1.0), one_way=bool(one_way))


def _face_normals(mesh: Mesh) -> Iterator[Array]:
    """The face normals in blocks (b, 3), of twice the faces' areas in length. A block stays in the cache."""
    for start in range(0, len(mesh.faces), BLOCK):
        a, b, c = (mesh.vertices[mesh.faces[start : start + BLOCK, i]] for i in range(3))
        yield cross_product(b - a, c - a)


def cross_product(a: Array, b: Array) -> Array:
    """The products a x b of rows (m, 3), equal in all bits to those of `np.cross`, which is slower for few
    rows.
    """
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _plane(mesh: Mesh, points: Array) -> Array | None:
    """The unit normal of a mesh's points (m, 3) if they share a plane, on the side of its largest face."""
    normal, longest = np.zeros(3), 0.0
    for cross in _face_normals(mesh):
        length = np.linalg.norm(cross, axis=1)
        largest = int(length.argmax())
        if length[largest] > longest:
            normal, longest = cross[largest], length[largest]
    if longest == 0:
        return None
    n = normal / longest
    height = np.einsum("mc,c->m", points - points[0], n)
    return n if np.abs(height).max() <= FLAT * np.abs(points).max() else None


@functools.cache
def _icosphere(subdivisions: int) -> tuple[Array, Faces]:
    """Vertices (m, 3) and faces (t, 3) of the unit sphere."""
    # Imported here: it takes a second, and few scenes need it.
    from trimesh.creation import icosphere  # pyright: ignore[reportUnknownVariableType]

    made = icosphere(subdivisions=subdivisions)
    return np.asarray(made.vertices, dtype=np.float64), np.asarray(made.faces, dtype=np.int64)

"""SceneDescription -> what Mitsuba is given: plain dataclasses and NumPy arrays, so that neither side needs the other's imports.

Three things change on the way, and none of them changes the image:
- The world is moved towards the lights and scaled by a power of two. Mitsuba computes in float32 and lifts rays off a
  surface by 9e-5 * (1 + max|p|), p in its own units: far from the origin, or in a small scene, that swallows
  geometry (0.9 % of the light at an offset of 1e5). Radiance does not depend on the scale.
- The camera is mirrored: pbrt's camera space is left-handed (x to the right), Mitsuba's is right-handed (x to the left).
- Emitting rectangles, disks and spheres stay analytic shapes; every other quadrilateral becomes two flat triangles.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.references.mitsuba_worker import Faces, MitsubaScene, MitsubaShape
from scenes.description import (
    Array,
    BilinearMesh,
    Disk,
    Geometry,
    PerspectiveCamera,
    SceneDescription,
    ShapeDescription,
    Sphere,
    TriangleMesh,
)
from scenes.errors import SceneError

# In Mitsuba's units. Half size of the smallest light or of the rest, whichever is less: the 1 in 9e-5 * (1 + |p|) is then small beside it.
FEATURE = 64.0
# But no coordinate beyond this: fourth powers of distances must stay far inside float32's range.
FARTHEST = 2.0**23
MOST_RECTANGLES = 16  # an emitting mesh of more quadrilaterals becomes one emitter: Mitsuba has one object an emitter


@dataclass(frozen=True, eq=False)
class Frame:
    """Normalised coordinates: scale * (p - center). center: (3,) world; scale: a power of two, so that it rounds nothing."""

    center: Array
    scale: float

    def points(self, p: Array) -> Array:
        """World points (..., 3) in normalised coordinates."""
        return (p - self.center) * self.scale


def normalising_frame(scene: SceneDescription) -> Frame:
    """The frame centred on the point nearest to the lights within the bounding box of everything else.

    That box is where rays start off surfaces. Its middle would serve as well by a factor of two; near the lights the image has
    its finest features, and a light far off shall not draw the centre out of the scene.
    """
    lights = [corners(shape.geometry) for shape in scene.shapes if shape.emission]
    others = [corners(shape.geometry) for shape in scene.shapes if not shape.emission]
    low, high = _box(others or lights)
    center = np.clip(np.mean(_box(lights or others), axis=0), low, high)
    everything = [*lights, *others, scene.camera.camera_to_world[None, :3, 3]]
    extent = max(float(np.abs(points - center).max()) for points in everything)
    sizes = [float(np.ptp(points, axis=0).max()) / 2 for points in (*lights, np.stack([low, high]))]
    wanted = [FEATURE / size for size in sizes if size > 0]
    scale = min([max(wanted, default=1.0), FARTHEST / extent if extent > 0 else 1.0])
    return Frame(center, float(2.0 ** np.floor(np.log2(scale))))


def _box(parts: list[Array]) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of all points of all parts."""
    return np.min([part.min(axis=0) for part in parts], axis=0), np.max([part.max(axis=0) for part in parts], axis=0)


def convert(scene: SceneDescription) -> MitsubaScene:
    """The scene for Mitsuba; SceneError where its camera or a quadrilateral has no counterpart there."""
    frame = normalising_frame(scene)
    points = np.concatenate([frame.points(corners(shape.geometry)) for shape in scene.shapes])
    camera = _camera(scene.camera, frame)
    farthest = float(np.linalg.norm(points - camera[:3, 3], axis=1).max())
    return MitsubaScene(
        camera_to_world=camera,
        fov=scene.camera.fov,
        clip=(1e-9 * farthest, 4.0 * farthest),  # pbrt cuts nothing off; measured, the ratio costs no precision
        width=scene.film.width,
        height=scene.film.height,
        shapes=tuple(converted for shape in scene.shapes for converted in _shapes(shape, frame)),
    )


def corners(geometry: Geometry) -> Array:
    """Points (m, 3), world space, whose bounding box holds the shape."""
    if isinstance(geometry, TriangleMesh | BilinearMesh):
        return geometry.vertices
    reach = geometry.radius * np.array([[-1.0], [1.0]])
    return geometry.center + reach * np.ones(3)


def triangles(mesh: TriangleMesh | BilinearMesh) -> Faces:
    """Faces (t, 3) whose normals (p1-p0) x (p2-p0) are the description's, `reverse` included."""
    faces = mesh.faces
    if isinstance(mesh, BilinearMesh):
        faces = np.concatenate([faces[:, (0, 1, 3)], faces[:, (0, 3, 2)]])
    return faces[:, ::-1] if mesh.reverse else faces


def _camera(camera: PerspectiveCamera, frame: Frame) -> Array:
    """pbrt's camera, mirrored in x and without its scale, which only stretches its rays."""
    axes = camera.camera_to_world[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    gram = (axes / lengths).T @ (axes / lengths)
    if np.ptp(lengths) > 1e-6 * lengths.max() or np.abs(gram - np.eye(3)).max() > 1e-6:
        raise SceneError("the camera's transformation has shear or unequal scale, which Mitsuba's camera cannot have")
    result = np.eye(4)
    result[:3, :3] = axes / lengths * (-1.0, 1.0, 1.0)
    result[:3, 3] = frame.points(camera.camera_to_world[:3, 3])
    return result


def _shapes(shape: ShapeDescription, frame: Frame) -> Iterator[MitsubaShape]:
    reflectance, geometry = shape.material.reflectance, shape.geometry
    radiance = shape.emission.radiance if shape.emission else None
    if isinstance(geometry, Sphere):
        to_world = _affine(np.eye(3) * geometry.radius * frame.scale, frame.points(geometry.center))
        yield MitsubaShape("sphere", reflectance, radiance, to_world, flip=geometry.reverse)
    elif isinstance(geometry, Disk):
        axes = basis(geometry.normal) * geometry.radius * frame.scale
        yield MitsubaShape("disk", reflectance, radiance, _affine(axes, frame.points(geometry.center)))
    elif radiance is not None and isinstance(geometry, BilinearMesh) and _are_few_rectangles(geometry):
        for face in geometry.faces:
            to_world = _rectangle(frame.points(geometry.vertices[face]), geometry.reverse)
            yield MitsubaShape("rectangle", reflectance, radiance, to_world)
    else:
        _check_convex(shape)
        vertices = frame.points(geometry.vertices)
        yield MitsubaShape("mesh", reflectance, radiance, vertices=vertices, faces=triangles(geometry))


def _are_few_rectangles(mesh: BilinearMesh) -> bool:
    """Right angles and a fourth corner in place to 1e-6, which is beyond what Mitsuba's float32 resolves."""
    p00, p10, p01, p11 = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    u, v, gap = p10 - p00, p01 - p00, p11 - p10 - p01 + p00
    sizes = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    right = np.abs(np.sum(u * v, axis=1)) <= 1e-6 * sizes
    closed = np.sum(gap * gap, axis=1) <= 1e-12 * sizes
    return len(mesh.faces) <= MOST_RECTANGLES and bool(np.all(right & closed & (sizes > 0)))


def _check_convex(shape: ShapeDescription) -> None:
    """Two triangles cover a planar patch only where it is convex, whichever diagonal is taken."""
    if isinstance(shape.geometry, BilinearMesh):
        p00, p10, p01, p11 = np.moveaxis(shape.geometry.vertices[shape.geometry.faces], 1, 0)
        rings = np.stack([p00, p10, p11, p01])
        edges = np.roll(rings, -1, axis=0) - rings
        turns = np.cross(edges, np.roll(edges, -1, axis=0))
        if np.any(np.einsum("kqi,qi->kq", turns, turns.sum(axis=0)) < 0):
            raise SceneError("a bilinear patch that is not convex cannot be given to Mitsuba", shape.where)


def _rectangle(face: Array, reverse: bool) -> Array:
    """The transformation of [-1, 1]^2, normal +z, to the corners (4, 3) p00 p10 p01 p11."""
    u, v = (face[1] - face[0]) / 2, (face[2] - face[0]) / 2
    if reverse:
        u, v = v, u
    normal = np.cross(u, v)
    return _affine(np.stack([u, v, normal / np.sqrt(np.linalg.norm(normal))], axis=1), face.mean(axis=0))


def basis(normal: Array) -> Array:
    """A right-handed orthonormal basis (3, 3), columns x y z, whose z is `normal`."""
    x = np.asarray(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]), dtype=np.float64)
    x /= np.linalg.norm(x)
    y = np.cross(normal, x)
    return np.stack([x, y, normal], axis=1)


def _affine(axes: Array, origin: Array) -> Array:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = axes, origin
    return result

"""Which scenes have a closed form, and what of them it needs: one light over coplanar diffuse receivers.

Accepted: exactly one light, a planar convex patch, a disk or a sphere; every other shape lies in one plane,
made of convex pieces that do not overlap; light and camera are on the same side of that plane. Then nothing
can lie between light and receiver, nor between light and camera, and the radiance of every visible point is a
formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.radiometry import clip_polygon_by_plane
from scenes.description.lights import Light, PointLight
from scenes.description.materials import Diffuse
from scenes.description.scene import PerspectiveCamera, SceneDescription
from scenes.description.shapes import BilinearMesh, Disk, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import SceneError

Array = NDArray[np.float64]

# out-of-plane error allowed, relative to a shape's extent: far above rounding, far below any picture
FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Patch:
    """A planar convex polygon. outline: (m, 3), counter-clockwise about the unit normal (3,)."""

    outline: Array
    normal: Array


Emitter = Patch | Disk | Sphere | PointLight


@dataclass(frozen=True, eq=False)
class Receiver:
    """A diffuse patch in the receivers' plane. reflectance: (3,)."""

    patch: Patch
    reflectance: Array


@dataclass(frozen=True, eq=False)
class Plane:
    """The receivers' plane: a point of it and its unit normal, (3,) each, on the camera's side."""

    point: Array
    normal: Array

    def height(self, points: Array) -> Array:
        """Signed distances (...) of points (..., 3)."""
        return np.asarray((points - self.point) @ self.normal)


@dataclass(frozen=True, eq=False)
class ClosedFormScene:
    """A scene with a closed form. radiance: (3,), a point light's intensity; eye: (3,), the camera's place;
    plane is None where there are no receivers.
    """

    light: Emitter
    radiance: Array
    two_sided: bool
    receivers: tuple[Receiver, ...]
    plane: Plane | None
    eye: Array


def analyse(scene: SceneDescription) -> ClosedFormScene:
    """The parts of a scene that has a closed form; SceneError saying in one sentence why a scene has none."""
    lights = [shape for shape in scene.shapes if shape.emission]
    count = len(lights) + len(scene.lights)
    if count != 1:
        raise SceneError(f"the closed form needs exactly one light, and this scene has {count}")
    if not lights or lights[0].emission is None:
        return _under_point(scene, scene.lights[0])
    emission, light = lights[0].emission, _light(lights[0])
    if emission.image is not None:
        raise SceneError("the closed form needs a light of the same radiance all over", lights[0].where)
    receivers, plane, eye = ground(scene)
    if plane is not None:
        _require_same_side(light, plane, eye)
    _require_visible_outline(light, scene.camera, lights[0])
    return ClosedFormScene(light, emission.radiance, emission.two_sided, receivers, plane, eye)


def _under_point(scene: SceneDescription, light: Light) -> ClosedFormScene:
    if not isinstance(light, PointLight):
        raise SceneError(
            "the closed form has no spot lights, nor a sky or sun beside another light", light.where
        )
    receivers, plane, eye = ground(scene)
    if plane is not None and plane.height(light.position) <= FLAT * float(np.abs(eye - plane.point).max()):
        raise SceneError(
            "the closed form needs light and camera on the same side of the receivers' plane", light.where
        )
    return ClosedFormScene(light, light.intensity, False, receivers, plane, eye)


def ground(scene: SceneDescription) -> tuple[tuple[Receiver, ...], Plane | None, Array]:
    """What does not emit, the plane that it lies in, and the eye (3,); SceneError where it is not plain
    enough.
    """
    pixel = scene.film.pixel_filter
    if (pixel.kind, pixel.xradius, pixel.yradius) != ("box", 0.5, 0.5):
        raise SceneError("the closed form needs the box filter of one pixel")
    receivers = tuple(_receiver(shape) for shape in scene.shapes if not shape.emission)
    eye = np.array(scene.camera.camera_to_world[:3, 3])
    plane = _common_plane(receivers, eye)
    _require_apart(receivers)
    return receivers, plane, eye


def light_points(light: Emitter, direction: Array) -> Array:
    """The point (3,) of the light that lies farthest along the unit vector `direction`."""
    if isinstance(light, PointLight):
        return light.position
    if isinstance(light, Patch):
        return light.outline[np.argmax(light.outline @ direction)]
    if isinstance(light, Sphere):
        return light.center + light.radius * direction
    side = direction - (direction @ light.normal) * light.normal
    length = float(np.linalg.norm(side))
    return light.center + (light.radius / length * side if length > 1e-12 else np.zeros(3))


def _light(shape: ShapeDescription) -> Patch | Disk | Sphere:
    geometry, emission = shape.geometry, shape.emission
    if isinstance(geometry, Sphere):
        if geometry.reverse or (emission and emission.two_sided):
            raise SceneError("the closed form needs a sphere light to emit outwards only", shape.where)
        return geometry
    return geometry if isinstance(geometry, Disk) else outline(geometry, shape, oriented=True)


def _receiver(shape: ShapeDescription) -> Receiver:
    if not isinstance(shape.geometry, TriangleMesh | BilinearMesh):
        kind = type(shape.geometry).__name__.lower()
        raise SceneError(
            f"the closed form needs flat receivers of triangles or patches, and there is a {kind}",
            shape.where,
        )
    if not isinstance(shape.material, Diffuse) or not isinstance(shape.material.reflectance, np.ndarray):
        raise SceneError("the closed form needs receivers of one diffuse reflectance each", shape.where)
    return Receiver(outline(shape.geometry, shape, oriented=False), shape.material.reflectance)


def outline(mesh: TriangleMesh | BilinearMesh, shape: ShapeDescription, *, oriented: bool) -> Patch:
    """The outline of a mesh that tiles a planar convex polygon; SceneError if it does not.

    Proof of tiling: all faces are convex and turn the same way, the edges they share cancel, and what remains
    is one convex loop of winding number 1, so that every point inside is covered exactly once.
    oriented: faces must already turn the same way (a light's do matter); else those that do not are turned
    round.
    """
    faces = _corners(mesh)
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[faces]
    p = vertices[faces]
    areas = np.cross(p[:, 1:-1] - p[:, :1], p[:, 2:] - p[:, :1]).sum(axis=1)
    size = float(np.ptp(p.reshape(-1, 3), axis=0).max())
    normal = areas[np.argmax((areas**2).sum(axis=1))]
    if not float(np.linalg.norm(normal)) > (FLAT * size) ** 2:
        raise SceneError("the closed form needs faces with an area", shape.where)
    normal = normal / np.linalg.norm(normal)
    if not oriented:
        normal = normal * np.copysign(1.0, normal[np.argmax(np.abs(normal))])
        faces = np.where((areas @ normal < 0)[:, None], faces[:, ::-1], faces)
    _require_flat(vertices[faces], normal, size, shape)
    return Patch(_convex_loop(vertices, _boundary(faces, shape), normal, shape), normal)


def _corners(mesh: TriangleMesh | BilinearMesh) -> NDArray[np.int64]:
    """Faces as loops, turned round where `reverse` is set; a bilinear patch is stored p00 p10 p01 p11."""
    loops = mesh.faces if isinstance(mesh, TriangleMesh) else mesh.faces[:, [0, 1, 3, 2]]
    return loops[:, ::-1] if mesh.reverse else loops


def _require_flat(p: Array, normal: Array, size: float, shape: ShapeDescription) -> None:
    """p: (f, c, 3), faces. All in one plane, all convex, all turning about `normal`."""
    if float(np.ptp(p @ normal)) > FLAT * size:
        raise SceneError("the closed form needs every shape to be flat, and this one is not", shape.where)
    edges = np.roll(p, -1, axis=1) - p
    turns = np.cross(edges, np.roll(edges, -1, axis=1)) @ normal
    if np.any(turns <= 0):
        raise SceneError("the closed form needs convex faces that all turn the same way", shape.where)


def _boundary(faces: NDArray[np.int64], shape: ShapeDescription) -> list[int]:
    """Vertex indices of the one loop of edges that no two faces share."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    count = int(faces.max()) + 1
    code, reverse = start * count + end, end * count + start
    outer = ~np.isin(code, reverse)
    following = dict(zip(start[outer].tolist(), end[outer].tolist(), strict=True))
    loop = [next(iter(following))] if following else []
    while loop and following[loop[-1]] != loop[0] and len(loop) <= len(following):
        loop.append(following[loop[-1]])
    if np.unique(code).size != code.size or len(loop) != int(outer.sum()):
        raise SceneError(
            "the closed form needs faces that form one patch without holes or overlaps", shape.where
        )
    return loop


def _convex_loop(vertices: Array, loop: list[int], normal: Array, shape: ShapeDescription) -> Array:
    """The loop's corners (m, 3), without those on a straight line; it must turn left everywhere, and once
    round in all.
    """
    p = vertices[loop]
    edges = np.roll(p, -1, axis=0) - p
    following = np.roll(edges, -1, axis=0)
    turn = np.arctan2(np.cross(edges, following) @ normal, (edges * following).sum(axis=1))
    if np.any(turn < -FLAT) or abs(turn.sum() - 2 * np.pi) > 1e-6:
        raise SceneError("the closed form needs a convex outline", shape.where)
    return np.roll(p, -1, axis=0)[turn > FLAT]


def _common_plane(receivers: tuple[Receiver, ...], eye: Array) -> Plane | None:
    if not receivers:
        return None
    first = receivers[0].patch
    corners = np.concatenate([receiver.patch.outline for receiver in receivers])
    extent = float(np.ptp(corners, axis=0).max())
    if np.abs((corners - first.outline[0]) @ first.normal).max() > FLAT * extent:
        raise SceneError("the closed form needs all receivers in one plane: others could cast shadows")
    up = first.normal if (eye - first.outline[0]) @ first.normal >= 0 else -first.normal
    return Plane(first.outline[0], up)


def _require_apart(receivers: tuple[Receiver, ...]) -> None:
    """No two receivers may overlap: which of them is seen would be left to rounding."""
    patches = [receiver.patch for receiver in receivers]
    for i, a in enumerate(patches):
        for b in patches[:i]:
            common = a.outline[None]
            for corner, edge in zip(b.outline, np.roll(b.outline, -1, axis=0) - b.outline, strict=True):
                inward = np.cross(b.normal, edge)
                common = clip_polygon_by_plane(common, inward, inward @ corner)[0]
            if _area(common[0]) > FLAT * min(_area(a.outline), _area(b.outline)):
                raise SceneError("the closed form needs receivers that do not overlap")


def _area(p: Array) -> float:
    return float(np.linalg.norm(np.cross(p[1:-1] - p[0], p[2:] - p[0]).sum(axis=0))) / 2


def _require_same_side(light: Patch | Disk | Sphere, plane: Plane, eye: Array) -> None:
    lowest, highest = (plane.height(light_points(light, sign * plane.normal)) for sign in (-1.0, 1.0))
    if lowest < -FLAT * max(highest - lowest, float(np.abs(eye - plane.point).max())):
        raise SceneError("the closed form needs light and camera on the same side of the receivers' plane")


def _require_visible_outline(
    light: Patch | Disk | Sphere, camera: PerspectiveCamera, shape: ShapeDescription
) -> None:
    """A disk or sphere must not straddle the plane through the camera across its view: its outline would be a
    hyperbola.
    """
    if isinstance(light, Patch):
        return
    eye, forward = camera.camera_to_world[:3, 3], np.linalg.inv(camera.camera_to_world[:3, :3])[2]
    forward = forward / np.linalg.norm(forward)
    nearest, farthest = (forward @ (light_points(light, sign * forward) - eye) for sign in (-1.0, 1.0))
    if nearest <= 0 <= farthest:
        raise SceneError(
            "the closed form needs a disk or sphere light wholly before or wholly behind the camera",
            shape.where,
        )

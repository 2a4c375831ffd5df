"""A SceneDescription as the plain dataclasses and arrays that Mitsuba's worker builds its scene from.

Three things change on the way, and none of them changes the image:
- The world is moved towards the lights and scaled by a power of two. Mitsuba computes in float32 and lifts
  rays off a surface by 9e-5 * (1 + max|p|), p in its own units: far from the origin, or in a small scene,
  that swallows geometry (0.9 % of the light at an offset of 1e5). Radiance does not depend on the scale.
- The camera is mirrored: pbrt's camera space is left-handed (x to the right), Mitsuba's right-handed (x to
  the left).
- Shapes, textures, lights and pixel filters take the forms that Mitsuba has (shapes.py, surfaces.py,
  lights.py, film.py).
"""

from __future__ import annotations

from functools import singledispatch

import numpy as np

from pipeline.references.mitsuba.film import offsets
from pipeline.references.mitsuba.lights import lights
from pipeline.references.mitsuba.shapes import Frame, shapes
from pipeline.references.mitsuba.worker import MitsubaScene, Plugin
from scenes.description.scene import Camera, Film, OrthographicCamera, PerspectiveCamera, SceneDescription
from scenes.description.shapes import Array
from scenes.errors import SceneError

# In Mitsuba's units. Half size of the smallest light or of the rest, whichever is less: the 1 in 9e-5 * (1 +
# |p|) is then small beside it.
FEATURE = 64.0
# But no coordinate beyond this: fourth powers of distances must stay far inside float32's range.
FARTHEST = 2.0**23
BOX = (np.array([-0.5, 0.5]), np.array([-0.5, 0.5]))  # the box of one pixel, as `film.offsets` has filters


def normalising_frame(scene: SceneDescription) -> Frame:
    """The frame centred on the point nearest to the lights within the bounding box of everything else.

    That box is where rays start off surfaces. Its middle would serve as well by a factor of two; near the
    lights the image has its finest features, and a light far off shall not draw the centre out of the scene.
    Lights at infinity leave the middle.
    """
    emitting = [shape.geometry.corners for shape in scene.shapes if shape.emission]
    points = [light.place[None] for light in scene.lights if light.place is not None]
    camera = scene.camera.camera_to_world[None, :3, 3]
    others = [shape.geometry.corners for shape in scene.shapes if not shape.emission]
    near = emitting + points or others or [camera]
    low, high = _box(others or near)
    center = np.clip(np.mean(_box(near), axis=0), low, high)
    extent = max(float(np.abs(part - center).max()) for part in (*near, *others, camera))
    sizes = [float(np.ptp(part, axis=0).max()) / 2 for part in (*emitting, np.stack([low, high]))]
    wanted = [FEATURE / size for size in sizes if size > 0]
    scale = min([max(wanted, default=1.0), FARTHEST / extent if extent > 0 else 1.0])
    return Frame(center, float(2.0 ** np.floor(np.log2(scale))))


def _box(parts: list[Array]) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of all points of all parts."""
    return np.min([part.min(axis=0) for part in parts], axis=0), np.max(
        [part.max(axis=0) for part in parts], axis=0
    )


def convert(scene: SceneDescription) -> MitsubaScene:
    """The scene for Mitsuba; SceneError if Mitsuba lacks its camera or one of its shapes, materials or
    lights.
    """
    frame = normalising_frame(scene)
    sensor, camera, film = _sensor(scene.camera, scene.film, frame)
    distances = [
        float(np.linalg.norm(frame.points(shape.geometry.corners) - camera[:3, 3], axis=1).max())
        for shape in scene.shapes
    ]
    farthest = max(distances, default=0.0) or 1.0
    emitters, notes = lights(scene.lights, frame)
    return MitsubaScene(
        camera_to_world=camera,
        sensor=sensor,
        # pbrt cuts nothing off; measured, the ratio costs no precision.
        clip=(1e-9 * farthest, 4.0 * farthest),
        width=scene.film.width,
        height=scene.film.height,
        objects=(*(one for shape in scene.shapes for one in shapes(shape, frame)), *emitters),
        pixel=min(scene.camera.film_plane(scene.film)[2:]),
        filter=offsets(scene.film) or (None if film is None else BOX),
        film=film,
        notes=notes,
    )


@singledispatch
def _sensor(camera: Camera, film: Film, frame: Frame) -> tuple[Plugin, Array, Array | None]:
    """Mitsuba's camera: its plug-in, its camera-to-world matrix, and the map of pbrt's film to Mitsuba's.

    The matrix is mirrored in x. The map is None if both films are the same.
    """
    raise SceneError(f"Mitsuba has no camera for a {type(camera).__name__}")


@_sensor.register
def _(camera: OrthographicCamera, film: Film, frame: Frame) -> tuple[Plugin, Array, Array | None]:
    """Mitsuba's film reaches from -1 to 1 over its width; the matrix makes it pbrt's window."""
    if camera.lens is not None:
        raise SceneError("Mitsuba has no orthographic camera with a lens")
    left, top, dx, dy = camera.film_plane(film)
    across, down = camera.camera_to_world[:3, :2].T
    half = film.width / 2  # of Mitsuba's units, in pixels
    middle = camera.camera_to_world[:3, :3] @ (left + dx * half, top - dy * film.height / 2, 0.0)
    result = np.eye(4)
    result[:3, 0], result[:3, 1] = -across * dx * half * frame.scale, down * dy * half * frame.scale
    result[:3, 2] = camera.camera_to_world[:3, 2] * frame.scale
    result[:3, 3] = frame.points(camera.camera_to_world[:3, 3] + middle)
    return Plugin("sensor", "orthographic"), result, None


@_sensor.register
def _(camera: PerspectiveCamera, film: Film, frame: Frame) -> tuple[Plugin, Array, Array | None]:
    """Mitsuba's camera is rigid and looks through the middle of its film; a map of the film makes up for it.

    With a lens it keeps pbrt's view, which the plane of focus lies across. A scale of pbrt's camera only
    stretches its rays. SceneError if the film reaches behind Mitsuba's camera.
    """
    axes = camera.camera_to_world[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    gram = (axes / lengths).T @ (axes / lengths)
    rigid = np.ptp(lengths) <= 1e-6 * lengths.max() and np.abs(gram - np.eye(3)).max() <= 1e-6
    result = np.eye(4)
    result[:3, 3] = frame.points(camera.camera_to_world[:3, 3])
    if rigid and camera.window is None:
        result[:3, :3] = axes / lengths * (-1.0, 1.0, 1.0)
        return _perspective(camera, camera.fov, float(lengths[0]) * frame.scale), result, None
    if camera.lens is not None and not rigid:
        raise SceneError("Mitsuba has no lens that a camera's transformation stretches")
    left, top, dx, dy = camera.film_plane(film)
    to_world = axes @ np.array([[dx * film.width, 0.0, left], [0.0, -dy * film.height, top], [0.0, 0.0, 1.0]])
    own = axes / lengths if camera.lens else _basis(to_world @ (0.5, 0.5, 1.0), to_world[:, 0])
    result[:3, :3] = own * (-1.0, 1.0, 1.0)
    seen = own.T @ to_world  # (3, 3): film points to right, up and ahead of Mitsuba's camera
    corners = seen @ np.array([[0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])
    if not np.all(corners[2] > 0):
        raise SceneError("the camera's film reaches behind it, which Mitsuba's camera cannot show")
    side = np.array([film.width, film.height]) / min(film.width, film.height)
    half = float((np.abs(corners[:2] / corners[2]) / side[:, None]).max())
    x, y = seen[0] / (half * side[0]), seen[1] / (half * side[1])
    unit_film = np.stack([(seen[2] + x) / 2, (seen[2] - y) / 2, seen[2]])
    fov = float(np.degrees(2 * np.arctan(half)))
    return _perspective(camera, fov, float(lengths[0]) * frame.scale), result, unit_film


def _perspective(camera: PerspectiveCamera, fov: float, scale: float) -> Plugin:
    """scale: from units of camera space to Mitsuba's. fov: degrees over the shorter side."""
    values: dict[str, float | str] = {"fov": fov, "fov_axis": "smaller"}
    if camera.lens is None:
        return Plugin("sensor", "perspective", values)
    radius, distance = camera.lens.radius * scale, camera.lens.distance * scale
    return Plugin("sensor", "thinlens", values | {"aperture_radius": radius, "focus_distance": distance})


def _basis(forward: Array, across: Array) -> Array:
    """Right, up and forward as orthonormal columns (3, 3); `across` (3,) has no part along up."""
    forward = forward / np.linalg.norm(forward)
    right = across - forward * (across @ forward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward], axis=1)

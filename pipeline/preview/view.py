"""The viewpoint of a preview, chosen so that the camera, the lights and what is in view are all shown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.preview.samples import Tried
from renderer import RenderScene, render
from renderer.camera import Camera
from scenes.arrays import Array
from scenes.description.shapes import ShapeDescription

ANGLE = 34.0  # degrees, of the view's height
TURN, RISE = 55.0, 24.0  # degrees that the view stands aside from the camera's own line, and above the ground
GRID = 24  # rays across the image that find out what is in view
IMAGE = 160  # pixels, the longer side of the image on the camera's screen
FAR = 1.6  # times the middle distance of what is in view: a floor's horizon beyond that is not framed
LABELS = 6  # lights at most that are named
SCREEN = 0.22  # of the extent: how far before the camera its screen stands


@dataclass(frozen=True, eq=False)
class View:
    """A view of a scene and its camera from outside.

    position, target: (3,). angle: of the view's height, degrees. extent: size of the scene in view, world
    units. eye: (3,), of the scene's camera. screen: (h + 1, w + 1, 3), corners of the pixels of its `image`
    (h, w, 3) uint8. seen: (3,), the point that its chosen pixel sees. labels: places and words. veiled:
    numbers of the shapes to draw translucent, since they stand before something of interest.
    """

    position: Array
    target: Array
    angle: float
    extent: float
    eye: Array
    screen: Array
    image: NDArray[np.uint8]
    seen: Array | None
    labels: tuple[tuple[Array, str], ...]
    veiled: frozenset[int]

    def mirrored(self, by: Array) -> View:
        """Every place multiplied by `by` (3,)."""
        return replace(
            self,
            position=self.position * by,
            target=self.target * by,
            eye=self.eye * by,
            screen=self.screen * by,
            seen=None if self.seen is None else self.seen * by,
            labels=tuple((place * by, text) for place, text in self.labels),
        )


def extent_of(scene: RenderScene) -> tuple[Array, Array]:
    """The corners (3,) of the box around the camera, the points in its view and the lights that have a
    place.
    """
    points = [in_view(scene), scene.camera.origin.T]
    points += [light.place[None] for light in scene.description.lights if light.place is not None]
    points += [shape.geometry.corners for shape in scene.description.shapes if shape.emission is not None]
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def in_view(scene: RenderScene) -> Array:
    """Points (m, 3) that rays across the image meet; far ones are moved to FAR times the middle distance."""
    camera = scene.camera
    x, y = (g.ravel() for g in np.meshgrid(*(np.linspace(0, n, GRID) for n in (camera.width, camera.height))))
    o, d, t = first(scene, camera, x, y)
    met = np.flatnonzero(np.isfinite(t))
    if not met.size:
        return camera.origin.T
    distance = np.minimum(t[met], FAR * float(np.median(t[met])))
    return (o[:, met] + d[:, met] * distance).T


def first(scene: RenderScene, camera: Camera, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Origins and unit directions (3, n) of rays through film points in pixels, and their lengths (n,)."""
    o, d = camera.through(x, y)
    o = np.broadcast_to(o, d.shape)
    return o, d, first_hit(scene, o, d)[0]


def look(scene: RenderScene, pixel: tuple[int, int] | None, tried: Tried | None, estimator: str) -> View:
    """Choose the view of a scene. pixel: (x, y) from the top left, or None."""
    low, high = extent_of(scene)
    extent = float(np.linalg.norm(high - low))
    target = (low + high) / 2
    position = _position(scene, target, extent)
    seen = _seen(scene, pixel, tried)
    screen, image = _screen(scene, extent, estimator)
    return View(
        position=position,
        target=target,
        angle=ANGLE,
        extent=extent,
        eye=scene.camera.origin[:, 0],
        screen=screen,
        image=image,
        seen=seen,
        labels=(
            *_labels(scene),
            *(() if seen is None or pixel is None else ((seen, f"pixel {pixel[0]},{pixel[1]}"),)),
        ),
        veiled=_veiled(scene, position, seen, tried, screen),
    )


def _position(scene: RenderScene, target: Array, extent: float) -> Array:
    """A position on the camera's side, turned about the vertical so that its view runs across the picture."""
    camera = scene.camera
    middle = np.array([camera.width / 2]), np.array([camera.height / 2])
    back = -(camera.screen(*middle, 1.0) - camera.screen(*middle, 0.0))[:, 0]
    heading = np.arctan2(back[2], back[0]) + np.radians(TURN)
    rise = np.radians(RISE)
    away = np.array([np.cos(heading) * np.cos(rise), np.sin(rise), np.sin(heading) * np.cos(rise)])
    return target + away * (0.46 * extent / np.tan(np.radians(ANGLE / 2)))


def _seen(scene: RenderScene, pixel: tuple[int, int] | None, tried: Tried | None) -> Array | None:
    """The median of the points that samples start from, or the point seen in the pixel's middle."""
    if tried is not None and len(tried.start):
        return np.median(tried.start, axis=0)
    if pixel is None:
        return None
    o, d, t = first(scene, scene.camera, np.array([pixel[0] + 0.5]), np.array([pixel[1] + 0.5]))
    return (o + d * t).T[0] if np.isfinite(t[0]) else None


def _screen(scene: RenderScene, extent: float, estimator: str) -> tuple[Array, NDArray[np.uint8]]:
    """The corners of the screen's pixels, and the camera's small image on it."""
    camera = scene.camera
    step = max(camera.width, camera.height) / min(IMAGE, max(camera.width, camera.height))
    width, height = max(1, round(camera.width / step)), max(1, round(camera.height / step))
    du, dv = camera.du * (camera.width / width), camera.dv * (camera.height / height)
    small = replace(camera, du=du, dv=dv, width=width, height=height)
    image = render(replace(scene, camera=small), estimator=estimator, spp=4).image
    y, x = np.meshgrid(np.arange(height + 1.0), np.arange(width + 1.0), indexing="ij")
    plane = small.screen(x.ravel(), y.ravel(), SCREEN * extent)
    return plane.T.reshape(*x.shape, 3), _shown(image)


def _shown(image: Array) -> NDArray[np.uint8]:
    """Linear radiance as 8-bit values, by a power of 1/2.2."""
    return np.rint(255 * np.clip(image, 0.0, 1.0) ** (1 / 2.2)).astype(np.uint8)


def _labels(scene: RenderScene) -> list[tuple[Array, str]]:
    """The camera and the lights that have a place."""
    labels = [(scene.camera.origin[:, 0], "camera")]
    for source, name in zip(scene.sources.all, scene.sources.names, strict=True):
        if isinstance(source, ShapeDescription):
            labels.append((source.geometry.corners.mean(axis=0), f"light: {name}"))
        elif source.place is not None:
            labels.append((source.place, f"light: {name}"))
    return labels if len(labels) <= LABELS + 1 else [labels[0]]


def _veiled(
    scene: RenderScene, position: Array, seen: Array | None, tried: Tried | None, screen: Array
) -> frozenset[int]:
    """The shapes that stand before the camera, its screen, the pixel's point or the ends of samples."""
    goals = [
        scene.camera.origin.T,
        screen[:: max(1, len(screen) - 1), :: max(1, screen.shape[1] - 1)].reshape(-1, 3),
    ]
    if seen is not None:
        goals.append(seen[None])
    if tried is not None:
        goals += [tried.start + share * (tried.end - tried.start) for share in (0.5, 0.97)]
    way = np.concatenate(goals).T - position[:, None]
    far = np.sqrt((way * way).sum(axis=0))
    origin, d = np.repeat(position[:, None], far.size, axis=1), way / far
    found: set[int] = set()
    left = far * (1 - 1e-3)
    for _ in range(4):  # through four surfaces at most
        t, shape = first_hit(scene, origin, d)
        hidden = np.flatnonzero(t < left)
        if not hidden.size:
            break
        found |= set(shape[hidden].tolist())
        origin = (origin + d * (t * (1 + 1e-6)))[:, hidden]
        d, left = d[:, hidden], (left - t)[hidden]
    return frozenset(found)


def first_hit(scene: RenderScene, origin: Array, d: Array) -> tuple[Array, NDArray[np.int64]]:
    """Distance (n,) to the first surface from origin (3, n) along d (3, n), and its shape; inf and -1 for
    none.
    """
    everyone = np.arange(len(scene.analytic), dtype=np.int64)
    t, primitive = scene.analytic.closest(everyone, origin, d)
    shape = np.append(scene.analytic.shape, -1)[primitive]
    if scene.triangles is None:
        return t, shape
    near, triangle = scene.triangles.closest(origin, d)
    nearer = near < t
    return np.where(nearer, near, t), np.where(nearer, scene.triangles.shape[triangle], shape)

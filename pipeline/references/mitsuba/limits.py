# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false, reportMissingTypeStubs=false
"""Scenes that Mitsuba's float32 rays get wrong, told from the description alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from trimesh.triangles import closest_point

from pipeline.references.mitsuba.scene import convert, normalising_frame
from pipeline.references.mitsuba.shadows import EARLY, overlooked
from pipeline.references.mitsuba.shapes import Frame, side_shift, triangles
from pipeline.references.mitsuba.worker import RAY_LIFT
from pipeline.references.protocol import unlit
from scenes.description.coincidence import ambiguous
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Array, Geometry, ShapeDescription
from scenes.errors import Location

RIM = 64  # points on a disk's rim


def reason(scene: SceneDescription) -> str | None:
    """Say in one sentence why Mitsuba renders a scene wrong; None if it does not.

    SceneError if the scene cannot be converted at all.
    """
    if why := unlit(scene):
        return why
    if why := ambiguous(scene.shapes):
        return why
    convert(scene)
    frame = normalising_frame(scene)
    proxies = [(shape, _proxy(shape.geometry, frame)) for shape in scene.shapes]
    for light in _lights(scene, proxies, frame):
        others = [proxy for shape, proxy in proxies if shape is not light.shape]
        if why := _overlooked_gap(light, others, frame) or _overlooked_shade(light, others, frame):
            return f"a light{f' ({light.where})' if light.where else ''} is {why}"
    return None


@dataclass(frozen=True, eq=False)
class _Proxy:
    """A shape for distances: points (m, 3) and triangles (t, 3, 3), thickened by `radius`."""

    points: Array
    triangles: Array
    radius: float = 0.0

    def box(self) -> tuple[Array, Array]:
        return self.points.min(axis=0) - self.radius, self.points.max(axis=0) + self.radius


@dataclass(frozen=True, eq=False)
class _Light:
    """A light that has a place.

    shape: its own, which it may touch. moved: how far conversion moves it, in normalised coordinates.
    """

    proxy: _Proxy
    where: Location | None
    shape: ShapeDescription | None = None
    moved: float = 0.0


def _overlooked_gap(light: _Light, others: list[_Proxy], frame: Frame) -> str | None:
    """Whether a shape is nearer to the light than Mitsuba's rays start off it.

    Measured, Mitsuba then reads 0 where the truth is 0.5.
    """
    low, high = light.proxy.box()
    lift = RAY_LIFT * (1.0 + float(np.abs(np.stack([low, high])).max())) + light.moved
    gap = min((_gap(light.proxy, _within(one, low - lift, high + lift)) for one in others), default=np.inf)
    if gap >= lift:
        return None
    return (
        f"{gap / frame.scale:.2g} from other geometry, where Mitsuba's rays start "
        f"{lift / frame.scale:.2g} off a surface and overlook it"
    )


def _overlooked_shade(light: _Light, others: list[_Proxy], frame: Frame) -> str | None:
    """Whether a surface that shades is so near to the light that shadow rays end before it."""
    points = np.concatenate([np.zeros((0, 3)), *(proxy.points for proxy in others)])
    distance = overlooked(light.proxy.points, [proxy.triangles for proxy in others], points)
    if distance is None:
        return None
    return (
        f"{distance / frame.scale:.2g} from a surface that shades, where Mitsuba's shadow rays "
        f"have ended already: {EARLY:g} of their length before the light"
    )


def _lights(
    scene: SceneDescription, proxies: list[tuple[ShapeDescription, _Proxy]], frame: Frame
) -> Iterator[_Light]:
    for shape, proxy in proxies:
        if shape.emission:
            moved = side_shift(shape.geometry, frame) if shape.emission.two_sided else 0.0
            yield _Light(proxy, shape.where, shape, moved)
    for light in scene.lights:
        if light.place is not None:
            yield _Light(_Proxy(frame.points(light.place)[None], np.zeros((0, 3, 3))), light.where)


def _proxy(geometry: Geometry, frame: Frame) -> _Proxy:
    bounds = geometry.bounds()
    if bounds.radius and bounds.axis is None:
        return _Proxy(frame.points(bounds.points), np.zeros((0, 3, 3)), bounds.radius * frame.scale)
    vertices, faces = triangles(geometry, RIM)
    points = frame.points(vertices)
    return _Proxy(points, points[faces])


def _within(proxy: _Proxy, low: Array, high: Array) -> _Proxy:
    """The points and triangles of `proxy` whose bounding boxes touch the box from `low` to `high`."""
    touching = np.all((proxy.triangles.min(axis=1) <= high) & (proxy.triangles.max(axis=1) >= low), axis=1)
    near = np.all((proxy.points - proxy.radius <= high) & (proxy.points + proxy.radius >= low), axis=1)
    return _Proxy(proxy.points[near], proxy.triangles[touching], proxy.radius)


def _gap(a: _Proxy, b: _Proxy) -> float:
    """The least distance from the points of one to the surface of the other, both ways."""
    between = np.linalg.norm(a.points[:, None] - b.points[None], axis=-1).ravel()
    distances = (_to_triangles(a.points, b.triangles), _to_triangles(b.points, a.triangles), between)
    return float(min(np.min(np.abs(d - a.radius - b.radius), initial=np.inf) for d in distances))


def _to_triangles(points: Array, faces: Array) -> Array:
    """Distances (m * t,) of every point to every triangle."""
    p, f = np.repeat(points, len(faces), axis=0), np.tile(faces, (len(points), 1, 1))
    return np.linalg.norm(closest_point(f, p) - p, axis=1) if len(p) else np.zeros(0)

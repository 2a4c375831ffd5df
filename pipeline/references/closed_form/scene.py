"""Recognise scenes with a closed form: one light over coplanar diffuse receivers.

Accepted: exactly one light that emitters.py knows; every other shape lies in one plane, made of convex pieces
that do not overlap; light and camera are on the same side of that plane. Then nothing can lie between light
and receiver, nor between light and camera, and the radiance of every visible point is a formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.references.closed_form.emitters import (
    Emitter,
    area_emitter,
    farthest,
    outline_is_seen,
    point_emitter,
)
from pipeline.references.closed_form.patches import FLAT, Patch, Plane, area, needs, outline
from pipeline.references.closed_form.radiometry import clip_polygon_by_plane
from scenes.arrays import Array
from scenes.description.lights import Light
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Mesh, ShapeDescription


@dataclass(frozen=True, eq=False)
class Receiver:
    """A diffuse patch in the receivers' plane. reflectance: (3,)."""

    patch: Patch
    reflectance: Array


@dataclass(frozen=True, eq=False)
class ClosedFormScene:
    """A scene with a closed form.

    radiance: (3,), or a point light's intensity. plane: the receivers', its normal on the camera's side; None
    without receivers. eye: (3,), the camera's position.
    """

    light: Emitter
    radiance: Array
    two_sided: bool
    receivers: tuple[Receiver, ...]
    plane: Plane | None
    eye: Array


def analyse(scene: SceneDescription) -> ClosedFormScene:
    """The parts of a scene with a closed form; SceneError with the reason in one sentence if it has none."""
    lights = [shape for shape in scene.shapes if shape.emission]
    count = len(lights) + len(scene.lights)
    if count != 1:
        raise needs(f"exactly one light, and this scene has {count}")
    if not lights or lights[0].emission is None:
        return _under_point(scene, scene.lights[0])
    emission, light = lights[0].emission, area_emitter(lights[0])
    if emission.image is not None:
        raise needs("a light of the same radiance all over", lights[0].where)
    receivers, plane, eye = ground(scene)
    if plane is not None:
        _require_same_side(light, plane, eye)
    if not outline_is_seen(light, scene.camera):
        raise needs("a disk or sphere light wholly before or wholly behind the camera", lights[0].where)
    return ClosedFormScene(light, emission.radiance, emission.two_sided, receivers, plane, eye)


def _under_point(scene: SceneDescription, light: Light) -> ClosedFormScene:
    emitter = point_emitter(light)
    receivers, plane, eye = ground(scene)
    if plane is not None and plane.height(emitter.position) <= FLAT * float(np.abs(eye - plane.point).max()):
        raise needs("light and camera on the same side of the receivers' plane", light.where)
    return ClosedFormScene(emitter, emitter.intensity, False, receivers, plane, eye)


def ground(scene: SceneDescription) -> tuple[tuple[Receiver, ...], Plane | None, Array]:
    """The receivers, their plane (None without any) and the eye (3,).

    SceneError if the receivers are not flat, diffuse and coplanar, or the pixel filter is not a box.
    """
    pixel = scene.film.pixel_filter
    if (pixel.kind, pixel.xradius, pixel.yradius) != ("box", 0.5, 0.5):
        raise needs("the box filter of one pixel")
    receivers = tuple(_receiver(shape) for shape in scene.shapes if not shape.emission)
    eye = np.array(scene.camera.camera_to_world[:3, 3])
    plane = _common_plane(receivers, eye)
    _require_apart(receivers)
    return receivers, plane, eye


def _receiver(shape: ShapeDescription) -> Receiver:
    if not isinstance(shape.geometry, Mesh):
        kind = type(shape.geometry).__name__.lower()
        raise needs(f"flat receivers of triangles or patches, and there is a {kind}", shape.where)
    if not isinstance(shape.material, Diffuse) or not isinstance(shape.material.reflectance, np.ndarray):
        raise needs("receivers of one diffuse reflectance each", shape.where)
    return Receiver(outline(shape.geometry, shape, oriented=False), shape.material.reflectance)


def _common_plane(receivers: tuple[Receiver, ...], eye: Array) -> Plane | None:
    if not receivers:
        return None
    first = receivers[0].patch
    corners = np.concatenate([receiver.patch.outline for receiver in receivers])
    extent = float(np.ptp(corners, axis=0).max())
    if np.abs((corners - first.outline[0]) @ first.normal).max() > FLAT * extent:
        raise needs("all receivers in one plane: others could cast shadows")
    up = first.normal if (eye - first.outline[0]) @ first.normal >= 0 else -first.normal
    return Plane(first.outline[0], up)


def _require_apart(receivers: tuple[Receiver, ...]) -> None:
    """Raise SceneError if two receivers overlap: rounding would decide which one is seen."""
    patches = [receiver.patch for receiver in receivers]
    for i, a in enumerate(patches):
        for b in patches[:i]:
            common = a.outline[None]
            for corner, edge in zip(b.outline, np.roll(b.outline, -1, axis=0) - b.outline, strict=True):
                inward = np.cross(b.normal, edge)
                common = clip_polygon_by_plane(common, inward, inward @ corner)[0]
            if area(common[0]) > FLAT * min(area(a.outline), area(b.outline)):
                raise needs("receivers that do not overlap")


def _require_same_side(light: Emitter, plane: Plane, eye: Array) -> None:
    lowest, highest = (plane.height(farthest(light, sign * plane.normal)) for sign in (-1.0, 1.0))
    if lowest < -FLAT * max(highest - lowest, float(np.abs(eye - plane.point).max())):
        raise needs("light and camera on the same side of the receivers' plane")

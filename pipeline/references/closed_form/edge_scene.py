"""Recognise scenes of a straight edge before a light over a floor, and take their parts.

Accepted: one light, flat and convex, one-sided; a floor and a sheet, flat, convex, diffuse, in parallel
planes, the sheet between floor and light; the camera above the sheet's plane, with the light out of its view.
Of the sheet's edges all but one must be out of the way: every line from a point of the floor to one of the
light crosses the sheet's plane on the inner side of them. By convexity that holds for all points if it holds
for the corners of floor and light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.references.closed_form.film import film_plane
from pipeline.references.closed_form.patches import FLAT, Patch, Plane, outline
from pipeline.references.closed_form.scene import Receiver
from scenes.arrays import Array
from scenes.description.materials import Diffuse
from scenes.description.scene import Camera, SceneDescription
from scenes.description.scene import Film as FilmDescription
from scenes.description.shapes import Mesh, ShapeDescription
from scenes.errors import Location, SceneError

NEAR = 0.02  # least distance of the light from the sheet, of its extent: a cell's rule resolves no less


@dataclass(frozen=True, eq=False)
class EdgeScene:
    """A light, a floor, and a sheet between them with one straight edge.

    radiance: (3,). edge: (2, 3), two points of it. blocked: (3,), unit, from the edge into the sheet. Normals
    of the planes lie on the light's side.
    """

    light: Patch
    radiance: Array
    floor: Receiver
    sheet: Receiver
    floor_plane: Plane
    sheet_plane: Plane
    edge: Array
    blocked: Array


def _needs(what: str, where: Location | None = None) -> SceneError:
    return SceneError(f"the closed form of an edge needs {what}", where)


def analyse_edge(scene: SceneDescription) -> EdgeScene:
    """The parts of a scene with a straight edge; SceneError with the reason in one sentence if it has
    none.
    """
    emitting = [shape for shape in scene.shapes if shape.emission]
    others = [shape for shape in scene.shapes if not shape.emission]
    if len(emitting) != 1 or scene.lights or len(others) != 2:
        raise _needs("one area light, one floor and one sheet, and nothing else")
    pixel = scene.film.pixel_filter
    if (pixel.kind, pixel.xradius, pixel.yradius) != ("box", 0.5, 0.5):
        raise _needs("the box filter of one pixel")
    light, radiance = _light(emitting[0])
    floor, sheet, normal = _in_order(others, light)
    floor_plane, sheet_plane = (Plane(part.patch.outline[0], normal) for part in (floor, sheet))
    _require_clear_order(light, floor_plane, sheet_plane, scene.camera)
    _require_light_out_of_view(light, scene.camera, scene.film)
    edge, blocked = _edge(light, floor, sheet, floor_plane, sheet_plane)
    return EdgeScene(light, radiance, floor, sheet, floor_plane, sheet_plane, edge, blocked)


def _light(shape: ShapeDescription) -> tuple[Patch, Array]:
    emission = shape.emission
    if emission is None or emission.two_sided or emission.image is not None:
        raise _needs("a one-sided light of one radiance", shape.where)
    if not isinstance(shape.geometry, Mesh):
        raise _needs("a flat light of straight sides", shape.where)
    return outline(shape.geometry, shape, oriented=True), emission.radiance


def _receiver(shape: ShapeDescription) -> Receiver:
    if not isinstance(shape.geometry, Mesh):
        raise _needs("a flat floor and a flat sheet", shape.where)
    if not isinstance(shape.material, Diffuse) or not isinstance(shape.material.reflectance, np.ndarray):
        raise _needs("surfaces of one diffuse reflectance each", shape.where)
    return Receiver(outline(shape.geometry, shape, oriented=False), shape.material.reflectance)


def _in_order(shapes: list[ShapeDescription], light: Patch) -> tuple[Receiver, Receiver, Array]:
    """Floor, sheet, and their common normal towards the light."""
    one, two = (_receiver(shape) for shape in shapes)
    if np.linalg.norm(np.cross(one.patch.normal, two.patch.normal)) > FLAT:
        raise _needs("floor and sheet to be parallel", shapes[1].where)
    middle = light.outline.mean(axis=0)
    heights = [float((middle - part.patch.outline[0]) @ one.patch.normal) for part in (one, two)]
    normal = one.patch.normal * np.copysign(1.0, heights[0])
    floor, sheet = (one, two) if abs(heights[0]) > abs(heights[1]) else (two, one)
    return floor, sheet, normal


def _require_clear_order(light: Patch, floor: Plane, sheet: Plane, camera: Camera) -> None:
    extent = float(np.ptp(light.outline, axis=0).max())
    if not float(floor.height(sheet.point)) > 0:
        raise _needs("the sheet between floor and light")
    if float(sheet.height(light.outline).min()) < NEAR * extent:
        raise _needs(f"a light {NEAR:g} of its extent or more above the sheet")
    if not float(sheet.height(np.array(camera.camera_to_world[:3, 3]))) > 0:
        raise _needs("a camera on the light's side of the sheet")


def _require_light_out_of_view(light: Patch, camera: Camera, film: FilmDescription) -> None:
    """Raise SceneError unless the light is beyond one side of the frustum or behind the camera."""
    plane = film_plane(camera, film)
    x, y, z = plane.to_camera @ (light.outline - plane.eye).T
    sides = (z, x - plane.x[0] * z, plane.x[-1] * z - x, y - plane.y[-1] * z, plane.y[0] * z - y)
    if not any(bool(np.all(side < 0)) for side in sides):
        raise _needs("the light to be out of the camera's view")


def _edge(light: Patch, floor: Receiver, sheet: Receiver, low: Plane, high: Plane) -> tuple[Array, Array]:
    """The one edge that may stand before the light, (2, 3), and the direction from it into the sheet,
    (3,).
    """
    corners, far = floor.patch.outline, light.outline
    share = float(low.height(high.point)) / low.height(far)
    crossing = (corners[:, None] * (1 - share[:, None]) + far * share[:, None]).reshape(-1, 3)
    starts = sheet.patch.outline
    along = np.roll(starts, -1, axis=0) - starts
    inward = np.cross(sheet.patch.normal, along)
    inward = inward / np.linalg.norm(inward, axis=1, keepdims=True)
    depth = np.einsum("ek,nek->en", inward, crossing[:, None] - starts)
    open_edges = np.flatnonzero(depth.min(axis=1) <= 0)
    if open_edges.size != 1:
        raise _needs(f"one edge of the sheet before the light, and {open_edges.size} may be there")
    i = int(open_edges[0])
    return np.stack([starts[i], starts[i] + along[i]]), inward[i]

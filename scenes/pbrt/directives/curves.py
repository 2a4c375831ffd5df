"""`Shape "curve"`: Bezier curves and B-splines of degree 2 and 3, as triangles.

pbrt widens a curve about the ray that meets it. A `cylinder` has the outline and the normals of a round tube,
a `ribbon` lies across its given normals, a `flat` curve turns to each ray and is no surface. A tube has SIDES
sides: its outline is of the right width on average, and within 2.5 % of it from every side. Chords leave the
curve by 1/40 of its width at most.
"""

from __future__ import annotations

import numpy as np

from scenes.description.shapes import Array, Faces, Geometry, TriangleMesh, halves
from scenes.errors import SceneError
from scenes.pbrt.directives.meshes import Placement
from scenes.pbrt.text.parameters import Parameters

SIDES = 12
OFF_CURVE = 1 / 40  # of the greater width: half of what pbrt splits its curves to
MOST_STEPS = 1024
LARGEST_COSINE = 1 - 1e-9  # of the angle between normals that are taken for one

# Control points of a cubic Bezier curve from those of others, as pbrt-v4 elevates and converts them.
TO_CUBIC = {
    ("bezier", 3): np.eye(4),
    ("bezier", 2): np.array([[3.0, 0, 0], [1, 2, 0], [0, 2, 1], [0, 0, 3]]) / 3,
    ("bspline", 3): np.array([[1.0, 4, 1, 0], [0, 4, 2, 0], [0, 2, 4, 0], [0, 1, 4, 1]]) / 6,
}
TO_CUBIC["bspline", 2] = TO_CUBIC["bezier", 2] @ (np.array([[1.0, 1, 0], [0, 2, 0], [0, 1, 1]]) / 2)


def curve(parameters: Parameters, placement: Placement) -> list[Geometry]:
    """`Shape "curve"` as triangles."""
    if placement.light is not None:
        raise SceneError(
            "pbrt cannot sample a curve that emits light: take its area light off", parameters.where
        )
    kind = parameters.text("type", "flat")
    segments = _segments(parameters)
    width = parameters.number("width", 1.0)
    ends = parameters.number("width0", width), parameters.number("width1", width)
    parameters.integer("splitdepth", 3)  # of no effect on the image
    normals = _ribbon_normals(parameters, kind, len(segments))
    widths = np.interp(np.arange(len(segments) + 1), [0, len(segments)], ends)
    if max(ends) <= 0:
        raise parameters.fail("width", "a curve must have a width above 0")
    if kind == "flat":
        parameters.substitute("type", 'a curve of type "flat", which turns to each ray,', "as a round tube")
    parameters.remark("P", "curves are rendered as triangles, whose outlines are within 2.5 % of the width")
    points, faces, uv, outward = swept(segments, widths, normals)
    # A mirror turns the normal round in pbrt, as it does the corners of a face.
    outward = placement.transform.normals(outward) * (-1.0 if placement.turned else 1.0)
    return [TriangleMesh(placement.transform.points(points), faces, placement.reverse, uv, outward)]


def _segments(parameters: Parameters) -> Array:
    """(s, 4, 3): each part of a curve as the control points of a cubic Bezier curve."""
    degree, basis = parameters.integer("degree", 3), parameters.text("basis", "bezier")
    if degree not in (2, 3):
        raise parameters.fail("degree", f"the degree of a curve must be 2 or 3, not {degree}")
    if basis not in ("bezier", "bspline"):
        raise parameters.fail("basis", f"the basis of a curve must be bezier or bspline, not {basis}")
    points = parameters.vectors("point3", "P")
    count = 0 if points is None else len(points)
    step = degree if basis == "bezier" else 1
    if points is None or count < degree + 1 or (count - 1 - degree) % step:
        needed = (
            f"{degree + 1} points, and {degree} for each further part" if step > 1 else f"{degree + 1} points"
        )
        raise SceneError(f'a {basis} curve of degree {degree} needs "point3 P" of {needed}', parameters.where)
    first = np.arange(0, count - degree, step)
    return np.einsum("ij,sjc->sic", TO_CUBIC[basis, degree], points[first[:, None] + np.arange(degree + 1)])


def _ribbon_normals(parameters: Parameters, kind: str, count: int) -> Array | None:
    """(s + 1, 3) unit normals at the ends of a ribbon's parts; None for other curves."""
    if kind not in ("flat", "cylinder", "ribbon"):
        raise parameters.fail("type", f"the type of a curve must be flat, cylinder or ribbon, not {kind}")
    given = parameters.vectors("normal", "N")
    if kind != "ribbon":
        if given is not None:
            parameters.remark("N", "normals of a curve that is no ribbon are of no effect, as in pbrt")
        return None
    found = 0 if given is None else len(given)
    if given is None or found != count + 1:
        raise parameters.fail(
            "N",
            f'a ribbon of {count} parts needs {count + 1} normals "N", not {found}',
        )
    length = np.linalg.norm(given, axis=1, keepdims=True)
    if not (length > 0).all():
        raise parameters.fail("N", "a normal of a ribbon has no length")
    return given / length


def swept(segments: Array, widths: Array, normals: Array | None) -> tuple[Array, Faces, Array, Array]:
    """Points (m, 3), triangles (t, 3), uv (m, 2) and normals (m, 3) of parts (s, 4, 3) of a curve.

    widths: (s + 1,) at the ends of parts. normals: (s + 1, 3) there, of a ribbon; None for tubes. Those made
    point out of tubes, and along a ribbon's own.
    """
    second = segments[:, :-2] - 2 * segments[:, 1:-1] + segments[:, 2:]
    bend = float(np.linalg.norm(second, axis=2).max())
    steps = int(
        np.clip(np.ceil(np.sqrt(0.75 * bend / (OFF_CURVE * max(float(widths.max()), 1e-300)))), 1, MOST_STEPS)
    )
    u = np.linspace(0.0, 1.0, steps + 1)
    p, tangent = _evaluated(segments, u)
    width = widths[:-1, None] * (1 - u) + widths[1:, None] * u
    if normals is None:
        x, y = _frames(tangent)
        angle = 2 * np.pi * np.arange(SIDES + 1) / SIDES
        angle[-1] = 0.0
        across = x[:, :, None] * np.cos(angle)[:, None] + y[:, :, None] * np.sin(angle)[:, None]
        radius = (
            width / 2 / (SIDES / np.pi * np.sin(np.pi / SIDES))
        )  # the mean outline is as wide as the curve
        points: Array = p[:, :, None] + across * radius[:, :, None, None]
        outward: Array = np.asarray(across, dtype=np.float64)
    else:
        own = _turned_normals(normals, u)
        aside = np.asarray(np.cross(own, tangent), dtype=np.float64)
        aside /= np.maximum(np.linalg.norm(aside, axis=2, keepdims=True), np.finfo(np.float64).tiny)
        v = np.array([-0.5, 0.5])
        points = p[:, :, None] + aside[:, :, None] * (width[:, :, None] * v)[..., None]
        across = np.asarray(np.cross(tangent, aside), dtype=np.float64)
        outward = np.repeat(across[:, :, None], 2, axis=2)
    rings, count = points.shape[1], points.shape[2]
    uv = np.stack(np.broadcast_arrays(u[:, None], np.linspace(0.0, 1.0, count)), axis=-1)
    faces = _strips(len(segments), rings, count)
    if normals is None:
        faces = faces[:, ::-1]  # u and v go round a tube the other way
    coordinates = np.broadcast_to(uv, (len(segments), *uv.shape)).reshape(-1, 2)
    return points.reshape(-1, 3), faces, coordinates, outward.reshape(-1, 3)


def _evaluated(segments: Array, u: Array) -> tuple[Array, Array]:
    """Points and unit tangents (s, n, 3) at the parameters u (n,) of every part."""
    v = 1 - u
    weights = np.stack([v**3, 3 * u * v * v, 3 * u * u * v, u**3], axis=1)
    slopes = np.stack([v * v, 2 * u * v, u * u], axis=1)
    chord = segments[:, 3] - segments[:, 0]
    tangent = np.einsum("nk,skc->snc", slopes, np.diff(segments, axis=1))
    length = np.linalg.norm(tangent, axis=2, keepdims=True)
    tangent = np.where(length > 0, tangent, chord[:, None])  # where control points coincide
    length = np.linalg.norm(tangent, axis=2, keepdims=True)
    tangent = np.where(length > 0, tangent / np.where(length > 0, length, 1.0), np.eye(3)[2])
    return np.einsum("nk,skc->snc", weights, segments), tangent


def _frames(tangent: Array) -> tuple[Array, Array]:
    """Unit axes x, y (s, n, 3) across tangents (s, n, 3), with the least rotation about them."""
    helper = np.eye(3)[np.abs(tangent).argmin(axis=2)]
    x = np.cross(tangent, helper)
    x /= np.linalg.norm(x, axis=2, keepdims=True)
    y = np.cross(tangent, x)
    before, after = tangent[:, :-1], tangent[:, 1:]
    # The least rotation from one tangent to the next takes x to x - (x.after) / (1 + cos) (before + after).
    cosine = np.maximum(1 + np.einsum("snc,snc->sn", before, after), 1e-12)
    along = np.einsum("snc,snc->sn", x[:, :-1], after) / cosine
    carried = x[:, :-1] - along[..., None] * (before + after)
    twist = np.arctan2(
        np.einsum("snc,snc->sn", carried, y[:, 1:]), np.einsum("snc,snc->sn", carried, x[:, 1:])
    )
    angle = np.concatenate([np.zeros((len(twist), 1)), np.cumsum(twist, axis=1)], axis=1)[..., None]
    return x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)


def _turned_normals(normals: Array, u: Array) -> Array:
    """(s, n, 3): a ribbon's normals, turned from one end of each part to the other at a constant rate."""
    first, last = normals[:-1, None], normals[1:, None]
    cosine = np.clip(np.einsum("snc,snc->sn", first, last), -1.0, 1.0)[..., None]
    angle = np.where(cosine < LARGEST_COSINE, np.arccos(cosine), 1.0)
    a, b = np.sin((1 - u)[:, None] * angle) / np.sin(angle), np.sin(u[:, None] * angle) / np.sin(angle)
    return np.where(cosine < LARGEST_COSINE, a * first + b * last, first)


def _strips(parts: int, rings: int, count: int) -> Faces:
    """The triangles of `parts` grids of `rings` rows and `count` columns."""
    i = np.arange(rings - 1)[:, None] * count + np.arange(count - 1)
    first = (np.arange(parts) * rings * count)[:, None, None]
    corner = (first + i).ravel()
    return halves(np.stack([corner, corner + count, corner + 1, corner + count + 1], axis=1))

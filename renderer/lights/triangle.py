"""Triangular lights, one a face of an emitting mesh: `area`, `solid-angle` [arvo1995] and
`projected-solid-angle`.

Faces are flat: a mesh's vertex normals, if it has any, play no part. The mathematics is in
`renderer.spherical`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.light_sampling.area import AreaSampling, Emitters
from renderer.light_sampling.polygon import ProjectedSolidAngle, irradiance
from renderer.math.vectors import Floats, cross, dot, gather, normalize
from renderer.math.warp import uniform_triangle
from renderer.records import LightSample
from renderer.spherical.triangle import sample, solid_angle
from scenes.arrays import Mask
from scenes.description.materials import Diffuse
from scenes.description.shapes import Emission, ShapeDescription, TriangleMesh
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class TriangleLights:
    """corner, normal: (3, k). edges: (3, 2, k), from the corner to the second and to the third. area:
    (k,).
    """

    parts: Parts
    emitters: Emitters
    corner: Floats
    edges: Floats
    normal: Floats
    area: Floats

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return {
            "area": AreaSampling(self),
            "solid-angle": TriangleSolidAngle(self),
            "projected-solid-angle": ProjectedSolidAngle(self),
        }

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> TriangleLights:
        """One light for each face, in the order of faces; SceneError for a face without area."""
        parts = [_corners(s) for s in sources if isinstance(s, ShapeDescription)]
        points = np.concatenate(parts, axis=2)
        each = [part.shape[2] for part in parts]
        corner, edges = points[:, 0], points[:, 1:] - points[:, :1]
        normal = cross(edges[:, 0], edges[:, 1])
        double = np.sqrt(dot(normal, normal))
        turn = np.repeat([_turn(s) for s in sources], each)
        parts, emitters = Parts.by_area(index, each, double / 2.0), Emitters.of(sources).repeat(each)
        return cls(parts, emitters, corner, edges, normal / double * turn, double / 2.0)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        b, c = uniform_triangle(u)
        edges = gather(self.edges, index)
        return gather(self.corner, index) + edges[:, 0] * b + edges[:, 1] * c, gather(self.normal, index)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        return irradiance(self, index, ref_p, ref_n)

    def corners(self, index: Index, p: Floats) -> tuple[Floats, Floats]:
        return gather(self.corner, index) - p, gather(self.edges, index)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> Mask:
        return self.emitters.emits(index, cos_light)

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Distance and cosine; see `Surface`. A direction is inside where it lies on the same side of the
        three planes through the edges.
        """
        a, edges = self.corners(index, origin)
        ab, ac = edges[:, 0], edges[:, 1]
        normal = gather(self.normal, index)
        cos_light = -dot(wi, normal)
        wa, wb, wc = dot(wi, cross(a + ab, ac - ab)), dot(wi, cross(ac, a)), dot(wi, cross(a, ab))
        inside = (np.minimum(np.minimum(wa, wb), wc) >= 0) | (np.maximum(np.maximum(wa, wb), wc) <= 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            dist = -dot(a, normal) / cos_light
            hit = inside & (dist > 0) & self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light


@dataclass(frozen=True, eq=False)
class TriangleSolidAngle:
    """Uniform in the solid angle of the triangle: weights stay bounded however close it comes [arvo1995]."""

    lights: TriangleLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        a, edges = li.corners(index, ref_p)
        normal = gather(li.normal, index)
        point, omega = sample(u, a, edges[:, 0], edges[:, 1])
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            dist = np.sqrt(dot(point, point))
            wi, pdf = point / dist, 1.0 / omega
        valid = (omega > 0) & (pdf < np.inf) & (dist > 0) & li.emitters.emits(index, -dot(a, normal))
        return LightSample(wi, dist, normal, gather(li.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        a, edges = self.lights.corners(index, ref_p)
        omega = solid_angle(a, edges[:, 0], edges[:, 1])
        hit = (self.lights.intersect(index, ref_p, wi)[0] < np.inf) & (omega > 0)
        return np.where(hit, 1.0 / np.where(hit, omega, 1.0), 0.0)


def _corners(shape: ShapeDescription) -> Floats:
    """Corners (3, 3, t) of all faces of an emitting mesh: coordinate, corner, face. Raises SceneError for a
    face without area.
    """
    mesh = shape.geometry
    assert isinstance(mesh, TriangleMesh)
    corners = np.ascontiguousarray(mesh.vertices[mesh.faces].transpose(2, 1, 0))
    normal = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if (~(dot(normal, normal) > 0)).any():
        raise SceneError(
            "a triangle of an emitting mesh has no area: only triangles with area can emit", shape.where
        )
    return corners


def _turn(source: Source) -> float:
    mesh = source.geometry if isinstance(source, ShapeDescription) else None
    return -1.0 if isinstance(mesh, TriangleMesh) and mesh.reverse else 1.0


def _shape(mesh: TriangleMesh, two_sided: bool = False) -> ShapeDescription:
    return ShapeDescription(mesh, Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0]), two_sided))


def _examples() -> list[LightExample]:
    down = np.array([[-1.0, 2.0, -0.5], [1.0, 2.0, -0.7], [0.8, 2.0, 0.9]])
    mesh, turned = (TriangleMesh(down, np.array([face])) for face in ([0, 1, 2], [0, 2, 1]))
    # Below, far, aside, near a corner, nearly in its plane, near the middle, and with the horizon through
    # it
    p = np.array(
        [
            [0.0, 1.0, 0.0],
            [15.0, -18.0, 5.0],
            [1.0, 1.5, 0.5],
            [0.95, 1.9, -0.6],
            [1.5, 1.95, 0.1],
            [0.3, 1.98, -0.1],
            [0.15, 1.2, 0.0],
        ]
    ).T
    n = normalize(
        np.array([[0.0, 1, 0], [0, 1, 0], [-1, 1, 0], [-0.2, 1, 0.1], [0, 1, 0], [0, 1, 0], [1, 0.1, 0]]).T
    )
    mirror = np.array([[1.0], [-1.0], [1.0]])
    above = p * mirror + np.array([[0.0], [4.0], [0.0]])
    standing = TriangleMesh(
        np.array([[0.0, -0.4, 0.0], [0.0, 1.2, -0.8], [0.0, 0.5, 0.9]]), np.array([[0, 2, 1]])
    )
    # On a floor that the light goes through: near it, far, and by the line where it does
    at = np.array([[-0.8, 0.0, 0.1], [-9.0, 0.0, 3.0], [-0.02, 0.0, -0.05], [-0.3, 0.0, 1.5]]).T
    up = np.repeat(np.array([[0.0], [1.0], [0.0]]), 4, axis=1)
    return [
        LightExample("a triangle facing down", _shape(mesh), p, n),
        LightExample("a two-sided triangle from above", _shape(turned, two_sided=True), above, n * mirror),
        LightExample("a triangle standing in the floor", _shape(standing), at, up),
    ]


TECHNIQUES = ("area", "solid-angle", "projected-solid-angle")
LIGHTS.add("triangle", LightKind(TriangleMesh, TriangleLights.make, "triangles", TECHNIQUES, _examples))

"""Rectangular lights: `area`, `solid-angle` by the spherical rectangle [urena2013], and
`projected-solid-angle`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.light_sampling.area import AreaSampling, Emitters, receivers
from renderer.light_sampling.polygon import ProjectedSolidAngle, irradiance
from renderer.math.vectors import Floats, combine, cross, dot, gather, normalize
from renderer.records import LightSample
from renderer.spherical.rectangle import invert, solid_angle
from scenes.arrays import Mask
from scenes.description.materials import Diffuse
from scenes.description.shapes import BilinearMesh, Emission, ShapeDescription
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class RectangleLights:
    """corner, x, y, normal: (3, k), x and y unit vectors along the edges. lx, ly: (k,) edge lengths. plain:
    whether no light of the group carries an image.
    """

    parts: Parts
    emitters: Emitters
    corner: Floats
    x: Floats
    y: Floats
    normal: Floats
    lx: Floats
    ly: Floats
    plain: bool

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        return self.lx * self.ly

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return {
            "area": AreaSampling(self),
            "solid-angle": RectangleSolidAngle(self),
            "projected-solid-angle": ProjectedSolidAngle(self),
        }

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> RectangleLights:
        """One light for each patch; the patches of a mesh share its shape."""
        shapes = [s for s in sources if isinstance(s, ShapeDescription)]
        parts = [_patches(s) for s in shapes]
        points = np.concatenate(parts, axis=2)
        each = [part.shape[2] for part in parts]
        corner, ex, ey = points[:, 0], points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
        lx, ly = np.sqrt(dot(ex, ex)), np.sqrt(dot(ey, ey))
        turn = np.repeat([_turn(s) for s in shapes], each)
        parts, emitters = Parts.by_area(index, each, lx * ly), Emitters.of(sources).repeat(each)
        plain = all(s.emission is None or s.emission.image is None for s in shapes)
        return cls(parts, emitters, corner, ex / lx, ey / ly, normalize(cross(ex, ey)) * turn, lx, ly, plain)

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        x, y = (gather(self.x, index), gather(self.y, index))
        p = gather(self.corner, index) + x * (u[0] * gather(self.lx, index))
        p += y * (u[1] * gather(self.ly, index))
        return p, gather(self.normal, index)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """Irradiance by the polygon's closed form; None where a light carries an image."""
        return irradiance(self, index, ref_p, ref_n) if self.plain else None

    def corners(self, index: Index, p: Floats) -> tuple[Floats, Floats]:
        x, y = gather(self.x * self.lx, index), gather(self.y * self.ly, index)
        return gather(self.corner, index) - p, np.stack([x, x + y, y], axis=1)

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> Mask:
        return self.emitters.emits(index, cos_light)

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        x, y, z = self.local(index, origin)
        normal = gather(self.normal, index)
        cos_light = -dot(wi, normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            dist = z / cos_light
            along_x = dist * dot(wi, gather(self.x, index)) - x
            along_y = dist * dot(wi, gather(self.y, index)) - y
            inside = (along_x >= 0) & (along_x <= gather(self.lx, index))
            inside &= (along_y >= 0) & (along_y <= gather(self.ly, index))
            hit = inside & (dist > 0) & self.emitters.emits(index, cos_light)
        return np.where(hit, dist, np.inf), cos_light

    def local(self, index: Index, p: Floats) -> tuple[Floats, Floats, Floats]:
        """The rectangle in the frame of points p (3, n): x0, y0 of its corner and height z over its emitting
        side, (n,) each.
        """
        d = gather(self.corner, index) - p
        return (
            dot(d, gather(self.x, index)),
            dot(d, gather(self.y, index)),
            -dot(d, gather(self.normal, index)),
        )


@dataclass(frozen=True, eq=False)
class RectangleSolidAngle:
    """Uniform in the solid angle of the rectangle: weights stay bounded however close it comes
    [urena2013].
    """

    lights: RectangleLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        x0, y0, z = li.local(index, ref_p)
        x1, y1 = x0 + gather(li.lx, index), y0 + gather(li.ly, index)
        omega = solid_angle(x0, x1, y0, y1, z)
        valid = omega > 0
        if not li.emitters.two_sided.all():
            valid &= li.emitters.emits(index, z)
        with np.errstate(invalid="ignore", divide="ignore"):
            x, y = invert(u, omega, x0, x1, y0, y1, z)
            dist = np.sqrt(x * x + y * y + z * z)
            scale = 1.0 / dist
            frame = (gather(li.x, index), gather(li.y, index), gather(li.normal, index))
            wi = combine(frame, x * scale, y * scale, -z * scale)
            pdf = 1.0 / omega
        return LightSample(wi, dist, frame[2], gather(li.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        li = self.lights
        x0, y0, z = li.local(index, ref_p)
        omega = solid_angle(x0, x0 + gather(li.lx, index), y0, y0 + gather(li.ly, index), z)
        hit = (li.intersect(index, ref_p, wi)[0] < np.inf) & (omega > 0)
        return np.where(hit, 1.0 / np.where(hit, omega, 1.0), 0.0)


def _patches(shape: ShapeDescription) -> Floats:
    """Corners (3, 4, q) of all patches of an emitting mesh; SceneError for a patch that is no rectangle."""
    mesh = shape.geometry
    assert isinstance(mesh, BilinearMesh)
    if not mesh.are_rectangles():
        raise SceneError(
            "an emitting bilinearmesh must be a rectangle with area; this patch is not", shape.where
        )
    return np.ascontiguousarray(mesh.vertices[mesh.faces].transpose(2, 1, 0))


def _turn(shape: ShapeDescription) -> float:
    return -1.0 if isinstance(shape.geometry, BilinearMesh) and shape.geometry.reverse else 1.0


def _examples() -> list[LightExample]:
    patch = BilinearMesh(
        np.array([[-1.0, 2.0, -0.5], [1.0, 2.0, -0.5], [-1.0, 2.0, 0.5], [1.0, 2.0, 0.5]]),
        np.array([[0, 1, 2, 3]]),
    )
    shape = ShapeDescription(patch, Diffuse(np.zeros(3)), Emission(np.array([3.0, 2.0, 1.0])))
    return [LightExample("a rectangle facing down", shape, *receivers(np.array([0.0, 2.0, 0.0]), 0.5))]


TECHNIQUES = ("area", "solid-angle", "projected-solid-angle")
LIGHTS.add("rectangle", LightKind(BilinearMesh, RectangleLights.make, "rectangles", TECHNIQUES, _examples))

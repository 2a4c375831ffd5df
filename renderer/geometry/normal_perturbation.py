"""Shading normals from normal maps and bump maps, as pbrt-v4's NormalMap() and BumpMap() compute them
[pharr2023, sec. 10.5.3 and 10.5.4].

The frame is that of the shading geometry: the normal on the surface's outside, dp/du and dp/dv. Under vertex
normals pbrt makes dp/du normal to the shading normal s. It then takes s x dp/du for dp/dv, whatever the
length of dp/dv; this code does the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.geometry.shading_normals import ShadingNormals
from renderer.geometry.uv import Coordinates
from renderer.math.vectors import Floats, cross, dot, normalize
from renderer.textures import Places, bilinear, evaluate
from scenes.arrays import Index
from scenes.description.normal_perturbation import BumpMap, NormalMap, NormalPerturbation
from scenes.description.shapes import ShapeDescription

STEP = 5e-4  # pbrt's in u and v where a ray has no differentials


@dataclass(frozen=True, eq=False)
class NormalPerturbations:
    """The normal maps and bump maps of a scene. all: by shape, or by the row that stands for a material of a
    mix.
    """

    all: tuple[tuple[int, NormalPerturbation], ...]
    coordinates: Coordinates
    smooth: ShadingNormals | None

    def at(
        self,
        p: Floats,
        n: Floats,
        uv: Floats,
        shape: Index,
        face: tuple[Index, Index],
        flat: Floats,
    ) -> Floats:
        """Unit shading normals (3, n) at points p (3, n) of shapes (n,).

        n: (3, n) shading normals on the outside. uv: (2, n). face: triangle and primitive of each point.
        flat: (3, n) geometric normals, which textures look at.
        """
        out = n.copy()
        for number, own in self.all:
            rows = np.flatnonzero(shape == number)
            if not rows.size:
                continue
            at = Places(uv.take(rows, axis=1), p.take(rows, axis=1), flat.take(rows, axis=1))
            frame = Frame.at(self, at.p, n.take(rows, axis=1), (face[0][rows], face[1][rows]))
            if isinstance(own, NormalMap):
                normal = _mapped(own, at.uv, frame)
            else:
                normal = _bumped(own, at, frame)
            out[:, rows] = np.where(np.isfinite(normal).all(axis=0), normal, frame.n)
        return out


@dataclass(frozen=True, eq=False)
class Frame:
    """dpdu, dpdv, n, dndu, dndv: (3, n), of the shading geometry."""

    dpdu: Floats
    dpdv: Floats
    n: Floats
    dndu: Floats
    dndv: Floats

    @classmethod
    def at(cls, normals: NormalPerturbations, p: Floats, n: Floats, face: tuple[Index, Index]) -> Frame:
        dpdu, dpdv, dndu, dndv = normals.coordinates.differentials(p, *face)
        if normals.smooth is not None:
            own, change_u, change_v = normals.smooth.differentials(dpdu, dpdv, *face)
            across = cross(n, dpdu)
            dpdu, dpdv = np.where(own, cross(across, n), dpdu), np.where(own, across, dpdv)
            dndu, dndv = np.where(own, change_u, dndu), np.where(own, change_v, dndv)
        return cls(dpdu, dpdv, n, dndu, dndv)


def _mapped(own: NormalMap, uv: Floats, frame: Frame) -> Floats:
    found = bilinear(own.image, np.stack([uv[0], 1.0 - uv[1]]), "repeat")
    local = normalize(2.0 * found - 1.0)
    x = normalize(frame.dpdu)
    return normalize(x * local[0] + cross(frame.n, x) * local[1] + frame.n * local[2])


def _bumped(own: BumpMap, at: Places, frame: Frame) -> Floats:
    steps = np.array([[0.0, 0.0], [STEP, 0.0], [0.0, STEP]])[:, :, None]
    shifts = (frame.dpdu * u + frame.dpdv * v for u, v in steps)
    places = (Places(at.uv + uv, at.p + shift, at.n) for uv, shift in zip(steps, shifts, strict=True))
    here, along, across = (evaluate(own.displacement, place)[0] for place in places)
    dpdu = frame.dpdu + frame.n * ((along - here) / STEP) + frame.dndu * here
    dpdv = frame.dpdv + frame.n * ((across - here) / STEP) + frame.dndv * here
    normal = normalize(cross(dpdu, dpdv))
    return np.where(dot(normal, frame.n) < 0, -normal, normal)


def normal_perturbations(
    shapes: Sequence[ShapeDescription], coordinates: Coordinates | None, smooth: ShadingNormals | None
) -> NormalPerturbations | None:
    """The normal maps and bump maps of shapes; None for a scene without any."""
    all_ = tuple((i, s.perturbation) for i, s in enumerate(shapes) if s.perturbation is not None)
    if not all_ or coordinates is None:
        return None
    return NormalPerturbations(all_, coordinates, smooth)

"""Trowbridge and Reitz's microfacets, seen from the side of the normal, and the Fresnel equations of glass.

With mu the cosine of a direction with the normal n and q(mu) = sqrt(mu^2 + alpha^2 (1 - mu^2)):

    D  = alpha^2 / (pi cos^4(m) (alpha^2 + tan^2(m))^2)          [walter2007, eq. 33]
    G  = 2 mu_o mu_i / (mu_i q(mu_o) + mu_o q(mu_i))             height-correlated masking [heitz2014, eq. 99]
    D_o = 2 D |wo.m| / (mu_o + q(mu_o))                          density of the normals m that wo sees

Anisotropic microfacets have an alpha along dp/du and one across it [pharr2023, sec. 9.6.1]. With x, y, z
the parts of a unit vector along, across and up, q^2 = z^2 + (alpha_u x)^2 + (alpha_v y)^2 and
D = 1 / (pi alpha_u alpha_v (z^2 + (x / alpha_u)^2 + (y / alpha_v)^2)^2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats, combine, cross, dot, frame_about, gather
from renderer.records import SurfaceHit
from renderer.textures import Places, evaluate
from scenes.description.materials import Microfacets, Roughness
from scenes.description.shapes import ShapeDescription

TINY = np.finfo(np.float64).tiny


def projected(cosine: Floats, alpha: Floats) -> Floats:
    """q(mu): the cosine of the direction after the stretch that makes microfacets a hemisphere.
    cosine: (n,).
    """
    return np.sqrt(cosine * cosine + alpha * alpha * ((1.0 - cosine) * (1.0 + cosine)))


def distribution(n: Floats, m: Floats, alpha: Floats) -> Floats:
    """D (n,) in 1/sr at microfacet normals m (3, n) of any length. The sine comes from the part of m across
    n.
    """
    return _distribution(n, m, alpha)[0]


def _distribution(n: Floats, m: Floats, alpha: Floats) -> tuple[Floats, Floats]:
    """D and the squared length of m, (n,) each."""
    along = dot(n, m)
    across = m - n * along
    cosine2, sine2 = along * along, dot(across, across)
    root = alpha * (cosine2 + sine2) / np.maximum(alpha * alpha * cosine2 + sine2, TINY)
    return root * root * (1 / np.pi), cosine2 + sine2


def visible_normal(n: Floats, wo: Floats, alpha: Floats, u: Floats) -> Floats:
    """A microfacet normal (3, n) with the density D_o, not of unit length. wo: (3, n). u: (2, n) in [0, 1).

    Stretched by alpha the microfacets are a hemisphere, which reflects parallel light uniformly into a cap
    about it: a direction c in the cap (z > -w.z) and c + w is the normal [dupuy2023, sec. 3].
    """
    mu_o = np.maximum(dot(wo, n), 0.0)
    scale = 1 / np.maximum(projected(mu_o, alpha), TINY)  # of a smooth surface seen along it, 0
    z = mu_o * scale
    # c.z = height - z; so written, neither c.z + w.z nor 1 - c.z^2 loses digits at grazing angles.
    height = (1.0 - u[1]) * (1.0 + z)
    sine = alpha * np.sqrt(u[1] * (1.0 + z) * (height + (1.0 - z)))
    phi = (2 * np.pi) * u[0]
    # w = scale (alpha wo + (1 - alpha) mu_o n): its part along the surface is wo's, n gives the rest.
    pull = alpha * alpha * scale
    normal = combine(frame_about(n), sine * np.cos(phi), sine * np.sin(phi), height - pull * mu_o)
    normal += wo * pull
    return normal


@dataclass(frozen=True, eq=False)
class Facets:
    """The microfacets of points. n: (3, n) normals. alpha: (n,) or (1,), along x for anisotropic ones. axes:
    x along dp/du and y across it, (3, n) unit, with alpha_v (n,) or (1,); None for isotropic ones.
    """

    n: Floats
    alpha: Floats
    axes: tuple[Floats, Floats, Floats] | None

    @classmethod
    def at(
        cls,
        hit: SurfaceHit,
        alpha: Floats,
        alpha_v: Floats | None,
        varying: tuple[tuple[int, Roughness], ...] = (),
    ) -> Facets:
        """The microfacets of points. alpha, alpha_v: (s,) of shapes; alpha_v None where all are isotropic.
        varying: by shape, the textures that give alpha instead.

        Without a tangent, x is chosen by the normal alone, as pbrt does.
        """
        along, across = gather(alpha, hit.shape), None if alpha_v is None else gather(alpha_v, hit.shape)
        if varying:
            along, across = varying_alphas(hit, along, across, varying)
        if across is None:
            return cls(hit.ns, along, None)
        x = hit.tangent - hit.ns * dot(hit.ns, hit.tangent)
        square = dot(x, x)
        with np.errstate(invalid="ignore", divide="ignore"):
            x = np.where(square > 0, x / np.sqrt(square), frame_about(hit.ns)[0])
        return cls(hit.ns, along, (x, cross(hit.ns, x), across))

    def projected(self, w: Floats, cosine: Floats) -> Floats:
        """q (n,) of directions w (3, n), whose cosine with n is given."""
        if self.axes is None:
            return projected(cosine, self.alpha)
        x, y, alpha_v = self.axes
        along, across = self.alpha * dot(w, x), alpha_v * dot(w, y)
        return np.sqrt(cosine * cosine + (along * along + across * across))

    def distribution(self, m: Floats) -> tuple[Floats, Floats]:
        """D (n,) in 1/sr at microfacet normals m (3, n) of any length, and their squared lengths (n,)."""
        if self.axes is None:
            return _distribution(self.n, m, self.alpha)
        x, y, alpha_v = self.axes
        flat_x, flat_y, up = dot(m, x), dot(m, y), dot(m, self.n)
        both = self.alpha * alpha_v
        square = flat_x * flat_x + flat_y * flat_y + up * up
        spread = (alpha_v * flat_x) ** 2 + (self.alpha * flat_y) ** 2 + (both * up) ** 2
        root = square * both / np.maximum(spread, TINY)
        return root * root * (both / np.pi), square

    def visible_normal(self, wo: Floats, u: Floats) -> Floats:
        """Microfacet normals (3, n) that wo sees; see the function `visible_normal`."""
        if self.axes is None:
            return visible_normal(self.n, wo, self.alpha, u)
        x, y, alpha_v = self.axes
        mu_o = np.maximum(dot(wo, self.n), 0.0)
        scale = 1 / np.maximum(self.projected(wo, mu_o), TINY)
        z = mu_o * scale
        height = (1.0 - u[1]) * (1.0 + z)
        sine = np.sqrt(u[1] * (1.0 + z) * (height + (1.0 - z)))
        phi = (2 * np.pi) * u[0]
        along = self.alpha * (sine * np.cos(phi) + scale * self.alpha * dot(wo, x))
        across = alpha_v * (sine * np.sin(phi) + scale * alpha_v * dot(wo, y))
        return combine((x, y, self.n), along, across, height)


def varying_alphas(
    hit: SurfaceHit, along: Floats, across: Floats | None, varying: tuple[tuple[int, Roughness], ...]
) -> tuple[Floats, Floats | None]:
    """The alphas (n,), from textures where shapes have them."""
    along = np.broadcast_to(along, hit.shape.shape).copy()
    across = None if across is None else np.broadcast_to(across, hit.shape.shape).copy()
    for shape, roughness in varying:
        rows = np.flatnonzero(hit.shape == shape)
        if not rows.size:
            continue
        at = Places.of(hit, rows)
        along[rows] = roughness.alpha(evaluate(roughness.u, at)[0])
        if across is not None:
            both = roughness.v is None
            across[rows] = along[rows] if both else roughness.alpha(evaluate(roughness.v, at)[0])
    return along, across


def textured_roughness(
    shapes: Sequence[ShapeDescription], kind: type[Microfacets]
) -> tuple[tuple[int, Roughness], ...]:
    """The textured roughness of shapes whose material is of this kind, by the number of the shape."""
    return tuple(
        (i, s.material.varying)
        for i, s in enumerate(shapes)
        if isinstance(s.material, kind) and s.material.varying is not None
    )


def alphas_across(alpha: Floats, alpha_v: list[float | None]) -> Floats | None:
    """(s,) the alphas across dp/du of shapes; alpha (s,) where none is given. None if all are isotropic."""
    if all(one is None for one in alpha_v):
        return None
    return np.array([a if v is None else v for a, v in zip(alpha, alpha_v, strict=True)])


def fresnel_dielectric(cosine: Floats, eta: Floats) -> tuple[Floats, Floats]:
    """Reflectance (n,) of a smooth boundary, and the cosine (n,) of refraction, 0 under total reflection
    [pharr2023, sec. 9.3.5].

    cosine: (n,) in [0, 1], of the incident direction. eta: (n,), the index behind the boundary over that
    before it.
    """
    # cos^2 behind the boundary, written so that it keeps its digits where both sides are nearly alike.
    squared = (cosine * cosine + (eta - 1.0) * (eta + 1.0)) / (eta * eta)
    refracted = np.sqrt(np.maximum(squared, 0.0))
    parallel = _contrast(eta * cosine, refracted)
    across = _contrast(cosine, eta * refracted)
    return (parallel * parallel + across * across) / 2, refracted


def _contrast(a: Floats, b: Floats) -> Floats:
    """(a - b) / (a + b) of numbers that are not negative; 1 where both are 0."""
    return np.where(a + b > 0, (a - b) / np.maximum(a + b, TINY), 1.0)

"""Glass, smooth or rough, a boundary or a thin pane, as pbrt's `dielectric` and `thindielectric`.

A boundary reflects the share F and refracts the rest [pharr2023, sec. 9.5]. Radiance that is refracted is
divided by eta^2, eta being the index behind the boundary over that on the side of wo, since its solid angle
shrinks. With h = eta wi + wo, the microfacet normal m along it and the cosines of wi and wo with m, the rough
boundary's [walter2007, eq. 21], eta^2 divided out,

    f   = 2 (1 - F) D |wi.m| |wo.m| / ((mu_i q(mu_o) + mu_o q(mu_i)) |h|^2)
    pdf = 2 D |wo.m| |wi.m| eta^2 / ((mu_o + q(mu_o)) |h|^2)

A pane's reflections between its two sides add up to R = 2 F / (1 + F); what it transmits goes straight on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample
from renderer.math.vectors import Floats, dot, gather, normalize
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.microfacets import (
    TINY,
    Facets,
    alphas_across,
    fresnel_dielectric,
    textured_roughness,
)
from scenes.description.materials import Dielectric, Roughness
from scenes.description.shapes import ShapeDescription, Sphere

BITS = 2.0**16


@dataclass(frozen=True, eq=False)
class DielectricMaterials:
    """Glass by shape.

    glass, eta, alpha, thin: (s,). `glass` is 1 for glass, 0 for other materials; alpha 0 is smooth. alpha_v:
    (s,) across dp/du, None if all are isotropic. varying: by shape, the textures that give alpha instead.
    """

    glass: Floats
    eta: Floats
    alpha: Floats
    thin: Floats
    alpha_v: Floats | None
    varying: tuple[tuple[int, Roughness], ...] = ()

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is Dielectric

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        assert isinstance(shape.material, Dielectric)
        sides = Lobes.REFLECTION | Lobes.TRANSMISSION
        return sides | (Lobes.GLOSSY if shape.material.alpha else Lobes.SPECULAR)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> DielectricMaterials:
        none = Dielectric(1.0, 0.0)
        rows = [s.material if isinstance(s.material, Dielectric) else none for s in shapes]
        alpha = np.array([r.alpha for r in rows])
        return cls(
            np.array([float(cls.accepts(s)) for s in shapes]),
            np.array([r.eta for r in rows]),
            alpha,
            np.array([float(r.thin) for r in rows]),
            alphas_across(alpha, [r.alpha_v for r in rows]),
            textured_roughness(shapes, Dielectric),
        )

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        facets, eta = self._rough(hit)
        mu_o, mu_i = _cosine(hit), dot(wi, hit.ns)
        h, wo_m, wi_m = _half(hit, wi, eta)
        f, _ = fresnel_dielectric(np.clip(wo_m, 0.0, 1.0), eta)
        lobe = gather(self.glass, hit.shape) * (facets.alpha > 0) * facets.distribution(h)[0]
        across = np.abs(mu_i)
        between = across * facets.projected(hit.wo, mu_o) + mu_o * facets.projected(wi, across)
        lobe /= np.maximum(between, TINY)
        refracted = 2 * (1.0 - f) * wo_m * np.abs(wi_m) / np.maximum(dot(h, h), TINY)
        seen = (wo_m > 0) & (wi_m * mu_i > 0)
        return np.broadcast_to(np.where(seen, lobe * np.where(mu_i > 0, f / 2, refracted), 0.0), wi.shape)

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        facets, eta = self._rough(hit)
        mu_o, mu_i = _cosine(hit), dot(wi, hit.ns)
        h, wo_m, wi_m = _half(hit, wi, eta)
        f, _ = fresnel_dielectric(np.clip(wo_m, 0.0, 1.0), eta)
        visible = gather(self.glass, hit.shape) * (facets.alpha > 0) * facets.distribution(h)[0]
        visible *= 2 / (mu_o + facets.projected(hit.wo, mu_o))
        refracted = wo_m * np.abs(wi_m) * (eta * eta / np.maximum(dot(h, h), TINY))
        chance = np.where(mu_i > 0, f / 4, (1.0 - f) * refracted)
        return np.where((wo_m > 0) & (wi_m * mu_i > 0), visible * chance, 0.0)

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        facets, eta = self._rough(hit)
        delta = facets.alpha == 0
        if not delta.any():
            return self._rough_sample(hit, u, facets, eta)
        smooth = self._smooth_sample(hit, u)
        if delta.all():
            return smooth
        rough = self._rough_sample(hit, u, replace(facets, alpha=np.maximum(facets.alpha, TINY)), eta)
        return BSDFSample(
            np.where(delta, smooth.wi, rough.wi),
            np.where(delta, smooth.value, rough.value),
            np.where(delta, smooth.pdf, rough.pdf),
            np.broadcast_to(delta, smooth.pdf.shape),
        )

    def _rough_sample(self, hit: SurfaceHit, u: Floats, facets: Facets, eta: Floats) -> BSDFSample:
        """A microfacet that wo sees, and either of its two directions; pdf 0 where that lies on the wrong
        side.

        The later bits of u[0] choose between the two. Its first bits turn the microfacet, so that the choice
        moves it by 2^-16 of a circle at most.
        """
        m = normalize(facets.visible_normal(hit.wo, u))
        wo_m = dot(hit.wo, m)
        f, refracted = fresnel_dielectric(np.clip(wo_m, 0.0, 1.0), eta)
        mirrored = u[0] * BITS % 1.0 < f
        wi = np.where(mirrored, 2 * wo_m * m - hit.wo, (wo_m / eta - refracted) * m - hit.wo / eta)
        side = (dot(wi, hit.ns) > 0) == mirrored
        return BSDFSample(wi, self.evaluate(hit, wi), np.where(side, self.pdf(hit, wi), 0.0))

    def _smooth_sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Reflection or refraction, chosen by the share of the light that goes there."""
        mu_o, thin = _cosine(hit), gather(self.thin, hit.shape) > 0
        eta = np.where(thin, gather(self.eta, hit.shape), self._eta(hit))
        f, refracted = fresnel_dielectric(mu_o, eta)
        f = np.where(thin, 2 * f / (1.0 + f), f)
        behind = np.where(thin, mu_o, refracted)
        bend = np.where(thin, 1.0, eta)
        mirrored = u[0] < f
        through = (mu_o / bend - behind) * hit.ns - hit.wo / bend
        wi = np.where(mirrored, 2 * mu_o * hit.ns - hit.wo, through)
        pdf = np.where(mirrored, f, 1.0 - f) * gather(self.glass, hit.shape)
        # Radiance is divided by eta^2 where it is refracted into another medium.
        cosine = np.where(mirrored, mu_o, behind * (bend * bend))
        value = np.broadcast_to(pdf / np.maximum(cosine, TINY), wi.shape)
        return BSDFSample(wi, value, pdf, np.ones(pdf.shape, dtype=np.bool_))

    def _eta(self, hit: SurfaceHit) -> Floats:
        """(n,): the index on the far side of the boundary over the index on the side of wo."""
        eta = gather(self.eta, hit.shape)
        return np.where(hit.front, eta, 1 / eta)

    def _rough(self, hit: SurfaceHit) -> tuple[Facets, Floats]:
        return Facets.at(hit, self.alpha, self.alpha_v, self.varying), self._eta(hit)

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        ball = Sphere(np.zeros(3), 1.0)
        kinds = [
            ("frosted glass", Dielectric(1.5, 0.3)),
            ("polished glass", Dielectric(1.5, 0.02)),
            ("brushed glass", Dielectric(1.5, 0.4, alpha_v=0.1)),
            ("a rough bubble", Dielectric(1 / 1.33, 0.5)),
        ]
        return [MaterialExample(name, ShapeDescription(ball, glass)) for name, glass in kinds]


def _cosine(hit: SurfaceHit) -> Floats:
    return np.clip(dot(hit.wo, hit.ns), 0.0, 1.0)


def _half(hit: SurfaceHit, wi: Floats, eta: Floats) -> tuple[Floats, Floats, Floats]:
    """h (3, n), and the cosines (n,) of wo and wi with the microfacet normal along it, on the side of n.

    The half vector of reflection is wi + wo, that of refraction eta wi + wo [walter2007, eq. 13 and 16].
    """
    h = wi * np.where(dot(wi, hit.ns) > 0, 1.0, eta) + hit.wo
    with np.errstate(invalid="ignore", divide="ignore"):
        m = h / np.sqrt(dot(h, h))
        m = np.where(dot(m, hit.ns) < 0, -m, m)
        return h, dot(hit.wo, m), dot(wi, m)


MATERIALS.add("dielectric", DielectricMaterials)

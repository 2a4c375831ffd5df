"""Rough metal: a surface of microscopic mirrors, the same from both sides, as pbrt's `conductor`.

With the half vector h = wo + wi, and D, G and q of `renderer.shading.microfacets`, 1 + 2 Lambda = q(mu) / mu:

    G  = 2 mu_o mu_i / (mu_i q(mu_o) + mu_o q(mu_i))
    f  = F D G / (4 mu_o mu_i) = F D / (2 (mu_i q(mu_o) + mu_o q(mu_i)))
    pdf of wi, its half vector being a normal seen from wo = D / (2 (mu_o + q(mu_o)))

so that no cosine is divided by, and f cos / pdf is at most F. The sine of h is the length of what it has
along the surface and the cosine of wo with h is |h|/2: at alpha = 1e-3 the lobe is a thousandth wide, where 1
- cos^2 would leave nine digits and less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample
from renderer.math.vectors import Floats, dot, gather
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.microfacets import TINY, Facets, alphas_across, textured_roughness
from scenes.description.materials import Conductor, Roughness
from scenes.description.shapes import ShapeDescription, Sphere


@dataclass(frozen=True, eq=False)
class ConductorMaterials:
    """Metals by shape.

    alpha, metal: (s,); `metal` is 1 for metals, 0 for other materials. difference, product: (3, s), eta^2 -
    k^2 and 2 eta k. alpha_v: (s,) across dp/du, None if all are isotropic. varying: by shape, the textures
    that give alpha instead.
    """

    alpha: Floats
    metal: Floats
    difference: Floats
    product: Floats
    alpha_v: Floats | None
    varying: tuple[tuple[int, Roughness], ...] = ()

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is Conductor

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        """The lobes of a metal; none where eta = 1 and k = 0, which is no surface at all."""
        metal = shape.material
        assert isinstance(metal, Conductor)
        if ((metal.eta == 1) & (metal.k == 0)).all():
            return Lobes.NONE
        return Lobes.REFLECTION | (Lobes.GLOSSY if metal.alpha else Lobes.SPECULAR)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> ConductorMaterials:
        none = Conductor(np.ones(3), np.zeros(3), 1.0)
        rows = [s.material if type(s.material) is Conductor else none for s in shapes]
        eta, k = (np.stack(part, axis=1) for part in ([r.eta for r in rows], [r.k for r in rows]))
        metal = np.array([float(cls.accepts(s)) for s in shapes])
        alpha = np.array([r.alpha for r in rows])
        across = alphas_across(alpha, [r.alpha_v for r in rows])
        varying = textured_roughness(shapes, Conductor)
        return cls(alpha, metal, (eta - k) * (eta + k), 2 * eta * k, across, varying)

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        mu_o, mu_i = np.maximum(dot(hit.wo, hit.ns), 0.0), np.maximum(dot(wi, hit.ns), 0.0)
        facets = Facets.at(hit, self.alpha, self.alpha_v, self.varying)
        distribution, h2 = facets.distribution(hit.wo + wi)
        # 0 where both directions graze: the numerator is 0 there already.
        between = mu_i * facets.projected(hit.wo, mu_o) + mu_o * facets.projected(wi, mu_i)
        rough = (mu_i > 0) & (facets.alpha > 0)
        lobe = gather(self.metal, hit.shape) * rough * distribution / (2 * np.maximum(between, TINY))
        cosine = np.minimum(0.5 * np.sqrt(h2), 1.0)
        return fresnel(cosine, gather(self.difference, hit.shape), gather(self.product, hit.shape)) * lobe

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """wo mirrored at a normal that it sees; pdf 0 where that leads below the horizon."""
        mirror = gather(self.alpha, hit.shape) == 0
        if mirror.all():
            return self._mirrored(hit)
        normal = Facets.at(hit, self.alpha, self.alpha_v, self.varying).visible_normal(hit.wo, u)
        wi = normal * (2 * dot(hit.wo, normal) / dot(normal, normal))
        wi -= hit.wo
        rough = BSDFSample(wi, self.evaluate(hit, wi), self.pdf(hit, wi))
        if not mirror.any():
            return rough
        smooth = self._mirrored(hit)
        return BSDFSample(
            np.where(mirror, smooth.wi, rough.wi),
            np.where(mirror, smooth.value, rough.value),
            np.where(mirror, smooth.pdf, rough.pdf),
            np.broadcast_to(mirror, rough.pdf.shape),
        )

    def _mirrored(self, hit: SurfaceHit) -> BSDFSample:
        """The one direction of mirrors, where f |cos| / pdf is the reflectance."""
        mu_o = np.clip(dot(hit.wo, hit.ns), 0.0, 1.0)
        reflected = fresnel(mu_o, gather(self.difference, hit.shape), gather(self.product, hit.shape))
        return BSDFSample(
            2 * mu_o * hit.ns - hit.wo,
            reflected / np.maximum(mu_o, TINY),
            np.broadcast_to(gather(self.metal, hit.shape), mu_o.shape),
            np.ones(mu_o.shape, dtype=np.bool_),
        )

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        mu_o = np.maximum(dot(hit.wo, hit.ns), 0.0)
        facets = Facets.at(hit, self.alpha, self.alpha_v, self.varying)
        distribution, _ = facets.distribution(hit.wo + wi)
        seen = np.maximum(2 * (mu_o + facets.projected(hit.wo, mu_o)), TINY)
        return (dot(wi, hit.ns) > 0) * distribution / seen

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        copper = np.array([0.21, 0.98, 1.2]), np.array([4.2, 2.6, 2.4])
        perfect = np.full(3, 1e-3), np.full(3, 1e3)
        kinds: list[tuple[str, tuple[Floats, Floats], float, float | None]] = [
            ("polished copper", copper, 1e-3, None),
            ("satin copper", copper, 0.1, None),
            ("rough copper", copper, 0.5, None),
            ("sandy copper", copper, 1.0, None),
            ("brushed copper", copper, 0.3, 0.05),
            ("a rough perfect mirror", perfect, 0.3, None),
            ("a brushed perfect mirror", perfect, 0.1, 0.6),
        ]
        ball = Sphere(np.zeros(3), 1.0)
        return [
            MaterialExample(name, ShapeDescription(ball, Conductor(eta, k, alpha, alpha_v)))
            for name, (eta, k), alpha, alpha_v in kinds
        ]


def fresnel(cosine: Floats, difference: Floats, product: Floats) -> Floats:
    """Unpolarised Fresnel reflectance of a conductor in air [pharr2023, sec. 9.3.6], in [0, 1].

    cosine: (n,) of the angle to the normal, in [0, 1]. difference, product: (3, n) or (3, 1), eta^2 - k^2 and
    2 eta k. Returns (3, n).

    With the refracted wave's a + i b = sqrt(eta^2 - k^2 - sin^2 + 2 i eta k), c = a^2 + b^2 and t = 2 a cos,
    the two polarisations' R_s = (c + cos^2 - t) / (c + cos^2 + t) and R_p = R_s (p - t sin^2) / (p + t
    sin^2), p = c cos^2 + sin^4, have the mean R_s p / (p + t sin^2). a^2 = (c + eta^2 - k^2 - sin^2) / 2
    cancels where k is large, by 2^-53 c at most: 2^-53 / a of the reflectance, which counts for no eta above
    1e-8.
    """
    mu2 = cosine * cosine
    s2 = (1.0 - cosine) * (1.0 + cosine)
    real = difference - s2
    c = np.sqrt(real * real + product * product)
    real += c
    t = np.sqrt(np.maximum(real, 0.0) * (2 * mu2))
    p = c * mu2
    p += s2 * s2
    c += mu2
    below = c + t
    below *= t * s2 + p
    c -= t
    c *= p
    # 0 / 0 only for a surface without contrast, seen edge-on.
    c /= np.maximum(below, TINY)
    return np.maximum(c, 0.0, out=c)


MATERIALS.add("conductor", ConductorMaterials)

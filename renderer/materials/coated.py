"""Surfaces under a layer of varnish, as pbrt's `coateddiffuse` and `coatedconductor`.

f is what the coat reflects, in closed form, and the mean of random walks between the coat and the base, which
are in `renderer.shading.layered_walk`.

Directions are sampled by closed forms: the coat's lobe, the lobe of a metal base seen through a flat coat,
and the cosine. Their mixture's density is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample, MaterialKind, material_kind
from renderer.math.hashing import hash_vectors
from renderer.math.vectors import Floats, combine, dot, frame_about, gather
from renderer.math.warp import cosine_hemisphere
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.layered_walk import THINNEST, Coat, Layer, Layers, Walks, X, Z, transmittance
from renderer.shading.microfacets import TINY, Facets, alphas_across, fresnel_dielectric
from scenes.arrays import Index, Mask
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, is_oriented
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Texture, mean


@dataclass(frozen=True, eq=False)
class CoatedMaterials(Layers):
    """Varnished surfaces by shape; rows of other kinds are 0.

    coated: (s,) whether a shape is one. bases: the kinds of the bases, made of all shapes. base_of: (s,) the
    kind of each shape's base among them. base_alpha: (s,) of the lobe that a metal base shows through the
    coat, NaN for other bases. base_albedo: (s,) about how much the base reflects. oriented: whether dp/du
    matters anywhere.
    """

    coated: Mask
    bases: tuple[MaterialKind, ...]
    base_of: Index
    base_alpha: Floats
    base_albedo: Floats
    oriented: bool

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is Coated

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        assert isinstance(shape.material, Coated)
        coat = shape.material.coat
        return Lobes.REFLECTION | Lobes.GLOSSY | (Lobes.NONE if coat.alpha else Lobes.SPECULAR)

    @classmethod
    def make(cls, shapes: Sequence[ShapeDescription]) -> CoatedMaterials:
        none = Coated(Dielectric(1.0, 0.0), Diffuse(np.zeros(3)))
        rows = [s.material if isinstance(s.material, Coated) else none for s in shapes]
        bare = [replace(s, material=r.base.beneath(r.coat.eta)) for s, r in zip(shapes, rows, strict=True)]
        kinds = [material_kind(s) for s in bare]
        used = list(dict.fromkeys(kind for kind, s in zip(kinds, shapes, strict=True) if cls.accepts(s)))
        eta = np.array([r.coat.eta for r in rows])
        rough = np.array([r.coat.alpha for r in rows])
        alpha = np.where(eta == 1, 0.0, rough)
        broad = np.array([r.coat.mean_alpha for r in rows]) * (1 - 1 / eta)
        metal = np.array([np.nan if r.base.mean_alpha is None else r.base.mean_alpha for r in rows])
        return cls(
            coated=np.array([cls.accepts(s) for s in shapes], dtype=np.bool_),
            eta=eta,
            alpha=alpha,
            alpha_v=alphas_across(alpha, [r.coat.alpha_v if r.coat.eta != 1 else None for r in rows]),
            glossy=rough > 0,
            thickness=np.array([max(_number(r.thickness), THINNEST) for r in rows]),
            albedo=np.stack([mean(r.albedo) for r in rows], axis=1),
            g=np.array([_number(r.g) for r in rows]),
            max_depth=np.array([r.max_depth for r in rows], dtype=np.int64),
            samples=np.array([r.samples for r in rows], dtype=np.int64),
            bases=tuple(kind.make(bare) for kind in used),
            base_of=np.array([used.index(kind) if kind in used else 0 for kind in kinds], dtype=np.int64),
            mirror=np.array(
                [bool(kind.lobes(s) & Lobes.SPECULAR) for kind, s in zip(kinds, bare, strict=True)],
                dtype=np.bool_,
            ),
            base_alpha=np.hypot(metal, broad),
            base_albedo=np.array([float(r.base.normal_reflectance.mean()) for r in rows]),
            oriented=any(is_oriented(r) for r in rows),
            varying=tuple(
                (i, r.coat.varying)
                for i, r in enumerate(rows)
                if r.coat.varying is not None and r.coat.eta != 1
            ),
            layers=tuple((i, r) for i, r in enumerate(rows) if r.has_textured_layer),
        )

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        out = np.zeros_like(wi)
        rows = np.flatnonzero(self.coated[hit.shape] & (dot(wi, hit.ns) > 0) & (dot(hit.wo, hit.ns) > 0))
        if rows.size == 0:
            return out
        some, wi = hit.take(rows), wi.take(rows, axis=1)
        frame = self._frame(some)
        walks = Walks(self, some, _into(frame, some.wo), _into(frame, wi), hash_vectors(some.p, some.wo, wi))
        out[:, rows] = walks.mean() + walks.coat.reflected(walks.wo, walks.wi)
        return out

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        frame = self._frame(hit)
        wo, wi = _into(frame, hit.wo), _into(frame, wi)
        lobes = _Lobes.at(self, hit, wo)
        up = (wi[2] > 0) & (wo[2] > 0) & self.coated[hit.shape]
        return np.where(up, lobes.pdf(wo, wi), 0.0)

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """A direction of one of the lobes. A smooth coat's lobe is the mirror's direction, with all the light
        that goes there.
        """
        frame = self._frame(hit)
        wo = _into(frame, hit.wo)
        lobes = _Lobes.at(self, hit, wo)
        wi, mirrored = lobes.sample(wo, u)
        wi = combine(frame, *wi)
        if not mirrored.any():
            return BSDFSample(wi, self.evaluate(hit, wi), self.pdf(hit, wi))
        value, pdf = np.zeros_like(wi), np.zeros_like(u[0])
        rows = np.flatnonzero(~mirrored)
        some, along = hit.take(rows), wi.take(rows, axis=1)
        value[:, rows], pdf[rows] = self.evaluate(some, along), self.pdf(some, along)
        delta = self._delta_lobe(hit, wo, lobes, mirrored)
        wi, value = np.where(mirrored, delta.wi, wi), np.where(mirrored, delta.value, value)
        return BSDFSample(wi, value, np.where(mirrored, delta.pdf, pdf), mirrored)

    def sample_delta_lobes(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        wo = _into(self._frame(hit), hit.wo)
        lobes = _Lobes.at(self, hit, wo)
        return self._delta_lobe(hit, wo, lobes, lobes.delta & (u[0] < lobes.first))

    def _delta_lobe(self, hit: SurfaceHit, wo: Floats, lobes: _Lobes, chosen: Mask) -> BSDFSample:
        """The mirror's direction; pdf 0 where its lobe is not the chosen one (n,)."""
        wi = 2 * dot(hit.wo, hit.ns) * hit.ns - hit.wo
        # f |cos| / pdf is the delta lobe's share of the light, over the chance of choosing it.
        value = self._mirrored(hit, wo) / np.maximum(wo[2], TINY)
        return BSDFSample(wi, value, np.where(chosen, lobes.first * self.coated[hit.shape], 0.0), chosen)

    def _frame(self, hit: SurfaceHit) -> tuple[Floats, Floats, Floats]:
        if not self.oriented:
            return frame_about(hit.ns)
        axes = Facets.at(hit, self.alpha, self.alpha if self.alpha_v is None else self.alpha_v).axes
        assert axes is not None
        return (axes[0], axes[1], hit.ns)

    def _mirrored(self, hit: SurfaceHit, wo: Floats) -> Floats:
        """Reflectance (3, n) of the delta lobe: of the coat, and of what a mirror under it sends back up."""
        shape = hit.shape
        eta = gather(self.eta, shape)
        reflected, inside = fresnel_dielectric(np.minimum(wo[2], 1.0), eta)
        out = np.repeat(reflected[None], 3, axis=0)
        rows = np.flatnonzero(self.mirror[shape] & (inside > 0))
        if rows.size == 0:
            return out
        own, cosine, once = shape[rows], inside[rows], 1.0 - reflected[rows]
        down = np.stack([np.sqrt(1.0 - cosine * cosine), np.zeros_like(cosine), cosine])
        some = hit.take(rows)
        sample = self.sample_base(self.base_hit(some, down), np.zeros((2, rows.size)))
        base = sample.value * cosine / sample.pdf
        crossed = transmittance(Layer.at(self, some).thickness, cosine) ** 2
        light = once * once * crossed * base
        for bounce in range(int(self.max_depth[own].max() // 2)):
            out[:, rows] += np.where(bounce < self.max_depth[own] // 2, light, 0.0)
            light = light * (reflected[rows] * crossed * base)
        return out

    def base_hit(self, hit: SurfaceHit, wo: Floats) -> SurfaceHit:
        """Points of bases under points of coats, seen along wo (3, n) in local coordinates. Textures look at
        the point, and at the geometric normal, of the coat.
        """
        x, z = (np.repeat(axis, hit.shape.size, axis=1) for axis in (X, Z))
        return replace(hit, wo=wo, tangent=x, shading_n=z)

    def base_value(self, hit: SurfaceHit, wi: Floats) -> tuple[Floats, Floats]:
        """f (3, n) and pdf (n,) of the bases."""
        if len(self.bases) == 1:
            return self.bases[0].evaluate(hit, wi), self.bases[0].pdf(hit, wi)
        value, pdf = np.zeros_like(wi), np.zeros(wi.shape[1])
        for i, base in enumerate(self.bases):
            rows = np.flatnonzero(self.base_of[hit.shape] == i)
            some, along = hit.take(rows), wi.take(rows, axis=1)
            value[:, rows], pdf[rows] = base.evaluate(some, along), base.pdf(some, along)
        return value, pdf

    def sample_base(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Directions as the bases would have them."""
        if len(self.bases) == 1:
            return self.bases[0].sample(hit, u)
        wi, value, pdf = np.zeros_like(hit.wo), np.zeros_like(hit.wo), np.zeros_like(u[0])
        for i, base in enumerate(self.bases):
            rows = np.flatnonzero(self.base_of[hit.shape] == i)
            part = base.sample(hit.take(rows), u.take(rows, axis=1))
            wi[:, rows], value[:, rows], pdf[rows] = part.wi, part.value, part.pdf
        return BSDFSample(wi, value, pdf)

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        ball = Sphere(np.zeros(3), 1.0)
        wall = Diffuse(np.array([0.8, 0.5, 0.1]))
        copper = np.array([0.21, 0.98, 1.2]), np.array([4.2, 2.6, 2.4])
        milky = Coated(Dielectric(1.6, 0.4, alpha_v=0.1), wall, 0.5, np.array([0.9, 0.5, 0.1]), 0.4, 4)
        kinds = [
            ("varnished wood", Coated(Dielectric(1.5, 0.2), wall, max_depth=3)),
            ("brushed milky varnish", milky),
            ("varnished copper", Coated(Dielectric(1.5, 0.1), Conductor(*copper, 0.4), max_depth=3)),
        ]
        return [MaterialExample(name, ShapeDescription(ball, coated), True) for name, coated in kinds]


def _number(part: float | Texture) -> float:
    return part if isinstance(part, float | int) else float(mean(part)[0])


@dataclass(frozen=True, eq=False)
class _Lobes:
    """The lobes that directions of n points are drawn from. first, second: (n,) the chances of the lobes of
    coat and base, the cosine having the rest. delta: (n,) whether the coat's lobe is one.
    """

    coat: Coat
    base: Facets
    first: Floats
    second: Floats
    delta: Mask

    @classmethod
    def at(cls, kind: CoatedMaterials, hit: SurfaceHit, wo: Floats) -> _Lobes:
        coat, shape = Coat.at(kind, hit), hit.shape
        f, _ = fresnel_dielectric(np.clip(wo[2], 0.0, 1.0), coat.eta)
        reflected = gather(kind.base_albedo, shape)
        first = np.clip(f / np.maximum(f + (1.0 - f) * reflected, TINY), 0.25, 0.75)
        first = np.where(gather(kind.eta, shape) == 1, 0.0, first)
        delta = ~coat.glossy
        alone = delta & kind.mirror[shape] & ~kind.albedo[:, shape].any(axis=0)
        first = np.where(alone, 1.0, first)
        alpha = gather(kind.base_alpha, shape)
        metal = (alpha > 0) & (coat.eta >= 1)
        second = np.where(metal, 0.75 * (1.0 - first), 0.0)
        return cls(coat, Facets(Z, np.where(metal, alpha, 1.0), None), first, second, delta)

    def pdf(self, wo: Floats, wi: Floats) -> Floats:
        """Density (n,) of what is no delta lobe; wi.z > 0."""
        facets, eta = self.coat.facets, self.coat.eta
        seen = np.maximum(2 * (wo[2] + facets.projected(wo, wo[2])), TINY)
        first = np.where(self.delta, 0.0, self.first) * facets.distribution(wo + wi)[0] / seen
        out = first + (1.0 - self.first - self.second) * np.maximum(wi[2], 0.0) / np.pi
        if not self.second.any():
            return out
        low, a = _bent(wo, eta)
        high, b = _bent(wi, eta)
        seen = np.maximum(2 * (a + self.base.projected(low, a)), TINY)
        jacobian = np.maximum(wi[2], 0.0) / np.maximum(eta * eta * b, TINY)
        return out + np.where(
            self.second > 0, self.second * self.base.distribution(low + high)[0] / seen * jacobian, 0.0
        )

    def sample(self, wo: Floats, u: Floats) -> tuple[Floats, Mask]:
        """Directions (3, n), and whether they are the delta lobe's."""
        n = wo.shape[1]
        edge = self.first + self.second
        chosen = np.where(u[0] < self.first, 0, np.where(u[0] < edge, 1, 2))
        low = np.where(chosen == 0, 0.0, np.where(chosen == 1, self.first, edge))
        size = np.where(chosen == 0, self.first, np.where(chosen == 1, self.second, 1.0 - edge))
        own = np.stack([np.clip((u[0] - low) / np.maximum(size, TINY), 0.0, 1.0 - 2.0**-53), u[1]])
        wi = _reflect(self.coat.facets, wo, own)
        if self.second.any():
            low_wo, _ = _bent(wo, self.coat.eta)
            through = _unbent(_reflect(self.base, low_wo, own), self.coat.eta)
            wi = np.where(chosen == 1, through, wi)
        wi = np.where(chosen == 2, cosine_hemisphere(own), wi)
        return wi, np.broadcast_to(self.delta & (chosen == 0), (n,))


def _reflect(facets: Facets, wo: Floats, u: Floats) -> Floats:
    """wo mirrored at microfacets that it sees."""
    m = facets.visible_normal(wo, u)
    return m * (2 * dot(wo, m) / dot(m, m)) - wo


def _bent(v: Floats, eta: Floats) -> tuple[Floats, Floats]:
    """v inside a flat layer of index eta >= 1, on its own side of the boundary, and its cosine (n,)."""
    x, y = v[0] / eta, v[1] / eta
    z = np.sqrt(np.maximum(1.0 - (x * x + y * y), 0.0))
    return np.stack([x, y, z]), z


def _unbent(v: Floats, eta: Floats) -> Floats:
    """The other way round; below the horizon, unit still, where nothing gets out."""
    x, y = v[0] * eta, v[1] * eta
    square = 1.0 - (x * x + y * y)
    good = (square > 0) & (v[2] > 0)
    return np.where(good, np.stack([x, y, np.sqrt(np.maximum(square, 0.0))]), -Z)


def _into(frame: tuple[Floats, Floats, Floats], v: Floats) -> Floats:
    """World vectors v (3, n) in local coordinates."""
    return np.stack([dot(axis, v) for axis in frame])


MATERIALS.add("coated", CoatedMaterials)

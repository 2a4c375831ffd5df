"""Surfaces under a layer of varnish, as pbrt's `coateddiffuse` and `coatedconductor`.

f is what the coat reflects, in closed form, and the mean of random walks between the coat and the base
[pharr2023, sec. 14.3.2]. Each walk enters along wo, and each of its events is weighed against a direction
that enters along wi. Its random numbers are hashes of the point and of both directions: f is an unbiased
estimate of the layered BSDF, and the same whoever asks for it.

pbrt weighs the sampled way out by the density of wi given the way, not of the way given wi. The weights of
the two techniques then add up to more than 1, and its f of a rough coat is too bright: by 4 % at alpha 0.1,
by 10 % at 0.3. These are pbrt's materials, so that this f has the expectation of pbrt's. Smooth coats have no
such fault.

Directions are sampled by closed forms: the coat's lobe, the lobe of a metal base seen through a flat coat,
and the cosine. Their mixture's density is exact.

In local coordinates z is the shading normal and x is dp/du where that matters; wo, wi have z > 0, the layer
lies between z = thickness, its coat, and z = 0, its base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample, MaterialKind, material_kind
from renderer.math.hashing import UInt64, hash_vectors, stream
from renderer.math.vectors import Floats, combine, dot, frame_about, gather, normalize
from renderer.math.warp import cosine_hemisphere
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.microfacets import TINY, Facets, alphas_across, fresnel_dielectric, varying_alphas
from renderer.textures import Places, evaluate
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Roughness, is_oriented
from scenes.description.shapes import ShapeDescription, Sphere
from scenes.description.textures import Texture, mean

Rows = NDArray[np.int64]
Bools = NDArray[np.bool_]

THINNEST = float(np.finfo(np.float32).tiny)  # pbrt's least thickness, which absorbs nothing
STRAIGHT = 1e-3  # below this |g| pbrt samples an isotropic phase function
STEEPEST = 0.99  # and beyond this it samples and evaluates this g
X, Z = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0]])


@dataclass(frozen=True, eq=False)
class CoatedMaterials:
    """All arrays (s,) or (3, s); rows of other kinds are 0. coated: 1, or 0 for shapes of other materials.

    alpha: of the coat, 0 where it bends no ray. glossy: whether the coat is rough, as pbrt has it. bases: the
    kinds of the bases, made of all shapes; base_of: (s,) which of them a shape has. mirror: whether its base
    is a delta lobe. base_alpha: of the lobe that a metal base shows through the coat, NaN for other bases.
    base_albedo: about how much the base reflects. oriented: whether dp/du matters anywhere.

    varying: by shape, what textures say of the coat's roughness. layers: by shape, the coats whose thickness,
    albedo or g are textures, of which `thickness`, `albedo` and `g` are the means.
    """

    coated: Bools
    eta: Floats
    alpha: Floats
    alpha_v: Floats | None
    glossy: Bools
    thickness: Floats
    albedo: Floats
    g: Floats
    max_depth: Rows
    samples: Rows
    bases: tuple[MaterialKind, ...]
    base_of: Rows
    mirror: Bools
    base_alpha: Floats
    base_albedo: Floats
    oriented: bool
    varying: tuple[tuple[int, Roughness], ...]
    layers: tuple[tuple[int, Coated], ...]

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
        walks = _Walks(self, some, _into(frame, some.wo), _into(frame, wi), hash_vectors(some.p, some.wo, wi))
        out[:, rows] = walks.mean() + walks.coat.reflected(walks.wo, walks.wi)
        return out

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        frame = self._frame(hit)
        wo, wi = _into(frame, hit.wo), _into(frame, wi)
        lobes = _Lobes.at(self, hit, wo)
        up = (wi[2] > 0) & (wo[2] > 0) & self.coated[hit.shape]
        return np.where(up, lobes.pdf(wo, wi), 0.0)

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """One of the lobes; that of a smooth coat is the mirror's direction, with all that goes there."""
        frame = self._frame(hit)
        wo = _into(frame, hit.wo)
        lobes = _Lobes.at(self, hit, wo)
        wi, mirrored = lobes.sample(wo, u)
        wi = combine(frame, *wi)
        value, pdf = self.evaluate(hit, wi), self.pdf(hit, wi)
        if not mirrored.any():
            return BSDFSample(wi, value, pdf)
        wi = np.where(mirrored, 2 * dot(hit.wo, hit.ns) * hit.ns - hit.wo, wi)
        # f |cos| / pdf is the delta lobe's share of the light, over the chance of choosing it.
        value = np.where(mirrored, self._mirrored(hit, wo) / np.maximum(wo[2], TINY), value)
        chance = lobes.first * self.coated[hit.shape]
        return BSDFSample(wi, value, np.where(mirrored, chance, pdf), mirrored)

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
        crossed = _transmittance(_Layer.at(self, some).thickness, cosine) ** 2
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


@dataclass(frozen=True, eq=False)
class _Coat:
    """The coats of n points. facets: about z. eta, glossy: (n,) or (1,)."""

    facets: Facets
    eta: Floats
    glossy: Bools

    @classmethod
    def at(cls, kind: CoatedMaterials, hit: SurfaceHit) -> _Coat:
        shape = hit.shape
        alpha = gather(kind.alpha, shape)
        across = None if kind.alpha_v is None else gather(kind.alpha_v, shape)
        if kind.varying:
            alpha, across = varying_alphas(hit, alpha, across, kind.varying)
        axes = None if across is None else (X, np.array([[0.0], [1.0], [0.0]]), across)
        return cls(Facets(Z, alpha, axes), gather(kind.eta, shape), kind.glossy[shape])

    def take(self, rows: Rows) -> _Coat:
        """The lobes of some rows (m,)."""
        axes = self.facets.axes
        if axes is not None:
            axes = (axes[0], axes[1], gather(axes[2], rows))
        facets = Facets(Z, gather(self.facets.alpha, rows), axes)
        return _Coat(facets, gather(self.eta, rows), self.glossy[rows])

    def reflected(self, wo: Floats, wi: Floats) -> Floats:
        """f (n,) of the coat's outer side, without delta lobes."""
        facets = self.facets
        distribution, h2 = facets.distribution(wo + wi)
        between = wi[2] * facets.projected(wo, wo[2]) + wo[2] * facets.projected(wi, wi[2])
        cosine = np.minimum(0.5 * np.sqrt(h2), 1.0)
        f, _ = fresnel_dielectric(cosine, self.eta)
        return f * distribution / (2 * np.maximum(between, TINY))

    def transmit(self, v: Floats, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Ways into the layer of light along v (3, n): direction w, f |cos w| / pdf without the change of
        radiance, and pdf (n,). Both are 0 where there is no way.
        """
        facets = self.facets
        m = normalize(facets.visible_normal(v, u))
        v_m = dot(v, m)
        f, c = fresnel_dielectric(np.clip(v_m, 0.0, 1.0), self.eta)
        w = (v_m / self.eta - c) * m - v / self.eta
        good = (w[2] < 0) & (v_m > 0)
        weight = np.where(good, (1.0 - f) * _shadowed(facets, v, v[2], w, -w[2]), 0.0)
        stretch = self.eta * c / np.maximum(np.abs(v_m - self.eta * c), TINY)
        visible = 2 * facets.distribution(m)[0] * v_m / np.maximum(v[2] + facets.projected(v, v[2]), TINY)
        pdf = np.where(facets.alpha > 0, visible * stretch * stretch / np.maximum(c, TINY), 1.0)
        return w, weight, np.where(good, pdf, 0.0)

    def cross(self, w: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """f (n,) of light along wi that leaves inside along -w, w.z > 0, and the pdf of wi given w."""
        facets, eta = self.facets, 1.0 / self.eta
        h = eta * wi - w
        with np.errstate(invalid="ignore", divide="ignore"):
            m = h / np.sqrt(dot(h, h))
        m = np.where(m[2] < 0, -m, m)
        w_m, wi_m = dot(w, m), dot(wi, m)  # of -w with m turned towards it, and of wi
        f, _ = fresnel_dielectric(np.clip(w_m, 0.0, 1.0), eta)
        inside = facets.projected(w, w[2])
        shared = facets.distribution(h)[0] * w_m * wi_m * 2 / np.maximum(dot(h, h), TINY)
        value = (1.0 - f) * shared / np.maximum(wi[2] * inside + w[2] * facets.projected(wi, wi[2]), TINY)
        pdf = shared * (eta * eta) / np.maximum(w[2] + inside, TINY)
        good = (w_m > 0) & (wi_m > 0) & (f < 1)
        return np.where(good, value, 0.0), np.where(good, pdf, 0.0)

    def reflect_inside(self, w: Floats, u: Floats) -> tuple[Floats, Floats]:
        """Directions (3, n) back down of light that comes up along w, and f |cos| / pdf (n,)."""
        facets = self.facets
        m = normalize(facets.visible_normal(w, u))
        w_m = dot(w, m)
        f, _ = fresnel_dielectric(np.clip(w_m, 0.0, 1.0), 1.0 / self.eta)
        down = w - 2 * w_m * m
        return down, np.where(down[2] < 0, f * _shadowed(facets, w, w[2], down, -down[2]), 0.0)


@dataclass(frozen=True, eq=False)
class _Layer:
    """The medium between coat and base at n points. thickness, g: (n,). albedo: (3, n)."""

    thickness: Floats
    albedo: Floats
    g: Floats

    @classmethod
    def at(cls, kind: CoatedMaterials, hit: SurfaceHit) -> _Layer:
        shape = hit.shape
        layer = cls(kind.thickness[shape], kind.albedo[:, shape], kind.g[shape])
        for i, coated in kind.layers:
            rows = np.flatnonzero(shape == i)
            if rows.size:
                at = Places.of(hit, rows)
                layer.thickness[rows] = np.maximum(_values(coated.thickness, at)[0], THINNEST)
                layer.albedo[:, rows] = np.clip(_values(coated.albedo, at), 0.0, 1.0)
                layer.g[rows] = np.clip(_values(coated.g, at)[0], -1.0, 1.0)
        return layer


def _values(part: float | Texture, at: Places) -> Floats:
    return evaluate(np.full(3, part) if isinstance(part, float | int) else part, at)


def _number(part: float | Texture) -> float:
    return part if isinstance(part, float | int) else float(mean(part)[0])


def _shadowed(facets: Facets, v: Floats, v_z: Floats, w: Floats, w_z: Floats) -> Floats:
    """G / G1 (n,) of a sample w whose microfacet v sees; v_z, w_z: their |cos|."""
    q = facets.projected(v, v_z)
    return w_z * (v_z + q) / np.maximum(w_z * q + v_z * facets.projected(w, w_z), TINY)


@dataclass(eq=False)
class _Walks:
    """Random walks of n points between coat and base. wo, wi: (3, n) local, z > 0. key: (n,)."""

    kind: CoatedMaterials
    hit: SurfaceHit
    wo: Floats
    wi: Floats
    key: UInt64

    def __post_init__(self) -> None:
        self.coat = _Coat.at(self.kind, self.hit)
        self.layer = _Layer.at(self.kind, self.hit)
        self.total = np.zeros_like(self.wo)

    def mean(self) -> Floats:
        """f (3, n) of what goes through the coat."""
        shape = self.hit.shape
        samples = self.kind.samples[shape]
        for sample in range(int(samples.max())):
            self._walk(sample, np.flatnonzero(samples > sample))
        return self.total / samples

    def _numbers(self, rows: Rows, sample: int, depth: int, which: int, count: int) -> Floats:
        """(count, m) numbers in [0, 1) of their own for each row, walk, depth and use."""
        return stream(self.key[rows], (sample << 40) + (depth << 4) + which, count)

    def _walk(self, sample: int, rows: Rows) -> None:
        """Add one walk of some rows to the total."""
        coat = self.coat.take(rows)
        w, weight, _ = coat.transmit(self.wo.take(rows, axis=1), self._numbers(rows, sample, 0, 0, 2))
        exits = coat.transmit(self.wi.take(rows, axis=1), self._numbers(rows, sample, 0, 2, 2))
        # Radiance is divided by eta^2 where it leaves the layer.
        beta = np.repeat((weight / (coat.eta * coat.eta))[None], 3, axis=0)
        alive = np.flatnonzero((weight > 0) & (exits[1] > 0))
        own = self.hit.shape[rows]
        state = _State(rows, w, beta, self.layer.thickness[rows], *exits).take(alive)
        for depth in range(int(self.kind.max_depth[own].max(initial=0))):
            deep = self.kind.max_depth[self.hit.shape[state.rows]] > depth
            state = state.take(np.flatnonzero(deep))
            if depth > 3:
                state = self._roulette(state, sample, depth)
            if state.rows.size == 0:
                return
            state = self._step(state, sample, depth)

    def _roulette(self, state: _State, sample: int, depth: int) -> _State:
        brightest = state.beta.max(axis=0)
        chance = np.where(brightest < 0.25, brightest, 1.0)
        kept = np.flatnonzero(self._numbers(state.rows, sample, depth, 4, 1)[0] < chance)
        state = state.take(kept)
        state.beta = state.beta / chance[kept]
        return state

    def _step(self, state: _State, sample: int, depth: int) -> _State:
        """On to the next event, and past it."""
        thickness = self.layer.thickness[state.rows]
        filled = self.layer.albedo[:, state.rows].any(axis=0)
        if not filled.any():
            state.beta = state.beta * _transmittance(thickness, state.w[2])
            state.z = np.where(state.z == thickness, 0.0, thickness)
            return self._meet(state, sample, depth)
        clear = state.take(np.flatnonzero(~filled))
        through, scattered = self._medium(state.take(np.flatnonzero(filled)), sample, depth)
        thin = self.layer.thickness[clear.rows]
        clear.beta = clear.beta * _transmittance(thin, clear.w[2])
        clear.z = np.where(clear.z == thin, 0.0, thin)
        return _joined(self._meet(_joined(clear, through), sample, depth), scattered)

    def _meet(self, state: _State, sample: int, depth: int) -> _State:
        """The coat from inside, or the base."""
        if state.rows.size == 0:
            return state
        up = state.z > 0
        parts: list[_State] = []
        if up.any():
            part = state.take(np.flatnonzero(up))
            u = self._numbers(part.rows, sample, depth, 5, 2)
            w, weight = self.coat.take(part.rows).reflect_inside(part.w, u)
            part.w, part.beta = w, part.beta * weight
            parts.append(part.take(np.flatnonzero(weight > 0)))
        if not up.all():
            parts.append(self._bounce(state.take(np.flatnonzero(~up)), sample, depth))
        return parts[0] if len(parts) == 1 else _joined(*parts)

    def _bounce(self, state: _State, sample: int, depth: int) -> _State:
        """Off the base: along the way that was chosen from outside, and along one that the base chooses."""
        rows, kind = state.rows, self.kind
        coat, thickness = self.coat.take(rows), self.layer.thickness[rows]
        mirror = kind.mirror[self.hit.shape[rows]]
        hit = kind.base_hit(self.hit.take(rows), -state.w)
        value, pdf = kind.base_value(hit, -state.exit)
        weight = np.where(coat.glossy, _power(state.exit_pdf, pdf), 1.0)
        weight *= _transmittance(thickness, state.exit[2]) * state.exit_weight
        self.total[:, rows] += state.beta * value * weight
        found = kind.sample_base(hit, self._numbers(rows, sample, depth, 5, 2))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            factor = np.where(found.pdf > 0, found.value * (np.abs(found.wi[2]) / found.pdf), 0.0)
        good = (found.wi[2] > 0) & factor.any(axis=0)
        state.w, state.beta = found.wi, state.beta * factor
        out, back = coat.cross(found.wi, self.wi.take(rows, axis=1))
        weight = np.where(mirror, 1.0, _power(found.pdf, back))
        weight = np.where(coat.glossy & good, weight, 0.0) * out * _transmittance(thickness, found.wi[2])
        self.total[:, rows] += state.beta * weight
        return state.take(np.flatnonzero(good))

    def _medium(self, state: _State, sample: int, depth: int) -> tuple[_State, _State]:
        """The rows that cross the medium, moved to the boundary, and those that it scatters."""
        rows, layer = state.rows, self.layer
        coat, thickness, albedo = self.coat.take(rows), layer.thickness[rows], layer.albedo[:, rows]
        u = self._numbers(rows, sample, depth, 7, 3)
        z = state.z - np.log1p(-u[0]) * state.w[2]
        inside = (z > 0) & (z < thickness)
        through = state.take(np.flatnonzero(~inside))
        through.z = np.clip(z, 0.0, thickness)[~inside]
        some = np.flatnonzero(inside)
        state, coat, u, z = state.take(some), coat.take(some), u[1:].take(some, axis=1), z[some]
        rows, thickness, albedo = rows[some], thickness[some], albedo.take(some, axis=1)
        g = layer.g[rows]
        # Towards the way that was chosen from outside. The phase function's wo is where the light came from.
        phase = _phase(dot(state.w, state.exit), g)
        weight = np.where(coat.glossy, _power(state.exit_pdf, phase), 1.0) * phase
        weight *= _transmittance(z - thickness, state.exit[2]) * state.exit_weight
        self.total[:, rows] += state.beta * albedo * (weight / np.maximum(-state.exit[2], TINY))
        state.w, pdf = _scatter(state.w, g, u)
        state.beta, state.z = state.beta * albedo, z
        up = coat.glossy & (state.w[2] > 0)
        out, back = coat.cross(state.w, self.wi.take(rows, axis=1))
        weight = np.where(up, _power(pdf, back) * out, 0.0) * _transmittance(z - thickness, state.w[2])
        self.total[:, rows] += state.beta * weight
        return through, state.take(np.flatnonzero(state.w[2] != 0))


@dataclass(eq=False)
class _State:
    """Walks under way. rows: (m,) of the points. w: (3, m) where they go. beta: (3, m). z: (m,) heights.

    exit: (3, m) down into the layer from wi, with its f |cos| / pdf and its pdf, (m,) each.
    """

    rows: Rows
    w: Floats
    beta: Floats
    z: Floats
    exit: Floats
    exit_weight: Floats
    exit_pdf: Floats

    def take(self, some: Rows) -> _State:
        if some.size == self.rows.size:
            return self
        return _State(
            self.rows[some],
            self.w.take(some, axis=1),
            self.beta.take(some, axis=1),
            self.z[some],
            self.exit.take(some, axis=1),
            self.exit_weight[some],
            self.exit_pdf[some],
        )


def _joined(a: _State, b: _State) -> _State:
    return _State(
        np.concatenate([a.rows, b.rows]),
        np.concatenate([a.w, b.w], axis=1),
        np.concatenate([a.beta, b.beta], axis=1),
        np.concatenate([a.z, b.z]),
        np.concatenate([a.exit, b.exit], axis=1),
        np.concatenate([a.exit_weight, b.exit_weight]),
        np.concatenate([a.exit_pdf, b.exit_pdf]),
    )


@dataclass(frozen=True, eq=False)
class _Lobes:
    """The lobes that directions of n points are drawn from. first, second: (n,) the chances of the lobes of
    coat and base, the cosine having the rest. delta: (n,) whether the coat's lobe is one.
    """

    coat: _Coat
    base: Facets
    first: Floats
    second: Floats
    delta: Bools

    @classmethod
    def at(cls, kind: CoatedMaterials, hit: SurfaceHit, wo: Floats) -> _Lobes:
        coat, shape = _Coat.at(kind, hit), hit.shape
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

    def sample(self, wo: Floats, u: Floats) -> tuple[Floats, Bools]:
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


def _transmittance(distance: Floats, cosine: Floats) -> Floats:
    """(n,) along a way of that |cosine| over a height; the thinnest layer absorbs nothing."""
    height = np.abs(distance)
    with np.errstate(divide="ignore"):
        depth = height / np.abs(cosine)
    return np.where(height <= THINNEST, 1.0, np.exp(-depth))


def _power(own: Floats, other: Floats) -> Floats:
    """The power heuristic of one sample each [pharr2023, sec. 2.2.3]."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = other / own
        return np.where(own > 0, 1.0 / (1.0 + ratio * ratio), 0.0)


def _phase(cosine: Floats, g: Floats) -> Floats:
    """Henyey and Greenstein's, 1/sr, of the cosine of two directions that both leave the point
    [pharr2023, eq. 11.13].
    """
    g = np.clip(g, -STEEPEST, STEEPEST)
    below = np.maximum(1.0 + g * g + 2 * g * cosine, TINY)
    return (1.0 - g * g) / (4 * np.pi * below * np.sqrt(below))


def _scatter(w: Floats, g: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Directions (3, n) that the phase function gives light going along w, and their pdf (n,)."""
    g = np.clip(g, -STEEPEST, STEEPEST)
    steep = np.where(np.abs(g) < STRAIGHT, 1.0, g)
    ratio = (1.0 - g * g) / (1.0 + g - 2 * g * u[0])
    skewed: Floats = (ratio * ratio - (1.0 + g * g)) / (2 * steep)
    cosine: Floats = np.clip(np.where(np.abs(g) < STRAIGHT, 1.0 - 2 * u[0], skewed), -1.0, 1.0)
    sine, phi = np.sqrt((1.0 - cosine) * (1.0 + cosine)), 2 * np.pi * u[1]
    out = combine(frame_about(-w), sine * np.cos(phi), sine * np.sin(phi), cosine)
    return out, _phase(cosine, g)


MATERIALS.add("coated", CoatedMaterials)

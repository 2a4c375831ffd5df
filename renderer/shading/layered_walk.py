"""Random walks in a layer between a coat and a base, as in pbrt's LayeredBxDF [pharr2023, sec. 14.3.2].

Each walk enters along wo, and each of its events is weighed against a direction that enters along wi. Its
random numbers are hashes of the point and of both directions: the mean is an unbiased estimate of the layered
BSDF, and the same whoever asks for it.

pbrt weighs the sampled way out by the density of wi given the way, not of the way given wi. The weights of
the two techniques then add up to more than 1, and its f of a rough coat is too bright: by 4 % at alpha 0.1,
by 10 % at 0.3. These are pbrt's materials, so that this f has the expectation of pbrt's. Smooth coats have no
such fault.

In local coordinates z is the shading normal and x is dp/du where that matters; wo, wi have z > 0, the layer
lies between z = thickness, its coat, and z = 0, its base.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from renderer.math.hashing import UInt64, stream
from renderer.math.vectors import Floats, combine, dot, frame_about, gather, normalize
from renderer.records import BSDFSample, SurfaceHit
from renderer.shading.microfacets import TINY, Facets, fresnel_dielectric, varying_alphas
from renderer.textures import Places, evaluate
from scenes.arrays import Index, Mask
from scenes.description.materials import Coated, Roughness
from scenes.description.textures import Texture

THINNEST = float(np.finfo(np.float32).tiny)  # pbrt's least thickness, which absorbs nothing
STRAIGHT = 1e-3  # below this |g| pbrt samples an isotropic phase function
STEEPEST = 0.99  # and beyond this it samples and evaluates this g
X, Z = np.array([[1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0]])


@dataclass(frozen=True, eq=False)
class Layers(ABC):
    """The coats and layers of s shapes, and the bases under them. Arrays are (s,) or (3, s).

    eta, alpha, alpha_v: of the coat; alpha 0 bends no ray, alpha_v is None if all are isotropic. glossy:
    whether the coat is rough, as pbrt has it. thickness, albedo, g: of the layer. max_depth: events of a walk
    at most. samples: walks for one value. mirror: whether the base is a delta lobe.

    varying: by shape, the textures of the coat's roughness. layers: by shape, the coats whose thickness,
    albedo or g are textures, of which `thickness`, `albedo` and `g` are the means.
    """

    eta: Floats
    alpha: Floats
    alpha_v: Floats | None
    glossy: Mask
    thickness: Floats
    albedo: Floats
    g: Floats
    max_depth: Index
    samples: Index
    mirror: Mask
    varying: tuple[tuple[int, Roughness], ...]
    layers: tuple[tuple[int, Coated], ...]

    @abstractmethod
    def base_hit(self, hit: SurfaceHit, wo: Floats) -> SurfaceHit:
        """Points of bases under points of coats, seen along wo (3, n) in local coordinates."""

    @abstractmethod
    def base_value(self, hit: SurfaceHit, wi: Floats) -> tuple[Floats, Floats]:
        """f (3, n) and pdf (n,) of the bases."""

    @abstractmethod
    def sample_base(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        """Directions drawn by the bases. u: (2, n) in [0, 1)."""


@dataclass(frozen=True, eq=False)
class Coat:
    """The coats of n points. facets: about z. eta, glossy: (n,) or (1,)."""

    facets: Facets
    eta: Floats
    glossy: Mask

    @classmethod
    def at(cls, kind: Layers, hit: SurfaceHit) -> Coat:
        shape = hit.shape
        alpha = gather(kind.alpha, shape)
        across = None if kind.alpha_v is None else gather(kind.alpha_v, shape)
        if kind.varying:
            alpha, across = varying_alphas(hit, alpha, across, kind.varying)
        axes = None if across is None else (X, np.array([[0.0], [1.0], [0.0]]), across)
        return cls(Facets(Z, alpha, axes), gather(kind.eta, shape), kind.glossy[shape])

    def take(self, rows: Index) -> Coat:
        """The lobes of some rows (m,)."""
        axes = self.facets.axes
        if axes is not None:
            axes = (axes[0], axes[1], gather(axes[2], rows))
        facets = Facets(Z, gather(self.facets.alpha, rows), axes)
        return Coat(facets, gather(self.eta, rows), self.glossy[rows])

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
class Layer:
    """The medium between coat and base at n points. thickness, g: (n,). albedo: (3, n)."""

    thickness: Floats
    albedo: Floats
    g: Floats

    @classmethod
    def at(cls, kind: Layers, hit: SurfaceHit) -> Layer:
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


@dataclass(eq=False)
class Walks:
    """Random walks of n points between coat and base. wo, wi: (3, n) local, z > 0. key: (n,)."""

    kind: Layers
    hit: SurfaceHit
    wo: Floats
    wi: Floats
    key: UInt64

    def __post_init__(self) -> None:
        self.coat = Coat.at(self.kind, self.hit)
        self.layer = Layer.at(self.kind, self.hit)
        self.total = np.zeros_like(self.wo)

    def mean(self) -> Floats:
        """f (3, n) of what goes through the coat."""
        shape = self.hit.shape
        samples = self.kind.samples[shape]
        for sample in range(int(samples.max())):
            self._walk(sample, np.flatnonzero(samples > sample))
        return self.total / samples

    def _numbers(self, rows: Index, sample: int, depth: int, which: int, count: int) -> Floats:
        """(count, m) numbers in [0, 1) of their own for each row, walk, depth and use."""
        return stream(self.key[rows], (sample << 40) + (depth << 4) + which, count)

    def _walk(self, sample: int, rows: Index) -> None:
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
            state.beta = state.beta * transmittance(thickness, state.w[2])
            state.z = np.where(state.z == thickness, 0.0, thickness)
            return self._meet(state, sample, depth)
        clear = state.take(np.flatnonzero(~filled))
        through, scattered = self._medium(state.take(np.flatnonzero(filled)), sample, depth)
        thin = self.layer.thickness[clear.rows]
        clear.beta = clear.beta * transmittance(thin, clear.w[2])
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
        weight *= transmittance(thickness, state.exit[2]) * state.exit_weight
        self.total[:, rows] += state.beta * value * weight
        found = kind.sample_base(hit, self._numbers(rows, sample, depth, 5, 2))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            factor = np.where(found.pdf > 0, found.value * (np.abs(found.wi[2]) / found.pdf), 0.0)
        good = (found.wi[2] > 0) & factor.any(axis=0)
        state.w, state.beta = found.wi, state.beta * factor
        out, back = coat.cross(found.wi, self.wi.take(rows, axis=1))
        weight = np.where(mirror, 1.0, _power(found.pdf, back))
        weight = np.where(coat.glossy & good, weight, 0.0) * out * transmittance(thickness, found.wi[2])
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
        weight *= transmittance(z - thickness, state.exit[2]) * state.exit_weight
        self.total[:, rows] += state.beta * albedo * (weight / np.maximum(-state.exit[2], TINY))
        state.w, pdf = _scatter(state.w, g, u)
        state.beta, state.z = state.beta * albedo, z
        up = coat.glossy & (state.w[2] > 0)
        out, back = coat.cross(state.w, self.wi.take(rows, axis=1))
        weight = np.where(up, _power(pdf, back) * out, 0.0) * transmittance(z - thickness, state.w[2])
        self.total[:, rows] += state.beta * weight
        return through, state.take(np.flatnonzero(state.w[2] != 0))


@dataclass(eq=False)
class _State:
    """Walks under way. rows: (m,) of the points. w: (3, m) where they go. beta: (3, m). z: (m,) heights.

    exit: (3, m) down into the layer from wi, with its f |cos| / pdf and its pdf, (m,) each.
    """

    rows: Index
    w: Floats
    beta: Floats
    z: Floats
    exit: Floats
    exit_weight: Floats
    exit_pdf: Floats

    def take(self, some: Index) -> _State:
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


def _values(part: float | Texture, at: Places) -> Floats:
    return evaluate(np.full(3, part) if isinstance(part, float | int) else part, at)


def _shadowed(facets: Facets, v: Floats, v_z: Floats, w: Floats, w_z: Floats) -> Floats:
    """G / G1 (n,) of a sample w whose microfacet v sees; v_z, w_z: their |cos|."""
    q = facets.projected(v, v_z)
    return w_z * (v_z + q) / np.maximum(w_z * q + v_z * facets.projected(w, w_z), TINY)


def transmittance(distance: Floats, cosine: Floats) -> Floats:
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

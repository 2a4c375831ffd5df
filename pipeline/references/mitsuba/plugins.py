# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false, reportUnknownLambdaType=false
"""Plug-ins for pbrt's rough metal, rough glass and pixel filters, which Mitsuba lacks.

- Mitsuba's rough surfaces take Smith's shadowing and masking as independent, G = G1(wi) G1(wo); pbrt's are
  correlated by height, G = 1 / (1 + Lambda(wi) + Lambda(wo)) [pharr2023]. At roughness 0.5, 60 and 70 degrees
  off the normal, that is 3.6 % of the value.
- Mitsuba splats samples into neighbouring pixels, and its gaussian ends at four standard deviations, not
  where the file says. pbrt draws each sample's place from the filter and keeps it in its pixel [pharr2023]:
  pixels stay independent, so that their variances may be added up.

The module is handed mitsuba and drjit, and never imports them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def register(mi: Any, dr: Any, pixel_filter: tuple[Array, Array] | None, film: Array | None = None) -> None:
    """Register the plug-ins with the current variant. pixel_filter, film: as in MitsubaScene."""
    base = _microfacets(mi)  # classes cannot be written before a variant is set
    conductor, dielectric = _conductor(mi, dr, base), _dielectric(mi, dr, base)
    mi.register_bsdf("penumbra_conductor", lambda props: conductor(props))
    mi.register_bsdf("penumbra_dielectric", lambda props: dielectric(props))
    if pixel_filter is not None:
        filtered = _filtered(mi, dr, pixel_filter, film)
        mi.register_sensor("penumbra_filtered", lambda props: filtered(props))


def _metal(
    mi: Any, dr: Any, spread: Any, indices: list[tuple[float, float]], wi: Any, wo: Any
) -> tuple[Any, Any]:
    """BRDF times cosine, and the density of wo, for directions above the surface.

    spread: the distribution of normals. indices: eta and k of each channel.
    """
    h = dr.normalize(wi + wo)
    g_in, g_out = spread.smith_g1(wi, h), spread.smith_g1(wo, h)
    shared = spread.eval(h) / (4 * wi.z)
    both = (g_in > 0) & (g_out > 0)
    g = dr.select(both, dr.rcp(dr.rcp(dr.select(both, g_in, 1)) + dr.rcp(dr.select(both, g_out, 1)) - 1), 0)
    cosine = dr.dot(wi, h)
    fresnel = [mi.fresnel_conductor(cosine, dr.scalar.Complex2f(eta, k)) for eta, k in indices]
    return mi.Color3f(*fresnel) * (shared * g), shared * g_in


def _microfacets(mi: Any) -> Any:
    class Microfacets(mi.BSDF):
        """A GGX surface; its subclasses give value and density together by `eval_pdf`."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            across = props["alpha_v"] if props.has_property("alpha_v") else props["alpha"]
            self.spread = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, props["alpha"], across, True)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval_pdf(ctx, si, wo, active)[1]

    return Microfacets


def _conductor(mi: Any, dr: Any, base: Any) -> Any:
    class Conductor(base):
        """GGX microfacets with height-correlated Smith shadowing, alike on both sides."""

        def __init__(self, props: Any) -> None:
            base.__init__(self, props)
            self.indices = [(props[f"eta{c}"], props[f"k{c}"]) for c in range(3)]
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components, self.m_flags = [flags], flags

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            side = dr.sign(si.wi.z)
            a, b = (mi.Vector3f(w.x, w.y, w.z * side) for w in (si.wi, wo))
            up = active & (a.z > 0) & (b.z > 0)
            value, pdf = _metal(mi, dr, self.spread, self.indices, a, b)
            return dr.select(up, value, 0), dr.select(up, pdf, 0)

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            side = dr.sign(si.wi.z)
            h, _ = self.spread.sample(mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * side), sample2)
            made = dr.zeros(mi.BSDFSample3f)
            made.wo = mi.reflect(si.wi, mi.Normal3f(h.x, h.y, h.z * side))
            value, made.pdf = self.eval_pdf(ctx, si, made.wo, active)
            made.eta = 1.0
            made.sampled_type, made.sampled_component = mi.UInt32(+mi.BSDFFlags.GlossyReflection), 0
            return made, dr.select(made.pdf > 0, value / dr.select(made.pdf > 0, made.pdf, 1), 0)

    return Conductor


def _dielectric(mi: Any, dr: Any, base: Any) -> Any:
    flags = mi.BSDFFlags
    both_sides = flags.FrontSide | flags.BackSide | flags.NonSymmetric

    class Dielectric(base):
        """A rough boundary of GGX microfacets with height-correlated Smith shadowing."""

        def __init__(self, props: Any) -> None:
            base.__init__(self, props)
            self.index = props["eta"]
            self.m_components = [flags.GlossyReflection | both_sides, flags.GlossyTransmission | both_sides]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            wi = si.wi
            mirrored = wi.z * wo.z > 0
            eta = dr.select(wi.z > 0, self.index, 1 / self.index)
            m = dr.normalize(wi + wo * dr.select(mirrored, 1.0, eta))
            m = dr.select(m.z < 0, -m, m)
            i, o = dr.dot(wi, m), dr.dot(wo, m)
            reflectance = mi.fresnel(i, self.index)[0]
            g_in, g_out = self.spread.smith_g1(wi, m), self.spread.smith_g1(wo, m)
            seen = active & (wi.z != 0) & (wo.z != 0) & (g_in > 0) & (g_out > 0)
            masking = dr.rcp(dr.rcp(dr.select(seen, g_in, 1)) + dr.rcp(dr.select(seen, g_out, 1)) - 1)
            spread = self.spread.eval(m) / dr.abs(wi.z)
            bent = dr.square(dr.select(mirrored, 1.0, i + eta * o))
            # Of radiance that is refracted the square of eta cancels; the density has it.
            chance = dr.select(mirrored, reflectance / 4, (1 - reflectance) * dr.abs(i * o) / bent)
            value = dr.select(seen, spread * masking * chance, 0)
            pdf = dr.select(seen, spread * g_in * chance * dr.select(mirrored, 1.0, dr.square(eta)), 0)
            return mi.Color3f(value), pdf

        def sample(
            self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True
        ) -> tuple[Any, Any]:
            side = dr.select(si.wi.z < 0, -1.0, 1.0)
            m = self.spread.sample(si.wi * side, sample2)[0]
            reflectance, cosine, eta_it, eta_ti = mi.fresnel(dr.dot(si.wi, m), self.index)
            mirrored = sample1 < reflectance
            made = dr.zeros(mi.BSDFSample3f)
            made.wo = dr.select(mirrored, mi.reflect(si.wi, m), mi.refract(si.wi, m, cosine, eta_ti))
            value, made.pdf = self.eval_pdf(ctx, si, made.wo, active)
            made.pdf = dr.select((made.wo.z * si.wi.z > 0) == mirrored, made.pdf, 0)
            made.eta = dr.select(mirrored, 1.0, eta_it)
            made.sampled_component = dr.select(mirrored, mi.UInt32(0), mi.UInt32(1))
            made.sampled_type = dr.select(
                mirrored, mi.UInt32(+flags.GlossyReflection), mi.UInt32(+flags.GlossyTransmission)
            )
            return made, dr.select(made.pdf > 0, value / dr.select(made.pdf > 0, made.pdf, 1), 0)

    return Dielectric


def _offset(mi: Any, dr: Any, table: Any, steps: int, u: Any) -> Any:
    """Interpolate the table, which has `steps` intervals, at u in [0, 1]."""
    at = dr.clip(u, 0, 1) * steps
    i = dr.minimum(mi.UInt32(at), steps - 1)
    # The scalar variant's numbers are Python's own, and have no gather.
    low, high = (
        dr.gather(mi.Float, table, i + one) if dr.is_jit_v(mi.Float) else table[i + one] for one in (0, 1)
    )
    return low + (high - low) * (at - i)


def _filtered(mi: Any, dr: Any, pixel_filter: tuple[Array, Array], film: Array | None) -> Any:
    jit = dr.is_jit_v(mi.Float)
    tables = [
        mi.Float(np.asarray(table, dtype=np.float32)) if jit else table.tolist() for table in pixel_filter
    ]
    steps = len(pixel_filter[0]) - 1

    class Filtered(mi.Sensor):
        """A camera that places samples by the pixel filter, each of which counts for its own pixel only."""

        def __init__(self, props: Any) -> None:
            mi.Sensor.__init__(self, props)
            self.camera = props["camera"]

        def sample_ray_differential(
            self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True
        ) -> tuple[Any, Any]:
            size = mi.Point2f(self.film().size())
            pixel = dr.floor(sample2 * size)
            u = sample2 * size - pixel
            x, y = (
                _offset(mi, dr, table, steps, part) for table, part in zip(tables, (u.x, u.y), strict=True)
            )
            at = (pixel + 0.5 + mi.Point2f(x, y)) / size
            if film is not None:
                s, t, depth = (row[0] * at.x + row[1] * at.y + row[2] for row in film.tolist())
                at = mi.Point2f(s / depth, t / depth)
            return self.camera.sample_ray_differential(time, sample1, at, sample3, active)

        def sample_ray(self, time: Any, sample1: Any, sample2: Any, sample3: Any, active: Any = True) -> Any:
            return self.sample_ray_differential(time, sample1, sample2, sample3, active)

        def bbox(self) -> Any:
            return self.camera.bbox()

    return Filtered

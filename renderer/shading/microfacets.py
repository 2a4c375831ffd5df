"""Trowbridge and Reitz's microfacets, seen from the side of the normal, and the Fresnel equations of glass.

With mu the cosine of a direction with the normal n and q(mu) = sqrt(mu^2 + alpha^2 (1 - mu^2)):

    D  = alpha^2 / (pi cos^4(m) (alpha^2 + tan^2(m))^2)          [walter2007, eq. 33]
    G  = 2 mu_o mu_i / (mu_i q(mu_o) + mu_o q(mu_i))             height-correlated masking [heitz2014, eq. 99]
    D_o = 2 D |wo.m| / (mu_o + q(mu_o))                          density of the normals m that wo sees
"""

from __future__ import annotations

import numpy as np

from renderer.math.vectors import Floats, combine, dot, frame_about

TINY = np.finfo(np.float64).tiny


def projected(cosine: Floats, alpha: Floats) -> Floats:
    """q(mu): the cosine of the direction stretched to where microfacets are a hemisphere. cosine: (n,)."""
    return np.sqrt(cosine * cosine + alpha * alpha * ((1.0 - cosine) * (1.0 + cosine)))


def distribution(n: Floats, m: Floats, alpha: Floats) -> Floats:
    """D (n,) in 1/sr at microfacet normals m (3, n), of any length; the sine is taken across n."""
    along = dot(n, m)
    across = m - n * along
    cosine2, sine2 = along * along, dot(across, across)
    root = alpha * (cosine2 + sine2) / np.maximum(alpha * alpha * cosine2 + sine2, TINY)
    return root * root * (1 / np.pi)


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


def fresnel_dielectric(cosine: Floats, eta: Floats) -> tuple[Floats, Floats]:
    """Reflectance (n,) of a smooth boundary, and the cosine (n,) of what is refracted, 0 where nothing is.

    cosine: (n,) in [0, 1], of the incident direction. eta: (n,), the index behind the boundary over that
    before it. Source: [pharr2023, sec. 9.3.5].
    """
    # cos^2 behind the boundary, written so that it keeps its digits where both sides are nearly alike.
    squared = (cosine * cosine + (eta - 1.0) * (eta + 1.0)) / (eta * eta)
    refracted = np.sqrt(np.maximum(squared, 0.0))
    parallel = _contrast(eta * cosine, refracted)
    across = _contrast(cosine, eta * refracted)
    return (parallel * parallel + across * across) / 2, refracted


def _contrast(a: Floats, b: Floats) -> Floats:
    """(a - b) / (a + b) of what is not negative; 1 where both are 0."""
    return np.where(a + b > 0, (a - b) / np.maximum(a + b, TINY), 1.0)

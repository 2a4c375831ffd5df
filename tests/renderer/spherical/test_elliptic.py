"""The elliptic integrals of a disk's solid angle against 50 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np

from renderer.spherical.elliptic import complete, symmetric


def test_complete() -> None:
    """Down to the ratio of 2e-8 that a point at rounding distance from a rim brings; one mean less leaves
    2e-14 there, two 1e-7.
    """
    rng = np.random.default_rng(12)
    kc = np.concatenate((10 ** rng.uniform(-7.7, 0, 40), [2e-8, 1.0, 1.0, 2e-8]))
    p = np.concatenate((10 ** rng.uniform(0, 30, 40), [1.0, 1.0, 1e30, 1e30]))
    for value, k, q in zip(complete(kc, p), kc, p, strict=True):
        with mp.workdps(50):
            k2, q2 = mp.mpf(float(k)) ** 2, mp.mpf(float(q)) ** 2
            # With w = tan^2: 1/2 integral dw / ((1 + q^2 w) sqrt(w (1 + w)(1 + k^2 w)))
            truth = mp.elliprj(0, 1, 1 / k2, 1 / q2) / (3 * q2 * mp.sqrt(k2))
            assert abs(value / truth - 1) < 1e-14


def test_symmetric() -> None:
    """R_J of the arguments that disks bring, from equal ones to cosines 1e-30 apart: a step less at CLOSE =
    0.1 fails here; the bound itself has slack.
    """
    rng = np.random.default_rng(11)
    usual = rng.uniform(0.001, 1, (2, 80))
    a = np.concatenate(
        (usual[0], 10 ** rng.uniform(-60, 0, 40), 1 - 10 ** rng.uniform(-15, 0, 40), [1.0, 1e-60, 1e-60])
    )
    b = np.concatenate(
        (usual[1], 10 ** rng.uniform(-60, 0, 40), 1 - 10 ** rng.uniform(-15, 0, 40), [1.0, 1.0, 1e-60])
    )
    b = np.maximum(a, b)
    t = np.where(rng.random(a.size) < 0.2, 0.0, 10 ** rng.uniform(-8, 8, a.size))
    ab = a * b
    arguments = (ab * t * t, ab * t * t + b, ab * t * t + a, ab * t * t + ab)
    values = symmetric(*arguments, ab * np.sqrt((1 - a) * (1 - b)))
    for i, value in enumerate(values):
        with mp.workdps(50):
            # The small differences are exact here; float64 holds them only through `apart`.
            aa, bb, start = mp.mpf(a[i]), mp.mpf(b[i]), mp.mpf(arguments[0][i])
            truth = mp.elliprj(start, start + bb, start + aa, start + aa * bb)
            assert abs(value / truth - 1) < 1e-14

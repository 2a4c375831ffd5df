"""Rough metals through Mitsuba against pbrt's formulas."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from scenes.description.lights import DistantLight, Environment
from scenes.description.materials import Conductor
from scenes.description.shapes import Array, ShapeDescription
from tests.kit.mitsuba_checks import lit, picture, render
from tests.kit.mitsuba_scenes import floor, look_at, vector

X, Y, Z = np.eye(3)
O = np.zeros(3)  # noqa: E741
GOLD = Conductor(vector(0.2, 0.9, 1.5), vector(3.9, 2.4, 2.0), 0.5)


def metal_value(metal: Conductor, wo: Array, wi: Array) -> Array:
    """BRDF times cosine of unit vectors (..., 3) above z = 0: GGX, height-correlated Smith, exact Fresnel."""

    def masking(w: Array) -> Array:
        tangent2 = (1 - w[..., 2] ** 2) / w[..., 2] ** 2
        return (np.sqrt(1 + metal.alpha**2 * tangent2) - 1) / 2

    h = wi + wo
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    a2 = metal.alpha**2
    spread = a2 / (np.pi * (h[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
    n, c = metal.eta + 1j * metal.k, np.sum(h * wi, axis=-1)[..., None]
    inside = np.sqrt(1 - (1 - c * c) / n**2)
    parallel, senkrecht = (n * c - inside) / (n * c + inside), (c - n * inside) / (c + n * inside)
    fresnel = (np.abs(parallel) ** 2 + np.abs(senkrecht) ** 2) / 2
    return fresnel * (spread / (4 * wo[..., 2] * (1 + masking(wi) + masking(wo))))[..., None]


def metal_floor(metal: Conductor, reverse: bool = False) -> ShapeDescription:
    return dataclasses.replace(floor(reverse=reverse), material=metal)


def from_angles(theta: float | Array, phi: float | Array) -> Array:
    """In the frame whose z is +y: (z, x, y) of the world."""
    return np.stack(
        np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), -1
    )


def to_world(w: Array) -> Array:
    return w[..., [1, 2, 0]]


@pytest.mark.parametrize(
    ("alpha", "angles", "reverse"),
    [
        (0.5, (60, 70, 150), False),
        (1.0, (80, 80, 90), True),
        pytest.param(0.5, (20, 75, 20), False, marks=pytest.mark.slow),
        pytest.param(0.05, (40, 42, 178), True, marks=pytest.mark.slow),
    ],
)
@pytest.mark.usefixtures("mitsuba")
def test_a_metal_reflects_a_direction_as_pbrts(alpha: float, angles: tuple[int, int, int], reverse: bool):
    """Nothing is random: 2e-4 is caught.

    Mitsuba's own metal, whose shadowing is not correlated by height, is 3.6 % off in the first.
    """
    out, into, turn = np.radians(angles)
    metal = dataclasses.replace(GOLD, alpha=alpha)
    wo, wi = from_angles(out, 0.0), from_angles(into, turn)
    camera = look_at(to_world(wo), O, Y)
    given = lit([metal_floor(metal, reverse)], [DistantLight(to_world(wi), vector(1, 2, 3))], (camera, 0.02))
    value, want = picture(given).mean(axis=(0, 1)), metal_value(metal, wo, wi) * (1, 2, 3)
    print(f"relative error {value / want - 1}")
    np.testing.assert_allclose(value, want, rtol=2e-4)


@pytest.mark.parametrize("alpha", [0.3, 0.02])
@pytest.mark.usefixtures("mitsuba")
def test_a_metal_under_a_white_sky_has_its_albedo(alpha: float):
    """By quadrature over the half-vector; at 4 standard errors 0.5 % is caught, a wrong density of its
    samples with it.
    """
    metal, theta = dataclasses.replace(GOLD, alpha=alpha), np.radians(50)
    wo = from_angles(theta, 0.0)
    view = look_at(to_world(wo), O, Y), 0.1
    value, error = render(lit([metal_floor(metal)], [Environment(np.ones(3))], view), 2**14)
    slopes = np.tan(np.linspace(0, np.pi / 2, 4001)[:-1] + np.pi / 16000) * alpha
    turns = (np.arange(720) + 0.5) * 2 * np.pi / 720
    cosine = 1 / np.sqrt(1 + slopes**2)
    h = from_angles(np.arccos(cosine)[:, None], turns[None])
    wi = 2 * np.sum(h * wo, axis=-1, keepdims=True) * h - wo
    up = (wi[..., 2] > 1e-6) & (np.sum(h * wo, axis=-1) > 1e-6)
    # d(slope) = alpha (1 + (slope/alpha)^2) d(angle); dwh = slope cos^3 d(slope) d(turn); dwi = 4 |wo.h| dwh.
    step = alpha * (1 + (slopes / alpha) ** 2) * (np.pi / 8000) * slopes * cosine**3 * (2 * np.pi / 720)
    weight = np.where(up, step[:, None] * 4 * np.abs(np.sum(h * wo, axis=-1)), 0.0)
    want = np.sum(metal_value(metal, wo, np.where(up[..., None], wi, Z)) * weight[..., None], axis=(0, 1))
    print(f"relative error {value / want - 1}, would have caught {(4 * error / want).max():.2%}")
    assert np.all(4 * error < 5e-3 * want)
    assert np.all(np.abs(value - want) < 4 * error + 1e-4 * want)

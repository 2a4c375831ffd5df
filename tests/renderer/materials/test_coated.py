"""Varnish: its limits in closed form, its walks against integrals over the dielectric's BSDF, its energy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from renderer import render
from renderer.interfaces.material import Lobes, lobes_of
from renderer.materials.coated import CoatedMaterials
from renderer.materials.conductor import ConductorMaterials
from renderer.materials.dielectric import DielectricMaterials
from renderer.math.vectors import combine, dot, frame_about, normalize
from renderer.records import SurfaceHit
from renderer.shading.microfacets import fresnel_dielectric
from scenes.description.lights import Environment
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Material
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import ShapeDescription, Sphere

NORMAL = normalize(np.array([[0.3], [-0.5], [-0.7]]))
GRAY, WHITE, BLACK = Diffuse(np.full(3, 0.6)), Diffuse(np.ones(3)), Diffuse(np.zeros(3))
SIGMA = 4.5  # two-sided 7e-6 a comparison
WALKS = 140_000


def shape(material: Material) -> ShapeDescription:
    return ShapeDescription(Sphere(np.zeros(3), 1.0), material)


def local(cosine, phi) -> np.ndarray:
    """Unit vectors (3, n) about the normal."""
    cosine, phi = np.broadcast_arrays(np.atleast_1d(np.asarray(cosine, dtype=float)), phi)
    sine = np.sqrt((1 - cosine) * (1 + cosine))
    return combine(frame_about(NORMAL), sine * np.cos(phi), sine * np.sin(phi), cosine)


def seen(wo: np.ndarray, p: np.ndarray | None = None, front: bool = True) -> SurfaceHit:
    n = wo.shape[1]
    none = np.zeros(n, dtype=np.int64)
    p = np.random.default_rng(7).random((3, n)) if p is None else p
    at = np.repeat(NORMAL, n, axis=1)
    return SurfaceHit(p, at, wo, none, none, none, np.zeros((2, 1)), np.full(n, front))


def value(material: Material, mu_o: float, mu_i: float, turn: float, walks: int = WALKS):
    """The mean and its standard error of f's first channel, over as many points."""
    kind = CoatedMaterials.make([shape(material)])
    wo, wi = (np.repeat(w, walks, axis=1) for w in (local(mu_o, 0.3), local(mu_i, 0.3 + turn)))
    found = kind.evaluate(seen(wo), wi)[0]
    return found.mean(), found.std() / math.sqrt(walks)


def fresnel(cosine: float, eta: float) -> tuple[float, float]:
    """Reflectance, and the cosine beyond, by Snell's and Fresnel's laws in their textbook form."""
    sine = math.sqrt(1 - cosine * cosine) / eta
    if sine >= 1:
        return 1.0, 0.0
    beyond = math.sqrt(1 - sine * sine)
    s = (cosine - eta * beyond) / (cosine + eta * beyond)
    p = (eta * cosine - beyond) / (eta * cosine + beyond)
    return (s * s + p * p) / 2, beyond


def inside_reflectance(eta: float) -> float:
    """What the boundary sends back of diffuse light from inside."""
    node, weight = np.polynomial.legendre.leggauss(200)
    mu = (node + 1) / 2
    return float(sum(w * m * fresnel(m, 1 / eta)[0] for m, w in zip(mu, weight, strict=True)))


VIEWS = [(1.0, 0.9, 2.0), (0.7, 0.4, 1.0), (0.2, 0.8, 3.0)]


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
def test_a_coat_of_no_contrast_and_no_thickness_is_not_there(mu_o: float, mu_i: float, turn: float) -> None:
    mean, error = value(Coated(Dielectric(1.0, 0.0), GRAY, 0.0), mu_o, mu_i, turn, 50)
    assert error < 1e-15 and mean == pytest.approx(0.6 / np.pi, rel=1e-14)


METAL = Conductor(np.array([0.2, 0.5, 1.0]), np.array([3.0, 2.5, 2.0]), 0.3)


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
@pytest.mark.parametrize("brushed", [None, 0.1])
def test_metal_under_a_smooth_coat_is_seen_through_it(
    mu_o: float, mu_i: float, turn: float, brushed: float | None
) -> None:
    """One bounce is the bare metal's f in the medium, at the refracted directions; without contrast the bare
    metal's own.
    """
    metal = replace(METAL, alpha_v=brushed)
    for eta in (1.0, 1.5):
        (f_o, inside_o), (f_i, inside_i) = fresnel(mu_o, eta), fresnel(mu_i, eta)
        coated = CoatedMaterials.make([shape(Coated(Dielectric(eta, 0.0), metal, 0.0, max_depth=1))])
        bare = ConductorMaterials.make([shape(replace(metal, eta=metal.eta / eta, k=metal.k / eta))])
        found = coated.evaluate(seen(local(mu_o, 0.3)), local(mu_i, 0.3 + turn))
        truth = bare.evaluate(seen(local(inside_o, 0.3)), local(inside_i, 0.3 + turn))
        np.testing.assert_allclose(found, truth * (1 - f_o) * (1 - f_i) / eta**2, rtol=1e-9)


@pytest.mark.parametrize(
    "coat", [Dielectric(1.5, 0.3), Dielectric(1.5, 0.4, alpha_v=0.1), Dielectric(1.2, 0.05)]
)
def test_over_black_the_coat_is_the_reflection_of_glass_alone(coat: Dielectric) -> None:
    rng = np.random.default_rng(2)
    wo, wi = (local(rng.random(500), rng.random(500) * 7) for _ in range(2))
    # The dielectric's frame is dp/du's where it is anisotropic, and both of them take the same.
    kind, glass = CoatedMaterials.make([shape(Coated(coat, BLACK))]), DielectricMaterials.make([shape(coat)])
    hit = seen(wo)
    assert kind.evaluate(hit, wi).any()
    np.testing.assert_allclose(kind.evaluate(hit, wi), glass.evaluate(hit, wi), rtol=1e-8)


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
@pytest.mark.parametrize("thickness", [0.0, 0.2])
def test_one_bounce_under_a_smooth_coat_is_known(
    mu_o: float, mu_i: float, turn: float, thickness: float
) -> None:
    """T_o T_i R / (pi eta^2), absorbed on both ways: without noise, to rounding."""
    mean, error = value(Coated(Dielectric(1.5, 0.0), GRAY, thickness, max_depth=1), mu_o, mu_i, turn, 50)
    (f_o, inside_o), (f_i, inside_i) = fresnel(mu_o, 1.5), fresnel(mu_i, 1.5)
    absorbed = math.exp(-thickness / inside_o - thickness / inside_i)
    assert error < 1e-15
    assert mean == pytest.approx((1 - f_o) * (1 - f_i) * absorbed * 0.6 / (np.pi * 2.25), rel=1e-12)


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
def test_all_bounces_under_a_smooth_coat_are_a_geometric_series(
    mu_o: float, mu_i: float, turn: float
) -> None:
    """f = T_o T_i R / (pi eta^2 (1 - R r)), r being the coat's reflectance of diffuse light from inside.

    Catches 1 % of f, and 2.5 % of what later bounces add.
    """
    mean, error = value(Coated(Dielectric(1.5, 0.0), GRAY, 0.0, max_depth=60), mu_o, mu_i, turn)
    ways = (1 - fresnel(mu_o, 1.5)[0]) * (1 - fresnel(mu_i, 1.5)[0])
    truth = ways * 0.6 / (np.pi * 2.25 * (1 - 0.6 * inside_reflectance(1.5)))
    assert error * SIGMA < 0.01 * truth
    assert abs(mean - truth) < SIGMA * error


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
@pytest.mark.usefixtures("statistical")
def test_light_scattered_once_in_the_layer_is_chandrasekhars(mu_o: float, mu_i: float, turn: float) -> None:
    """a p (1 - exp(-t (1/mu_o + 1/mu_i))) / (mu_o + mu_i), over black, without contrast. Catches 1 %."""
    thickness, g = 0.7, 0.5
    medium = Coated(Dielectric(1.0, 0.0), BLACK, thickness, np.full(3, 0.8), g, max_depth=1)
    mean, error = value(medium, mu_o, mu_i, turn, 450_000)
    forward = -float(dot(local(mu_o, 0.3), local(mu_i, 0.3 + turn))[0])
    phase = (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * forward) ** 1.5)
    gone = -math.expm1(-thickness * (1 / mu_o + 1 / mu_i))
    truth = 0.8 * phase * gone / (mu_o + mu_i)
    assert error * SIGMA < 0.01 * truth
    assert abs(mean - truth) < SIGMA * error


def way_out(
    coat: Dielectric, wi: np.ndarray, mu: np.ndarray, phi: np.ndarray, inner: np.ndarray, pbrt: bool = True
) -> np.ndarray:
    """f of light along wi (3, 1) that leaves a layer along -w, times the weights of both techniques at w.

    w: (3, n) by cosine and angle, upwards. inner: (n,) the density of w from inside. All from the
    dielectric's BSDF and densities, seen from either side, none from the walks. pbrt: whether the second
    weight is pbrt's, of the density of wi given w.
    """
    glass = DielectricMaterials.make([shape(coat)])
    w = local(mu, phi)
    wi = np.repeat(wi, mu.size, axis=1)
    out = seen(-w, front=True)
    # The normal of a hit lies on the side of wo: from inside it is the other one, and the medium is behind.
    inside = replace(out, n=-out.n, front=np.zeros(mu.size, dtype=np.bool_))
    f = glass.evaluate(inside, wi)[0]
    m = normalize(wi / coat.eta - w)
    m = np.where(dot(m, NORMAL) < 0, -m, m)
    through = 1.0 - fresnel_dielectric(np.clip(dot(wi, m), 0.0, 1.0), np.full(mu.size, coat.eta))[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        w_given_wi = np.where(through > 0, glass.pdf(seen(wi), -w) / through, 0.0)
        wi_given_w = np.where(through > 0, glass.pdf(inside, wi) / through, 0.0)
    first = w_given_wi**2 / np.maximum(w_given_wi**2 + inner**2, 1e-300)
    other = wi_given_w if pbrt else w_given_wi
    return f * (first + inner**2 / np.maximum(other**2 + inner**2, 1e-300))


def hemisphere(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cosines, angles and solid angles of Gauss and Legendre's nodes."""
    node, weight = np.polynomial.legendre.leggauss(count)
    mu, phi = np.broadcast_arrays(((node + 1) / 2)[:, None], np.pi * (node + 1))
    return mu.ravel(), phi.ravel(), (weight[:, None] / 2 * weight * np.pi).ravel()


@pytest.mark.parametrize("thickness", [0.0, 0.4])
@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
def test_a_rough_coat_lets_light_through_as_its_integral_and_pbrts_weights_say(
    mu_o: float, mu_i: float, turn: float, thickness: float
) -> None:
    """One bounce: what enters along wo, times R / pi, times what leaves towards wi, both by quadrature.

    Catches 1 %. Weights that add up to 1 would give another value, by more than that.
    """
    coat = Dielectric(1.5, 0.5)
    mean, error = value(Coated(coat, GRAY, thickness, max_depth=1), mu_o, mu_i, turn)
    glass = DielectricMaterials.make([shape(coat)])
    mu, phi, area = hemisphere(150)
    area = area * np.exp(-thickness / mu)  # what the layer lets through, on either way
    wo = np.repeat(local(mu_o, 0.3), mu.size, axis=1)
    entered = (glass.evaluate(seen(wo), -local(mu, phi))[0] * mu * area).sum()
    wi = local(mu_i, 0.3 + turn)
    left, right = ((way_out(coat, wi, mu, phi, mu / np.pi, one) * mu * area).sum() for one in (True, False))
    coated = CoatedMaterials.make([shape(Coated(coat, BLACK))])
    mirrored = coated.evaluate(seen(local(mu_o, 0.3)), wi)[0, 0]
    truth = mirrored + entered * 0.6 / np.pi * left
    assert error * SIGMA < 0.01 * truth
    assert abs(mean - truth) < SIGMA * error + 1e-4 * truth
    assert abs(left / right - 1) > 0.01


@pytest.mark.parametrize(("mu_o", "mu_i", "turn"), VIEWS)
def test_light_scattered_once_under_a_rough_coat_is_its_integral(
    mu_o: float, mu_i: float, turn: float
) -> None:
    """What comes down to a height, times albedo / (4 pi), times what leaves from there. Catches 2 %."""
    coat, thickness = Dielectric(1.5, 0.5), 0.7
    medium = Coated(coat, BLACK, thickness, np.full(3, 0.8), 0.0, max_depth=1)
    mean, error = value(medium, mu_o, mu_i, turn)
    glass = DielectricMaterials.make([shape(coat)])
    mu, phi, area = hemisphere(150)
    wi = local(mu_i, 0.3 + turn)
    entering = glass.evaluate(seen(np.repeat(local(mu_o, 0.3), mu.size, axis=1)), -local(mu, phi))[0] * area
    leaving = way_out(coat, wi, mu, phi, np.full(mu.size, 1 / (4 * np.pi))) * area
    node, weight = np.polynomial.legendre.leggauss(30)
    depth = thickness * (node + 1) / 2
    crossed = np.exp(-depth[:, None] / mu)
    scattered = ((crossed @ entering) * (crossed @ leaving) * weight).sum() * thickness / 2
    mirrored = CoatedMaterials.make([shape(Coated(coat, BLACK))]).evaluate(seen(local(mu_o, 0.3)), wi)[0, 0]
    truth = mirrored + 0.8 / (4 * np.pi) * scattered
    assert error * SIGMA < 0.02 * truth
    assert abs(mean - truth) < SIGMA * error + 1e-4 * truth


def test_a_coat_over_a_mirror_is_one_mirror() -> None:
    """F + T^2 B / (1 - F B), B the mirror's reflectance in the medium, absorbed on the way down and up."""
    silver = Conductor(np.array([0.2, 0.5, 1.0]), np.array([3.0, 2.5, 2.0]), 0.0)
    kind = CoatedMaterials.make([shape(Coated(Dielectric(1.5, 0.0), silver, 0.1, max_depth=200))])
    for mu in (1.0, 0.6, 0.1):
        hit = seen(np.repeat(local(mu, 0.3), 100, axis=1))
        sample = kind.sample(hit, np.random.default_rng(1).random((2, 100)))
        assert sample.specular is not None and sample.specular.all() and (sample.pdf == 1).all()
        f, inside = fresnel(mu, 1.5)
        metal = ConductorMaterials.make([shape(replace(silver, eta=silver.eta / 1.5, k=silver.k / 1.5))])
        bare = metal.sample(seen(local(inside, 0.0)), np.zeros((2, 1)))
        base = bare.value[:, 0] * inside * math.exp(-0.2 / inside)
        share = sample.value[:, 0] * mu
        np.testing.assert_allclose(share, f + (1 - f) ** 2 * base / (1 - f * base), rtol=1e-9)
        assert not kind.evaluate(hit, sample.wi).any()


@pytest.mark.parametrize("alpha", [0.0, 0.02, 0.3, 1.0])
@pytest.mark.parametrize("mu", [1.0, 0.5, 0.1])
@pytest.mark.usefixtures("statistical")
def test_white_under_a_coat_gains_no_energy(alpha: float, mu: float) -> None:
    """A smooth coat over white loses none either: its share is 1, to 0.5 %."""
    kind = CoatedMaterials.make([shape(Coated(Dielectric(1.5, alpha), WHITE, 0.0, max_depth=120))])
    n = 40_000
    hit = seen(np.repeat(local(mu, 0.3), n, axis=1))
    sample = kind.sample(hit, np.random.default_rng(3).random((2, n)))
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(sample.pdf > 0, sample.value[0] * np.abs(dot(sample.wi, NORMAL)) / sample.pdf, 0.0)
    share, error = weight.mean(), weight.std() / math.sqrt(n)
    assert share < 1 + SIGMA * error
    assert error < 0.006
    if alpha == 0:
        assert abs(share - 1) < SIGMA * error


def test_a_walk_is_the_same_to_all_who_ask_and_another_at_another_point() -> None:
    """Both techniques of MIS must see one f; pixels must not share their noise."""
    kind = CoatedMaterials.make([shape(Coated(Dielectric(1.5, 0.3), GRAY))])
    wo, wi = (np.repeat(local(mu, 0.3), 1000, axis=1) for mu in (0.8, 0.6))
    one, same = seen(wo), seen(wo, np.zeros((3, 1000)))
    assert np.array_equal(kind.evaluate(one, wi), kind.evaluate(one, wi))
    assert np.unique(kind.evaluate(same, wi)[0]).size == 1
    noise = kind.evaluate(one, wi)[0]
    assert np.unique(noise).size > 900
    # Neighbours in a row of points are as good as independent: 4.5 / sqrt(1000).
    assert abs(np.corrcoef(noise[:-1], noise[1:])[0, 1]) < 0.15


def test_more_samples_are_a_mean_of_walks() -> None:
    """Four walks have half the noise of one, and its mean."""
    once, error = value(Coated(Dielectric(1.5, 0.3), GRAY), 0.8, 0.6, 1.0, 20_000)
    often, less = value(Coated(Dielectric(1.5, 0.3), GRAY, samples=4), 0.8, 0.6, 1.0, 20_000)
    assert abs(once - often) < SIGMA * math.hypot(error, less)
    assert less == pytest.approx(error / 2, rel=0.1)


def test_lobes_tell_smooth_coats_from_rough_ones() -> None:
    smooth, rough = (lobes_of(shape(Coated(Dielectric(1.5, alpha), GRAY))) for alpha in (0.0, 0.3))
    assert smooth == rough | Lobes.SPECULAR
    assert rough == Lobes.REFLECTION | Lobes.GLOSSY


@pytest.mark.parametrize("estimator", ["bsdf", "cosine", "mis", "environment"])
@pytest.mark.usefixtures("statistical")
def test_every_estimator_sees_a_smooth_coat_whole(estimator: str) -> None:
    """Under an even sky the radiance is F + T R (1 - r) / (1 - R r), delta lobe included. Catches 3 %."""
    mu, eta, r = math.cos(0.8), 1.5, inside_reflectance(1.5)
    matrix = np.eye(4)
    forward = np.array([0.0, -mu, math.sin(0.8)])
    right = np.array([1.0, 0.0, 0.0])
    matrix[:3] = np.stack(
        [right, np.cross(forward, right), forward, np.array([0, 1.0, 0]) - 2 * forward], axis=1
    )
    coated = Coated(Dielectric(eta, 0.0), GRAY, 0.0, max_depth=60)
    ball = ShapeDescription(Sphere(np.zeros(3), 1.0), coated)
    scene = SceneDescription(
        "coat",
        PerspectiveCamera(matrix, fov=1e-3),
        Film(64, 64),
        (ball,),
        (Environment(np.array([3.0, 2.0, 1.0])),),
    )
    f, _ = fresnel(mu, eta)
    truth = (f + (1 - f) * 0.6 * (1 - r) / (1 - 0.6 * r)) * np.array([3.0, 2.0, 1.0])
    found = render(scene, estimator=estimator, spp=16, seed=3)
    error = np.sqrt(found.variance.mean(axis=(0, 1)) / 64**2)
    assert (SIGMA * error < 0.03 * truth).all()
    assert (np.abs(found.image.mean(axis=(0, 1)) - truth) < SIGMA * error).all()


@pytest.mark.parametrize("which", ["p", "wo", "wi"])
def test_walks_are_of_the_point_and_of_both_directions(which: str) -> None:
    """A change of 1e-9 draws other numbers, and leaves f's mean where it was."""
    kind = CoatedMaterials.make([shape(Coated(Dielectric(1.5, 0.2), GRAY))])
    p, wo, wi = np.full((3, 1), 0.5), local(0.7, 0.3), local(0.6, 2.0)
    first = kind.evaluate(seen(wo, p), wi)
    if which == "p":
        p = p + 1e-9
    elif which == "wo":
        wo = local(0.7, 0.3 + 1e-9)
    else:
        wi = local(0.6, 2.0 + 1e-9)
    assert np.abs(kind.evaluate(seen(wo, p), wi) / first - 1).max() > 1e-5


@pytest.mark.parametrize(
    "base", [GRAY, Conductor(np.full(3, 0.2), np.full(3, 4.0), 0.0)], ids=["gray", "mirror"]
)
def test_delta_lobes_drawn_alone_are_those_of_whole_samples(base: Material) -> None:
    """To the bit, for rows of a smooth coat and of a rough one; the rough one has none."""
    coats = [shape(Coated(Dielectric(1.5, alpha), base, max_depth=3)) for alpha in (0.0, 0.3)]
    kind, rng = CoatedMaterials.make(coats), np.random.default_rng(5)
    hit = seen(local(rng.uniform(0.1, 1.0, 2000), rng.uniform(0, 6, 2000)))
    hit, u = replace(hit, shape=np.arange(2000) % 2), rng.random((2, 2000))
    whole, alone = kind.sample(hit, u), kind.sample_delta_lobes(hit, u)
    rows = np.flatnonzero(whole.specular)
    assert 200 < rows.size < 1001
    assert not (rows % 2).any()
    np.testing.assert_array_equal(np.flatnonzero(alone.pdf), rows)
    for part in ("wi", "value", "pdf", "specular"):
        np.testing.assert_array_equal(getattr(alone, part)[..., rows], getattr(whole, part)[..., rows])

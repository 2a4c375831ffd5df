"""Materials with delta and transmissive lobes, which this test alone knows, by every estimator.

No estimator names a material, so that these must come out right without a line of theirs: closed forms of
constant environments, of point lights and of a sphere in the mirror.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from renderer import render
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from renderer.interfaces.material import MATERIALS, Lobes, MaterialExample
from renderer.math.vectors import Floats, combine, dot, frame_about
from renderer.math.warp import cosine_hemisphere
from renderer.records import BSDFSample, SurfaceHit
from scenes.description.lights import Environment, PointLight
from scenes.description.materials import Diffuse
from scenes.description.shapes import ShapeDescription, Sphere
from tests.kit.scenes import box, floor, light, scene

RGB = np.array([3.0, 2.0, 1.0])
EYE = np.array([0.0, 2.0, -2.0])  # at 45 degrees: the mirrored ray leaves the origin towards (0, 1, 1)
DEPTH = 1.5
NAMES = [n for n in ESTIMATORS.names() if ESTIMATORS[n].quantity == RADIANCE]
# Light samples of these go to one side of a surface only, or closed forms hold for Lambertian surfaces only.
REFUSE_TRANSMISSION = {"projected-solid-angle", "analytic-visibility", "analytic-visibility-unbiased"}


@dataclass(frozen=True, eq=False)
class Layered(Diffuse):
    """A share `mirror` that is reflected as by a mirror, (3,) `through` that is scattered to the other side.

    The rest of the description, `reflectance` (3,), is Lambertian.
    """

    mirror: float = 0.0
    through: float = 0.0


@dataclass(frozen=True, eq=False)
class LayeredMaterials:
    """mirror, through: (s,). value: (3, s), the Lambertian part over pi."""

    mirror: Floats
    through: Floats
    value: Floats

    @classmethod
    def accepts(cls, shape: ShapeDescription) -> bool:
        return type(shape.material) is Layered

    @classmethod
    def lobes(cls, shape: ShapeDescription) -> Lobes:
        m = shape.material
        reflection = Lobes.REFLECTION | Lobes.DIFFUSE if m.reflectance.any() else Lobes.NONE
        mirror = Lobes.REFLECTION | Lobes.SPECULAR if m.mirror else Lobes.NONE
        return reflection | mirror | (Lobes.TRANSMISSION | Lobes.DIFFUSE if m.through else Lobes.NONE)

    @classmethod
    def make(cls, shapes) -> LayeredMaterials:
        none = Layered(np.zeros(3))
        own = [s.material if cls.accepts(s) else none for s in shapes]
        value = np.stack([m.reflectance for m in own], axis=1) / np.pi
        return cls(np.array([m.mirror for m in own]), np.array([m.through for m in own]), value)

    def evaluate(self, hit: SurfaceHit, wi: Floats) -> Floats:
        through = self.through[hit.shape] / np.pi
        return np.where(dot(wi, hit.n) > 0, self.value[:, hit.shape], through)

    def _chances(self, hit: SurfaceHit) -> tuple[Floats, Floats]:
        """Of the mirror, and of the other side among what is left."""
        return np.where(self.mirror[hit.shape] > 0, 0.25, 0.0), np.where(
            self.through[hit.shape] > 0, 0.5, 0.0
        )

    def sample(self, hit: SurfaceHit, u: Floats) -> BSDFSample:
        mirror, under = self._chances(hit)
        specular = u[0] < mirror
        rest = np.where(specular, 0.0, (u[0] - mirror) / (1 - mirror))
        below = rest < under
        rest = np.where(below, rest / np.maximum(under, 0.5), (rest - under) / (1 - under))
        axis = np.where(below, -hit.n, hit.n)
        local = cosine_hemisphere(np.stack([np.clip(rest, 0.0, 1 - 2.0**-53), u[1]]))
        wi = combine(frame_about(axis), *local)
        cosine = dot(hit.wo, hit.n)
        wi = np.where(specular, 2 * cosine * hit.n - hit.wo, wi)
        value = np.where(specular, self.mirror[hit.shape] / cosine, self.evaluate(hit, wi))
        return BSDFSample(wi, value, np.where(specular, mirror, self.pdf(hit, wi)), specular)

    def pdf(self, hit: SurfaceHit, wi: Floats) -> Floats:
        mirror, under = self._chances(hit)
        cosine = dot(wi, hit.n)
        return (1 - mirror) * np.where(cosine > 0, 1 - under, under) * np.abs(cosine) / np.pi

    @classmethod
    def examples(cls) -> list[MaterialExample]:
        return []


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    MATERIALS.names()
    monkeypatch.setitem(MATERIALS._entries, "layered", LayeredMaterials)
    yield


def seen(material, estimator: str, shapes=(), lights=(), spp: int = 64):
    """Mean and standard error, each (3,), at the origin of a floor of some material, beside gray shapes."""
    given = scene(
        [floor(material=material), *shapes], eye=EYE, target=(0.0, 0.0, 0.0), width=8, height=8, fov=1e-4
    )
    given = replace(given, lights=tuple(lights))
    assert not ESTIMATORS[estimator].refuses(given)
    result = render(given, estimator=estimator, spp=spp, seed=11)
    pixels = result.image.reshape(-1, 3)
    return pixels.mean(axis=0), np.sqrt(result.variance.reshape(-1, 3).sum(axis=0)) / len(pixels)


def agrees(found, expected) -> None:
    mean, error = found
    print("smallest bias caught", 4.5 * error / np.maximum(expected, 1e-300))
    assert (np.abs(mean - expected) <= 4.5 * error + 1e-9).all(), (mean, error, expected)


def takes(estimator: str, material) -> bool:
    """Whether an estimator is for such floors; one that is not says why."""
    given = replace(scene([floor(material=material)]), lights=(PointLight(np.ones(3), RGB),))
    if ESTIMATORS[estimator].refuses(replace(given, shapes=())):
        given = replace(given, lights=(Environment(RGB),))
    why = ESTIMATORS[estimator].refuses(given)
    closed = estimator.startswith("analytic")
    refuses = closed and (material.mirror or material.through)
    assert (why is not None) == bool(refuses or (estimator in REFUSE_TRANSMISSION and material.through))
    assert why is None or ("diffuse" if closed else "transmit") in why
    return why is None


MIRROR, COATED = Layered(np.zeros(3), mirror=0.8), Layered(np.array([0.4, 0.2, 0.1]), mirror=0.3)
CLOTH, LEAF = Layered(np.zeros(3), through=0.6), Layered(np.array([0.3, 0.2, 0.1]), through=0.4)
ALL = [
    pytest.param(m, id=n)
    for n, m in {"mirror": MIRROR, "coated": COATED, "cloth": CLOTH, "leaf": LEAF}.items()
]


@pytest.mark.parametrize("estimator", NAMES)
@pytest.mark.parametrize("material", ALL)
def test_a_constant_environment_gives_the_albedo(material: Layered, estimator: str) -> None:
    """Each lobe returns its share of a light that is the same from everywhere; nothing is counted twice."""
    given = replace(scene([floor(material=material)]), lights=(Environment(RGB),))
    if not takes(estimator, material) or ESTIMATORS[estimator].refuses(given):
        return
    share = material.reflectance + material.mirror + material.through
    agrees(seen(material, estimator, lights=[Environment(RGB)]), share * RGB)


@pytest.mark.parametrize("estimator", [n for n in NAMES if n != "environment" and n != "mis-compensated"])
@pytest.mark.parametrize("side", [1, -1], ids=["light above", "light below"])
@pytest.mark.parametrize("material", ALL)
def test_a_point_light_reaches_the_lobes_of_its_side(material: Layered, side: int, estimator: str) -> None:
    """A delta lobe never meets a light of one direction; a light below counts where the floor transmits."""
    if not takes(estimator, material):
        return
    lamp = PointLight(np.array([0.0, side * DEPTH, 0.0]), RGB)
    share = material.reflectance if side > 0 else np.full(3, material.through)
    agrees(seen(material, estimator, lights=[lamp]), share / np.pi * RGB / DEPTH**2)


@pytest.mark.parametrize("estimator", [n for n in NAMES if n not in ("environment", "mis-compensated")])
@pytest.mark.parametrize("material", ALL)
@pytest.mark.parametrize("blocked", [False, True], ids=["clear", "blocked"])
def test_a_ball_below_and_a_ball_in_the_mirror(material: Layered, blocked: bool, estimator: str) -> None:
    """Irradiance pi L (r/d)^2 of the one below; L of the one that the mirrored ray meets, unless hidden."""
    if not takes(estimator, material) or ESTIMATORS[estimator].refuses(balls(material)):
        return
    above, below = balls(material).shapes[1:]
    hides = [box((0.0, 0.5, 0.5), 0.05), box((0.0, -0.5, 0.0), 0.4)] if blocked else []
    result = seen(material, estimator, [above, below, *hides], spp=256)
    square = (0.5 / DEPTH) ** 2
    under = 0.0 if blocked else material.through * square
    # The ball above is at a distance of 3 under 45 degrees; the small box hides the mirrored ray alone.
    direct = material.reflectance * (0.5 / 3.0) ** 2 * np.sqrt(0.5)
    if blocked and material.reflectance.any():
        return
    agrees(result, RGB * (under + direct + (0.0 if blocked else material.mirror)))


def balls(material: Layered):
    """A floor, a ball light in the mirror direction of the camera, and one below."""
    above = light(Sphere(np.array([0.0, 3.0, 3.0]) * np.sqrt(0.5), 0.5), RGB)
    return scene([floor(material=material), above, light(Sphere(np.array([0.0, -DEPTH, 0.0]), 0.5), RGB)])

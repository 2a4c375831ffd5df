"""The contact ladder: a light approaches a point decade by decade; a closed form checks each estimator.

Points are exact, without camera or BVH; receiver and light are kept out of their own shadows by identity, so
that what is tested is the estimator's arithmetic alone, from a distance of the light's size to 1e-8 of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from pipeline.references.closed_form.radiometry import disk_irradiance, polygon_irradiance, sphere_irradiance
from pipeline.statistics.samples import sample_verdict
from renderer import RenderScene, build
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE
from renderer.interfaces.sampler import SAMPLERS
from renderer.plan.plan import RenderPlan, make_plan
from renderer.records import SurfaceHit
from renderer.shading.delta_lobes import dimensions, reflected_light
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import (
    Array,
    BilinearMesh,
    Disk,
    Emission,
    Geometry,
    ShapeDescription,
    Sphere,
    TriangleMesh,
)
from scenes.errors import PenumbraError

RUNGS = tuple(10.0**-k for k in range(9))
GEOMETRIES = ("parallel", "upright")
REFLECTANCE, LE = 0.5, 1.0
UP = np.array([0.0, 1.0, 0.0])


class Rung(BaseModel):
    """One estimator at one distance h, in units of the light's size.

    truth, mean, se: reflected radiance, W/(m^2 sr). mean, se and max_share are None if the estimator does not
    apply. hill: None without a tail.
    """

    model_config = ConfigDict(frozen=True, ser_json_inf_nan="null")

    light: str
    geometry: str
    estimator: str
    h: float
    truth: float
    mean: float | None
    se: float | None
    max_share: float | None
    hill: float | None
    nonfinite: int
    verdict: Literal["ok", "untrustworthy", "refused"]
    reason: str


@dataclass(frozen=True, eq=False)
class Setting:
    """A light, the point that looks at it, and the irradiance there in closed form."""

    geometry: Geometry
    point: Array
    irradiance: float


def rectangle(geometry: str, h: float) -> Setting:
    """1 x 1, overhead at height h, or standing on the floor at distance h."""
    if geometry == "parallel":
        corners = np.array([[-0.5, h, -0.5], [0.5, h, -0.5], [-0.5, h, 0.5], [0.5, h, 0.5]])
        point = np.zeros(3)
    else:
        corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [-0.5, 1, 0], [0.5, 1, 0]], dtype=np.float64)
        point = np.array([0, 0, h])
    e = polygon_irradiance(point[None], UP, corners[[0, 1, 3, 2]])
    return Setting(BilinearMesh(corners, np.array([[0, 1, 2, 3]])), point, float(e[0]))


def disk(geometry: str, h: float) -> Setting:
    """A disk of diameter 1, overhead at height h, or standing on the floor at distance h."""
    center = np.array([0, h, 0]) if geometry == "parallel" else np.array([0, 0.5, 0])
    normal = np.array([0.0, -1, 0]) if geometry == "parallel" else np.array([0.0, 0, 1])
    point = np.zeros(3) if geometry == "parallel" else np.array([0, 0, h])
    e = disk_irradiance(point[None], UP, center, normal, 0.5)
    return Setting(Disk(center, normal, 0.5), point, float(e[0]))


def sphere(geometry: str, h: float) -> Setting:
    """A sphere of diameter 1, its lowest point at height h, or standing on the floor at distance h."""
    center = np.array([0, h + 0.5, 0]) if geometry == "parallel" else np.array([0, 0.5, 0])
    point = np.zeros(3) if geometry == "parallel" else np.array([0, 0, h])
    e = sphere_irradiance(point[None], UP, center, 0.5)
    return Setting(Sphere(center, 0.5), point, float(e[0]))


def triangle(geometry: str, h: float) -> Setting:
    """Half of the rectangle's unit square, its centroid overhead at height h, or standing on one edge."""
    if geometry == "parallel":
        corners = np.array([[-1 / 3, h, -1 / 3], [2 / 3, h, -1 / 3], [-1 / 3, h, 2 / 3]])
        point = np.zeros(3)
    else:
        corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.0, 1, 0]])
        point = np.array([0, 0, h])
    e = polygon_irradiance(point[None], UP, corners)
    return Setting(TriangleMesh(corners, np.array([[0, 1, 2]])), point, float(e[0]))


LIGHTS = {"rectangle": rectangle, "disk": disk, "sphere": sphere, "triangle": triangle}


def climb(
    lights: Sequence[str] = tuple(LIGHTS),
    samples: int = 2**15,
    seed: int = 0,
    rungs: Sequence[float] = RUNGS,
    estimators: Sequence[str] | None = None,
) -> Iterator[Rung]:
    """Yield the rungs of every light and geometry by the named estimators, or by all.

    PenumbraError for an unknown light or estimator, a negative seed, or fewer than 100 samples.
    """
    names = (
        [n for n, one in ESTIMATORS.items() if one.quantity == RADIANCE] if estimators is None else estimators
    )
    for name in names:
        if ESTIMATORS[name].quantity != RADIANCE:
            raise PenumbraError(f"no ladder for estimator {name!r}: its quantity is another")
    for name in lights:
        if name not in LIGHTS:
            raise PenumbraError(f"no ladder for light {name!r}; there are: {', '.join(LIGHTS)}")
    if seed < 0:
        raise PenumbraError(f"seed is {seed}: seeds are 0 or more")
    if samples < 100:
        raise PenumbraError(f"{samples} samples: the verdict on a tail needs at least 100")
    for name in lights:
        for geometry in GEOMETRIES:
            for h in rungs:
                yield from _rungs(name, geometry, h, samples, seed, names)


def _rungs(
    name: str, geometry: str, h: float, samples: int, seed: int, estimators: Sequence[str]
) -> Iterator[Rung]:
    setting = LIGHTS[name](geometry, h)
    scene = _scene(setting.geometry)
    built = build(scene)
    # Neither the floor nor the light, both known by identity, shades what passes between them.
    plan = make_plan(built, prune=False)
    plan = replace(plan, shadow=np.zeros_like(plan.shadow))
    for label in estimators:
        why = ESTIMATORS[label].refuses(scene)
        truth = REFLECTANCE / np.pi * LE * setting.irradiance
        shared = {"light": name, "geometry": geometry, "estimator": label, "h": h, "truth": truth}
        if why:
            empty = {"mean": None, "se": None, "max_share": None, "hill": None, "nonfinite": 0}
            yield Rung.model_validate(shared | empty | {"verdict": "refused", "reason": why})
            continue
        values = _samples(built, plan, setting.point, label, samples, seed)
        yield Rung.model_validate(shared | _judged(values))


def _judged(values: Array) -> dict[str, object]:
    verdict = sample_verdict(values)
    finite = values[np.isfinite(values)]
    found = bool((values != 0).any())
    nothing = f"not one of {values.size:,} samples found the light"
    return {
        "mean": float(values.mean()),
        "se": float(values.std(ddof=1) / np.sqrt(values.size)),
        "max_share": verdict.max_share,
        "hill": verdict.hill if verdict.hill is not None and np.isfinite(verdict.hill) else None,
        "nonfinite": int(values.size - finite.size),
        "verdict": verdict.verdict if found else "untrustworthy",
        "reason": verdict.reason if found else nothing,
    }


def _samples(
    built: RenderScene, plan: RenderPlan, point: Array, estimator: str, count: int, seed: int
) -> Array:
    """(count,) samples of the radiance that the floor reflects at a point (3,)."""
    p = np.repeat(point[:, None], count, axis=1)
    n = np.repeat(UP[:, None], count, axis=1)
    floor, first, none = (np.full(count, i) for i in (0, 0, -1))
    hit = SurfaceHit(p, n, n, floor, first, none, np.zeros((2, 1)))
    u = SAMPLERS["independent"](seed, count).uniform(
        np.zeros(count, dtype=np.int64), np.arange(count), 2, dimensions(ESTIMATORS[estimator], built)
    )
    found = reflected_light(ESTIMATORS[estimator], built, plan, hit, u)
    if found.ratio is None:
        return found.radiance[1]
    closed, unshadowed = (part[1] for part in found.ratio)
    return closed * (found.radiance[1].mean() / unshadowed.mean())


def _scene(light: Geometry) -> SceneDescription:
    """A floor at y = 0, a light, and an unused camera."""
    corners = np.array([[-2.0, 0, -2], [-2, 0, 2], [2, 0, 2], [2, 0, -2]])
    floor = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    shapes = (
        ShapeDescription(floor, Diffuse(np.full(3, REFLECTANCE))),
        ShapeDescription(light, Diffuse(np.zeros(3)), Emission(np.full(3, LE))),
    )
    return SceneDescription("contact ladder", PerspectiveCamera(np.eye(4), 40.0), Film(1, 1), shapes)

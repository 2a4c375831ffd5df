"""Every direction that an estimator samples from the points seen in one pixel, and whether light arrives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer import RenderScene, render
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

IDLE, HIDDEN, SEEN = range(3)
WORDS = ("of no use: below the horizon, or no light there", "hidden: something lies in between", "arrive")
OPEN_WORDS = ("of no use", "something is there", "open")  # of ambient occlusion


@dataclass(frozen=True, eq=False)
class Tried:
    """The n samples that were taken from points seen in a pixel.

    start, end: (n, 3); a hidden sample ends on the surface that hides the light. state: (n,), IDLE, HIDDEN or
    SEEN. far: (n,), whether it goes to a light at infinity; it then ends just beyond the scene. spp: camera
    rays. words: for each state.
    """

    start: Floats
    end: Floats
    state: NDArray[np.int64]
    far: NDArray[np.bool_]
    spp: int
    words: tuple[str, str, str]

    def count(self, state: int) -> int:
        """The number of samples of this state."""
        return int(np.count_nonzero(self.state == state))


def try_pixel(
    scene: RenderScene,
    estimator: str,
    pixel: tuple[int, int],
    spp: int,
    seed: int,
    reach: float,
    sampler: str,
) -> Tried:
    """Render one pixel without pruning, and record every sample that the estimator draws.

    pixel: (x, y) from the top left. spp: camera rays. reach: length to draw samples to infinity with, in
    world units. The random numbers are those of an image's first pixel. PenumbraError if the pixel is not in
    the image, or the estimator does not apply to the scene.
    """
    x, y = pixel
    camera = scene.camera
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        raise PenumbraError(f"pixel {x},{y} is not in the image of {camera.width} x {camera.height} pixels")
    one = replace(camera, corner=camera.corner + camera.du * x + camera.dv * y, width=1, height=1)
    recorder = _recorder(ESTIMATORS[estimator])
    alone = replace(scene, camera=one)
    render(alone, estimator=recorder, sampler=sampler, spp=spp, seed=seed, prune=False)
    words = WORDS if recorder.quantity == "radiance" else OPEN_WORDS
    parts = [_drawn(scene, *told, reach) for told in recorder.told]
    none = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))
    start, end, state, far = (np.concatenate(columns) for columns in zip(none, *parts, strict=True))
    return Tried(start, end, state, far, spp, words)


Told = tuple[SurfaceHit, Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class _Recorder(Estimator):
    """An estimator that records all that the inner one samples."""

    inner: Estimator
    told: list[Told]

    def refuses(self, scene: SceneDescription) -> str | None:
        return self.inner.refuses(scene)

    def dimensions(self, scene: RenderScene) -> int:
        return self.inner.dimensions(scene)

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        return self.inner.estimate(scene, replace(plan, witness=self._witness), hit, u)

    def _witness(
        self, hit: SurfaceHit, wi: Floats, dist: Floats, useful: NDArray[np.bool_], hidden: NDArray[np.bool_]
    ) -> None:
        self.told.append((hit, wi, dist, useful, hidden))


def _recorder(inner: Estimator) -> _Recorder:
    return _Recorder(inner.name, inner.title, inner, [], quantity=inner.quantity, ratio=inner.ratio)


def _drawn(
    scene: RenderScene,
    hit: SurfaceHit,
    wi: Floats,
    dist: Floats,
    useful: NDArray[np.bool_],
    hidden: NDArray[np.bool_],
    reach: float,
) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.bool_]]:
    """The columns start, end, state and far of `Tried`; rows without a direction are left out."""
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.flatnonzero(np.abs((wi * wi).sum(axis=0) - 1.0) < 1e-6)
    hit, wi = hit.take(rows), wi.take(rows, axis=1)
    dist, useful, hidden = dist[rows], useful[rows], hidden[rows]
    state = np.where(hidden, HIDDEN, np.where(useful, SEEN, IDLE)).astype(np.int64)
    far = ~np.isfinite(dist)
    length = np.where(far, reach, dist)
    length = np.where(hidden, np.minimum(length, _first(scene, hit, wi)), length)
    length = np.where(useful, length, np.minimum(length, reach / 4))
    return hit.p.T, (hit.p + wi * length).T, state, far


def _first(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """Distance (n,) from a hit to the first surface along wi; inf for none."""
    everyone = np.arange(len(scene.analytic), dtype=np.int64)
    t, _ = scene.analytic.closest(everyone, hit.p, wi, hit.primitive)
    if scene.triangles is None:
        return t
    return np.minimum(t, scene.triangles.closest_from(hit.p, hit.n, hit.triangle, wi)[0])

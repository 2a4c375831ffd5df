"""An estimator at work at one pixel: the points that are seen in it, and every direction that is tried from
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

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
    """n samples from points seen in a pixel. start, end: (n, 3), the end of a hidden one on what hides it.
    state: (n,), see WORDS.

    far: (n,), whether it goes to something without a distance, its end being just beyond the scene. spp: how
    many camera rays.
    """

    start: Floats
    end: Floats
    state: NDArray[np.int64]
    far: NDArray[np.bool_]
    spp: int
    words: tuple[str, str, str]

    def count(self, state: int) -> int:
        """How many samples came to that."""
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
    """The samples of one pixel (x, y), counted from the top left, as the estimator draws them, nothing left
    out by the plan.

    spp: camera rays. reach: world units, how far to draw what goes to infinity. PenumbraError where the pixel
    is not in the image or the estimator does not apply. The random numbers are those of the first pixel of an
    image.
    """
    x, y = pixel
    camera = scene.camera
    if not (0 <= x < camera.width and 0 <= y < camera.height):
        raise PenumbraError(f"pixel {x},{y} is not in the image of {camera.width} x {camera.height} pixels")
    one = replace(camera, corner=camera.corner + camera.du * x + camera.dv * y, width=1, height=1)
    recorder = _Recorder(ESTIMATORS[estimator])
    render(
        replace(scene, camera=one),
        estimator=recorder.probe(),
        sampler=sampler,
        spp=spp,
        seed=seed,
        prune=False,
    )
    words = WORDS if recorder.inner.quantity == "radiance" else OPEN_WORDS
    parts = [_drawn(scene, *told, reach) for told in recorder.told]
    none = (np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))
    start, end, state, far = (np.concatenate(columns) for columns in zip(none, *parts, strict=True))
    return Tried(start, end, state, far, spp, words)


Told = tuple[SurfaceHit, Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class _Recorder:
    """An estimator and what it tries."""

    inner: Estimator
    told: list[Told] = field(default_factory=list[Told])

    def witness(
        self, hit: SurfaceHit, wi: Floats, dist: Floats, useful: NDArray[np.bool_], hidden: NDArray[np.bool_]
    ) -> None:
        self.told.append((hit, wi, dist, useful, hidden))

    def probe(self) -> Estimator:
        """The estimator under its own name, watched."""

        def estimate(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
            return self.inner.estimate(scene, replace(plan, witness=self.witness), hit, u)

        inner = self.inner
        return _Watched(inner.name, inner.title, inner, estimate, quantity=inner.quantity, ratio=inner.ratio)


@dataclass(frozen=True, eq=False)
class _Watched(Estimator):
    """As the inner estimator, but for `estimate`."""

    inner: Estimator
    watched: Callable[[RenderScene, RenderPlan, SurfaceHit, Floats], Reflected]

    def refuses(self, scene: SceneDescription) -> str | None:
        """As above."""
        return self.inner.refuses(scene)

    def dimensions(self, scene: RenderScene) -> int:
        """As above."""
        return self.inner.dimensions(scene)

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        return self.watched(scene, plan, hit, u)


def _drawn(
    scene: RenderScene,
    hit: SurfaceHit,
    wi: Floats,
    dist: Floats,
    useful: NDArray[np.bool_],
    hidden: NDArray[np.bool_],
    reach: float,
) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.bool_]]:
    """Start, end, state and far of what the witness was told; rows without a direction are left out."""
    with np.errstate(invalid="ignore", over="ignore"):
        rows = np.flatnonzero(np.abs((wi * wi).sum(axis=0) - 1.0) < 1e-6)
    hit, wi, dist, useful, hidden = (
        hit.take(rows),
        wi.take(rows, axis=1),
        dist[rows],
        useful[rows],
        hidden[rows],
    )
    state = np.where(hidden, HIDDEN, np.where(useful, SEEN, IDLE)).astype(np.int64)
    far = ~np.isfinite(dist)
    length = np.where(far, reach, dist)
    length = np.where(hidden, np.minimum(length, _first(scene, hit, wi)), length)
    length = np.where(useful, length, np.minimum(length, reach / 4))
    return hit.p.T, (hit.p + wi * length).T, state, far


def _first(scene: RenderScene, hit: SurfaceHit, wi: Floats) -> Floats:
    """Distance (n,) to whatever is met first, inf for nothing."""
    everyone = np.arange(len(scene.analytic), dtype=np.int64)
    t, _ = scene.analytic.closest(everyone, hit.p, wi, hit.primitive)
    if scene.triangles is None:
        return t
    return np.minimum(t, scene.triangles.closest_from(hit.p, hit.n, hit.triangle, wi)[0])

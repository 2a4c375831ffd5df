"""What an estimator of reflected direct light is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from renderer.build import RenderScene
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description.scene import SceneDescription
from scenes.registry import Registry


@dataclass(frozen=True, eq=False)
class Reflected:
    """radiance: (3, n) one sample of the light that each point reflects towards wo. shadow_rays: how many
    were traced.

    ratio: closed and unshadowed, each (3, n), of an estimator that is a pixel's closed * radiance /
    unshadowed, each of them averaged first; None for all others, which are the average of radiance.
    """

    radiance: Floats
    shadow_rays: int
    ratio: tuple[Floats, Floats] | None = None

    def __add__(self, other: Reflected) -> Reflected:
        return Reflected(self.radiance + other.radiance, self.shadow_rays + other.shadow_rays)


@runtime_checkable
class Estimator(Protocol):
    """One way of estimating the light that points reflect."""

    @property
    def name(self) -> str:
        """As users type it."""
        ...

    @property
    def title(self) -> str:
        """A few words for tables and legends."""
        ...

    @property
    def quantity(self) -> str:
        """What it estimates: RADIANCE or OCCLUSION."""
        ...

    @property
    def ratio(self) -> bool:
        """Whether a pixel is a ratio of means, see `Reflected`."""
        ...

    @property
    def bias(self) -> str | None:
        """Why its mean is not the truth at a finite number of samples, in a few words; None for an unbiased
        estimator.
        """
        ...

    def refuses(self, scene: SceneDescription) -> str | None:
        """Why it does not apply to the scene, in words, or None."""
        ...

    def dimensions(self, scene: RenderScene) -> int:
        """How many numbers in [0, 1) one sample takes."""
        ...

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """One sample a row. u: (dimensions, n) in [0, 1).

        Rows stand alone: a row's bits do not depend on the others.
        """
        ...


RADIANCE, OCCLUSION = "radiance", "ambient-occlusion"

ESTIMATORS: Registry[Estimator] = Registry("estimator", "renderer.estimators")

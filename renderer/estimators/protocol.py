"""What an estimator of reflected direct light is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from renderer.arrays import Floats
from renderer.build import RenderScene
from renderer.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description import SceneDescription
from scenes.registry import Registry


@dataclass(frozen=True, eq=False)
class Reflected:
    """radiance: (3, n) one sample of the light that each point reflects towards wo. shadow_rays: how many were traced."""

    radiance: Floats
    shadow_rays: int


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

    def refuses(self, scene: SceneDescription) -> str | None:
        """Why it does not apply to the scene, in words, or None."""
        ...

    def dimensions(self, scene: RenderScene) -> int:
        """How many numbers in [0, 1) one sample takes."""
        ...

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """One sample a row. u: (dimensions, n) in [0, 1). Rows stand alone: a row's bits do not depend on the others."""
        ...


ESTIMATORS: Registry[Estimator] = Registry("estimator", "renderer.estimators")

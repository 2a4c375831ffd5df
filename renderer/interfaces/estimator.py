"""The protocol of an estimator of reflected direct light."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass

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


RADIANCE, OCCLUSION = "radiance", "ambient-occlusion"


@dataclass(frozen=True)
class Estimator(ABC):
    """One way of estimating the light that points reflect.

    name: as users type it. title: a few words for tables and legends. quantity: RADIANCE or OCCLUSION. bias:
    why its mean is not the truth at a finite number of samples; None where it is. ratio: whether a pixel is a
    ratio of means, see `Reflected`. bounded: whether weights stay bounded however near a light comes.
    closed_form: whether a point that nothing shades gets the truth in each sample, or in the ratio.
    meets_lights_by_chance: whether directions are chosen without knowledge of the lights that they may meet.
    """

    name: str
    title: str
    _: KW_ONLY
    quantity: str = RADIANCE
    bias: str | None = None
    ratio: bool = False
    bounded: bool = True
    closed_form: bool = False
    meets_lights_by_chance: bool = False

    @abstractmethod
    def refuses(self, scene: SceneDescription) -> str | None:
        """Why it does not apply to the scene, in words, or None."""

    @abstractmethod
    def dimensions(self, scene: RenderScene) -> int:
        """How many numbers in [0, 1) one sample takes."""

    @abstractmethod
    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """One sample a row. u: (dimensions, n) in [0, 1).

        Rows stand alone: a row's bits do not depend on the others.
        """


ESTIMATORS: Registry[Estimator] = Registry("estimator", "renderer.estimators")

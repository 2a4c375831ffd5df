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
    """The reflected light of one sample a point.

    radiance: (3, n) towards wo. shadow_rays: the number traced. ratio: (closed, unshadowed), (3, n) each, of
    an estimator whose pixel is closed * radiance / unshadowed, all three averaged first; None for the others,
    whose pixel is the average of radiance.
    """

    radiance: Floats
    shadow_rays: int
    ratio: tuple[Floats, Floats] | None = None

    def __add__(self, other: Reflected) -> Reflected:
        return Reflected(self.radiance + other.radiance, self.shadow_rays + other.shadow_rays)


RADIANCE, OCCLUSION = "radiance", "ambient-occlusion"


@dataclass(frozen=True)
class Estimator(ABC):
    """An estimator of the light that points reflect.

    name: as users type it. title: a few words for tables and legends. quantity: RADIANCE or OCCLUSION. bias:
    the reason why its mean is off at a finite number of samples, None for an unbiased one. ratio: whether a
    pixel is a ratio of means, see `Reflected`. bounded: whether weights stay bounded however near a light
    comes. closed_form: whether every sample, or the ratio, is exact at a point that nothing shades.
    meets_lights_by_chance: whether directions are chosen without regard to the lights.
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
        """The reason why the estimator does not apply to a scene, in words; None where it applies."""

    @abstractmethod
    def dimensions(self, scene: RenderScene) -> int:
        """The number of random numbers that one sample takes."""

    @abstractmethod
    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        """One sample a row, without delta lobes, which `renderer.shading.delta_lobes` adds.

        u: (dimensions, n) in [0, 1). A row's bits do not depend on other rows.
        """


ESTIMATORS: Registry[Estimator] = Registry("estimator", "renderer.estimators")

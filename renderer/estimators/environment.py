"""`environment`: samples the environment by the importance of its image, and every other light by its best
technique.
"""

from __future__ import annotations

from dataclasses import dataclass

from renderer.build import RenderScene
from renderer.estimators.light_sampling import by_light
from renderer.estimators.mis import BEST
from renderer.interfaces.estimator import ESTIMATORS, Estimator, Reflected
from renderer.math.vectors import Floats
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes.description.scene import SceneDescription


@dataclass(frozen=True)
class EnvironmentSampling(Estimator):
    """Light samples alone; those of the environment are in proportion to its radiance."""

    def refuses(self, scene: SceneDescription) -> str | None:
        """The reason against a scene without an environment, else None."""
        if any(light.surrounds for light in scene.lights):
            return None
        return 'it has no environment (LightSource "infinite")'

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction, one more to choose among lights."""
        return 2 if len(scene.lights) == 1 else 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        return by_light(scene, plan, hit, u, *BEST)


ESTIMATORS.add("environment", EnvironmentSampling("environment", "proportional to the environment's image"))

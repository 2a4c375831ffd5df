"""`ambient-occlusion`: the open part of the cosine-weighted hemisphere, within a distance. It is no light but
a quantity of its own.

A(p) = 1/pi int V(p, wi) cos dwi, where V is 0 if a ray meets something nearer than the scene's `maxdistance`.
Directions follow the cosine, so that a sample is V itself. Lights count as occluders only. As in pbrt's
AOIntegrator the hemisphere is that of the geometric normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, OCCLUSION, Estimator, Reflected
from renderer.math.vectors import Floats, combine, frame_about
from renderer.math.warp import cosine_hemisphere
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.visibility import Seen, hidden
from scenes.description.scene import SceneDescription


@dataclass(frozen=True)
class AmbientOcclusion(Estimator):
    """One direction a sample."""

    def refuses(self, scene: SceneDescription) -> str | None:
        """None: every surface has a hemisphere."""
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for the direction."""
        return 2

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        n = hit.p.shape[1]
        if n == 0:
            return Reflected(np.zeros((3, 0)), 0)
        wi = combine(frame_about(hit.n), *cosine_hemisphere(u))
        nothing = np.full(n, -1, dtype=np.int64)
        reach = np.full(n, scene.description.occlusion_distance, dtype=np.float64)
        everyone = np.arange(n, dtype=np.int64)
        blocked = hidden(scene, plan, hit, Seen(nothing, wi, reach, np.zeros((3, 1))), everyone)
        return Reflected(np.where(blocked, 0.0, np.ones((3, 1))), n)


ESTIMATORS.add(
    "ambient-occlusion",
    AmbientOcclusion(
        "ambient-occlusion",
        "open share of the hemisphere",
        quantity=OCCLUSION,
    ),
)

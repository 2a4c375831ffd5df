"""Limits of this renderer: lights so near to a surface that rays cannot tell the two apart."""

from __future__ import annotations

import numpy as np

from renderer.build import RenderScene
from renderer.plan.plan import RenderPlan
from renderer.plan.proofs import Extents, extents, gap, provable
from scenes.description.shapes import ShapeDescription
from scenes.errors import PenumbraError

# Below so many times the bound on what float32 moves a ray's origin by, shadows are not to be trusted.
MARGIN = 10.0


def check(scene: RenderScene, plan: RenderPlan) -> None:
    """PenumbraError where a light is nearer than MARGIN bounds to a triangle that it lights, and triangles
    may lie between them.

    Where the plan proves that no triangle lies between, any distance will do: lights and receivers are known
    by number. Surfaces that touch a light pass, since only a rim as wide as the bound is badly shaded.
    """
    triangles = plan.shadow_triangles
    if triangles is None or not provable(scene):
        return
    bound = MARGIN * triangles.ray_offset
    e = extents(scene)
    meshes = np.unique(triangles.shape)
    for source, description in enumerate(scene.sources.all):
        if not isinstance(description, ShapeDescription):
            continue
        for receiver in meshes[plan.shadow[meshes, source] & plan.receivers[meshes]]:
            _check_pair(scene, e, int(receiver), source, bound)


def _check_pair(scene: RenderScene, e: Extents, receiver: int, source: int, bound: float) -> None:
    apart = gap(e, receiver, source)
    if e.tolerance < apart < bound:
        shape = scene.description.shapes[receiver]
        where = f" ({shape.where})" if shape.where else ""
        raise PenumbraError(
            f"light {scene.sources.names[source]} is {apart:.2g} from a surface{where} that it lights, "
            f"with triangles that may lie in between: shadow rays need {bound:.2g}; "
            "move it, or take away what is in between"
        )

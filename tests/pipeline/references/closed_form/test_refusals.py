"""Which scenes the closed form refuses, and that it says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.references.backends.closed_form import ClosedFormBackend
from pipeline.references.protocol import ReferenceRequest
from scenes.description.materials import Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Emission, Geometry, ShapeDescription, Sphere, TriangleMesh
from scenes.errors import PenumbraError
from tests.kit.closed_form_scenes import EYE, LIGHTS, lit_by
from tests.kit.mitsuba_scenes import floor, rectangle, shape, vector


def _with(*shapes: ShapeDescription, light: Geometry = LIGHTS["upright rectangle"]) -> SceneDescription:
    scene = lit_by(light)
    return replace(scene, shapes=(*scene.shapes, *shapes))


def _as_light(geometry: Geometry) -> ShapeDescription:
    return ShapeDescription(geometry, Diffuse(np.zeros(3)), Emission(np.ones(3)))


CONCAVE = TriangleMesh(
    vector(0, 0, 3, 4, 0, 3, 1, 0, 4, 0, 0, 7).reshape(4, 3), np.array([[0, 1, 2], [0, 2, 3]])
)
REFUSED = {
    "exactly one light, and this scene has 2": _with(_as_light(Sphere(vector(0, 3, 0), 0.1))),
    "exactly one light, and this scene has 0": replace(lit_by(LIGHTS["sphere"]), shapes=(floor(),)),
    "there is a sphere": _with(shape(Sphere(vector(0, 3, 0), 0.1))),
    "all receivers in one plane": _with(shape(rectangle(vector(0, 1, 1), vector(1, 0, 0), vector(0, 0, 1)))),
    "receivers that do not overlap": _with(
        shape(rectangle(vector(1, 0, 1), vector(2, 0, 0), vector(0, 0, 2)))
    ),
    "a convex outline": _with(shape(CONCAVE)),
    "every shape to be flat": lit_by(
        BilinearMesh(vector(0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 1).reshape(4, 3), np.array([[0, 1, 2, 3]]))
    ),
    "faces that form one patch": lit_by(
        TriangleMesh(
            vector(0, 1, 0, 1, 1, 0, 0, 2, 0, 3, 1, 0, 4, 1, 0, 3, 2, 0).reshape(6, 3),
            np.array([[0, 1, 2], [3, 4, 5]]),
        )
    ),
    "convex faces that all turn the same way": lit_by(
        TriangleMesh(
            vector(0, 1, 0, 1, 1, 0, 1, 2, 0, 0, 2, 0).reshape(4, 3), np.array([[0, 1, 2], [0, 3, 2]])
        )
    ),
    "faces with an area": lit_by(
        TriangleMesh(vector(0, 1, 0, 1, 1, 0, 2, 1, 0).reshape(3, 3), np.array([[0, 1, 2]]))
    ),
    "on the same side of the receivers' plane": lit_by(Sphere(vector(0, 0.1, 0), 0.2)),
    "emit outwards only": lit_by(Sphere(vector(0, 1, 0), 0.2, reverse=True)),
    "wholly before or wholly behind the camera": lit_by(Sphere(EYE, 1.0)),
}


@pytest.mark.parametrize("reason", REFUSED)
def test_refusals(reason: str) -> None:
    backend, scene = ClosedFormBackend(), REFUSED[reason]
    assert reason in (backend.refuses(scene) or "accepted")
    with pytest.raises(PenumbraError, match=r"scene by hand: "):
        backend.render(scene, ReferenceRequest())

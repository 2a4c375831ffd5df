"""Rules of the regions that a picture of one light shows: borders of hard shadows, and lights that the
floor's own plane cuts.
"""

from __future__ import annotations

import numpy as np

from pipeline.statistics.numerics import box_maximum
from pipeline.studies.regions import Regions, find_regions
from renderer import build
from scenes.description.lights import PointLight
from scenes.description.scene import SceneDescription
from scenes.description.shapes import BilinearMesh, Emission, ShapeDescription
from tests.kit.scenes import BLACK, floor, look_at

WIDTH, HEIGHT = 32, 24
EYE, TARGET = [0.0, 6.0, -5.0], [0.0, 0.0, 0.0]
LAMP = PointLight(np.array([0.0, 4.0, 0.0]), np.ones(3))


def _patch(
    corner: list[float], ex: list[float], ey: list[float], emission: Emission | None = None
) -> ShapeDescription:
    """A black rectangle; normal ex x ey."""
    c, x, y = np.array(corner), np.array(ex), np.array(ey)
    mesh = BilinearMesh(np.stack([c, c + x, c + y, c + x + y]), np.array([[0, 1, 2, 3]]))
    return ShapeDescription(mesh, BLACK, emission)


def _found(*shapes: ShapeDescription, lamps: tuple[PointLight, ...] = (), fov: float = 35.0) -> Regions:
    camera, film = look_at(EYE, TARGET, WIDTH, HEIGHT, fov=fov)
    found = find_regions(build(SceneDescription("by hand", camera, film, shapes, lamps)), spp=16)
    assert found is not None
    return found


def test_a_dark_pixel_beside_a_lit_one_is_penumbra() -> None:
    """A point light's shadow has no width, and only the pixels whose eight neighbours are dark as well are
    umbra.

    Taken each for itself, those within the shadow's border would be umbra: where a leak is measured though
    light is beside it.
    """
    sheet = _patch([-0.5, 2.0, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])  # its shadow: |x|, |z| < 1
    found = _found(floor(20.0), sheet, lamps=(LAMP,))
    masks, dark = found.masks(), found.visibility == 0
    beside_light = box_maximum((found.visibility > 0).astype(np.float64), 3) > 0
    border = dark & beside_light
    assert border.sum() > 10 and masks["penumbra"][border].all() and not found.dark[border].any()
    assert (dark & ~beside_light).sum() > 10 and masks["umbra"][dark & ~beside_light].all()


def test_a_light_that_the_floor_s_plane_cuts_is_lit() -> None:
    """Of the light's samples those below the floor's plane are none that it could get; the upper ones all
    arrive.

    Counted among those that are sent, they would leave a visibility of one half all over, and the picture all
    penumbra.
    """
    lamp = _patch([6.0, -1.0, -1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0], Emission(np.ones(3)))  # faces -x
    below = _patch(
        [5.0, -2.0, -20.0], [0.0, 0.0, 40.0], [0.0, 1.9, 0.0]
    )  # under the floor's plane, before the lamp
    found = _found(floor(4.0), lamp, below, fov=20.0)
    assert found.masks()["lit"].all() and (found.visibility == 1).all()

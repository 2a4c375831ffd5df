"""What the camera sees, by pyrender's depth buffer: another camera, another projection, triangles drawn
instead of rays traced.

Ours is the distance that a probe in the place of an estimator is told of, through `render` as it is: camera,
intersection, chunks. Off silhouettes the two depths may differ by what the depth buffer can hold, by the grid
that OpenGL moves corners to, and by the sag of the triangles that stand for a sphere; `_tolerance` derives
each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.baseline.process import Raster, rasterise
from renderer import build, render
from renderer.build import RenderScene
from renderer.camera import make_camera
from renderer.interfaces.estimator import Estimator, Reflected
from renderer.math.vectors import Floats, dot
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from scenes import SceneDescription, library, load
from scenes.description.scene import PerspectiveCamera, PixelFilter
from scenes.description.shapes import Sphere

pytestmark = pytest.mark.usefixtures("opengl")

NAMES = [found.name for found in library()]
HEAVY = {"forest": pytest.mark.slow}  # a million triangles: half a minute
SILHOUETTE = (
    0.05  # of the depth: where neighbours differ by more, an edge may lie on either side of a pixel's middle
)
AGREE = 0.999
# OpenGL rounds corners to a grid of at least 2^-4 pixel, llvmpipe to 2^-8; edges and planes move by as much.
SPHERE_SAG = 3e-4  # of the radius: the most that a triangle lies below its sphere (measured, 2.85e-4)
SUBPIXEL = 2.0**-8
MIDDLE = PixelFilter("box", 1e-9, 1e-9)

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class _Depth(Estimator):
    """A probe in the place of an estimator: the distance along the view, in all channels."""

    forward: Floats
    origin: Floats

    def refuses(self, scene: SceneDescription) -> str | None:
        return None

    def dimensions(self, scene: RenderScene) -> int:
        return 0

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        depth = dot(hit.p - self.origin, np.broadcast_to(self.forward, hit.p.shape))
        return Reflected(np.tile(depth, (3, 1)), 0)


@dataclass(frozen=True, eq=False)
class _Ours:
    """A scene built once, to be looked at by any camera."""

    built: RenderScene

    def depth(self, camera: PerspectiveCamera) -> Floats:
        """(h, w) depths through the middles of pixels, infinite where nothing is hit."""
        axes = camera.camera_to_world
        probe = _Depth(
            "depth", "depth", axes[:3, 2:3] / np.linalg.norm(axes[:3, 2]), axes[:3, 3:4], quantity="depth"
        )
        film = replace(self.built.description.film, pixel_filter=MIDDLE)
        seen = replace(self.built, camera=make_camera(camera, film))
        depth = render(seen, estimator=probe, spp=1).image[..., 0]
        return np.where(depth > 0, depth, np.inf)


def _range(depth: Floats) -> tuple[Floats, Floats]:
    """The least and the greatest depth among a pixel and the eight around it."""
    h, w = depth.shape
    padded = np.pad(depth, 1, mode="edge")
    around = np.stack([padded[i : i + h, j : j + w] for i in range(3) for j in range(3)])
    return around.min(axis=0), around.max(axis=0)


def _smooth(*depths: Floats) -> Mask:
    """Pixels that neither image holds for a silhouette; nothing beside nothing is smooth too."""
    found = np.ones(depths[0].shape, dtype=np.bool_)
    for depth in depths:
        low, high = _range(depth)
        found &= (high <= low * (1 + SILHOUETTE)) | np.isinf(low)
    return found


def _tolerance(raster: Raster, scene: SceneDescription, depth: Floats) -> Floats:
    """What the depths may differ by.

    The buffer holds d = f (z - n) / (z (f - n)) as a float below 1, and it is computed in float32 from
    coordinates that were: a few roundings of 2^-24, each worth dz = 2^-24 z^2 (f - n) / (f n). Four are
    allowed for. A corner off by SUBPIXEL moves the depth by as much of the step to the next pixel. A sphere's
    triangles lie up to SPHERE_SAG r below it; at 75 degrees from the normal that is four times as far along
    the view.
    """
    n, f = raster.near, raster.far
    buffer = 4 * 2.0**-24 * depth**2 * (f - n) / (f * n)
    low, high = _range(depth)
    step = np.where(np.isfinite(high), high - low, 0.0)
    radii = [s.geometry.radius for s in scene.shapes if isinstance(s.geometry, Sphere)]
    return buffer + SUBPIXEL * step + 4 * SPHERE_SAG * max(radii, default=0.0)


def _agreement(raster: Raster, scene: SceneDescription, ours: Floats) -> tuple[float, float]:
    """The share of pixels off silhouettes at which both agree, and the share of all pixels that these are."""
    smooth = _smooth(raster.depth, ours)
    finite = np.isfinite(ours)
    allowed = _tolerance(raster, scene, np.where(finite, ours, 1.0))
    with np.errstate(invalid="ignore"):
        near = np.abs(raster.depth - ours) <= allowed
    same = np.where(finite & np.isfinite(raster.depth), near, finite == np.isfinite(raster.depth))
    return float(same[smooth].mean()), float(smooth.mean())


@cache
def _drawn(heavy: bool) -> dict[str, tuple[SceneDescription, Raster]]:
    """Every scene of the library that has shapes, and its picture; one process draws them all."""
    scenes = {name: load(name) for name in NAMES if (name in HEAVY) == heavy}
    scenes = {name: scene for name, scene in scenes.items() if scene.shapes}
    return {
        name: (scenes[name], raster)
        for name, raster in zip(scenes, rasterise([*scenes.values()]), strict=True)
    }


@pytest.mark.parametrize("name", [pytest.param(name, marks=HEAVY.get(name, ())) for name in NAMES])
def test_primary_rays_see_what_a_rasteriser_draws(name: str) -> None:
    """A camera half a pixel off or mirrored, or a field of view 1 % wrong, is seen: `_planted` shows it for
    every scene.
    """
    drawn = _drawn(name in HEAVY)
    if name not in drawn:
        return  # no shapes, no visibility
    scene, raster = drawn[name]
    eye = _Ours(build(scene))
    ours = eye.depth(scene.camera)
    agree, smooth = _agreement(raster, scene, ours)
    print(f"{name}: {100 * agree:.3f} % of the {100 * smooth:.1f} % off silhouettes agree")
    assert smooth > 0.25  # a forest has edges in most of its pixels
    assert agree >= AGREE
    for what, wrong in _planted(scene).items():
        theirs = eye.depth(wrong)
        found, _ = _agreement(raster, scene, theirs)
        print(f"    {what}: {100 * found:.2f} %")
        symmetric = np.allclose(theirs, ours, rtol=1e-6)  # seen mirrored, furnace and penumbra look the same
        assert found < AGREE or (symmetric and what == "mirrored"), what


def _planted(scene: SceneDescription) -> dict[str, PerspectiveCamera]:
    """Cameras that see the scene wrongly."""
    camera = scene.camera
    turned = camera.camera_to_world.copy()
    pixel = 2 * np.tan(np.radians(camera.fov) / 2) / min(scene.film.width, scene.film.height)
    turned[:3, 2] += turned[:3, 0] * pixel / 2 + turned[:3, 1] * pixel / 2
    mirrored = camera.camera_to_world.copy()
    mirrored[:3, 0] *= -1.0
    return {
        "half a pixel off": replace(camera, camera_to_world=turned),
        "mirrored": replace(camera, camera_to_world=mirrored),
        "field of view 1 % wider": replace(camera, fov=1.01 * camera.fov),
    }

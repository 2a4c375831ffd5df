"""The regions of a picture, by a visibility pass at many samples.

From the points seen in each pixel, samples go to the lights by every light's best technique. The visibility
is the share that arrives of those sent towards the point's front side.

    background   nothing is hit; a visible environment counts as `light`
    light        a sample of the pixel or of the eight around it sees emission, which includes a light's edges
    contact      along a sampled direction, an occluder or a light is nearer than CONTACT times the distance
                 to the camera: shadows are sharp and weights are large
    umbra        no sample arrives in the pixel or in the eight around it: the truth is exactly 0
    lit          every sample arrives
    penumbra     the rest, and the pixels that border on it

Each pixel has one of these labels, in this order of precedence. The umbra of contact pixels is kept apart
(`dark`), since a shadow's epsilon leaks there. The pass shares camera, geometry and shadow test with the
renderer, so that it only says where to look: a leak is measured where the reference is black too
(pipeline/run/worker.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.statistics.numerics import box_maximum
from renderer import RenderScene, render
from renderer.estimators.mis import BEST
from renderer.interfaces.estimator import Estimator, Reflected
from renderer.math.vectors import Floats, combine, dot, frame_about
from renderer.math.warp import uniform_hemisphere
from renderer.plan.plan import RenderPlan
from renderer.records import SurfaceHit
from renderer.shading.lights import choose_light, light_along, sample_light, supporting_techniques
from renderer.shading.visibility import Seen, hidden, visible
from scenes.arrays import Mask
from scenes.description.scene import SceneDescription

LABELS = ("background", "light", "umbra", "penumbra", "lit", "contact")  # a label is an index into these
BACKGROUND, LIGHT, UMBRA, PENUMBRA, LIT, CONTACT_LABEL = range(len(LABELS))
CONTACT = 0.02  # of the distance to the camera: 4 pixels of a picture of 100 pixels' height and 30 degrees
SPP = 64  # a pixel; an umbra pixel has then 576 blocked samples around it
SEED = 0x5EE  # no cell's seed, so that no estimate shares samples with the pass


@dataclass(frozen=True, eq=False)
class Regions:
    """The regions of a picture.

    label: (h, w), an index into LABELS. visibility: (h, w), 0 to 1; nan in background and light. dark: (h,
    w), whether the true radiance is 0.
    """

    label: NDArray[np.int64]
    visibility: Floats
    dark: Mask

    def masks(self) -> dict[str, Mask]:
        """Name to mask (h, w) of each region that has a pixel, from lit to background."""
        order = (LIT, PENUMBRA, UMBRA, CONTACT_LABEL, LIGHT, BACKGROUND)
        found = {LABELS[number]: self.label == number for number in order}
        return {name: mask for name, mask in found.items() if mask.any()}


def find_regions(scene: RenderScene, spp: int = SPP, threads: int = 1) -> Regions | None:
    """The regions of a scene's picture, from passes of `spp` samples; None for a scene without lights."""
    if not scene.sources.all:
        return None

    def ask(rule: Rule, prune: bool = False) -> Floats:
        probe = _Probe(rule.__name__, "a question about visibility", rule)
        return render(scene, estimator=probe, spp=spp, seed=SEED, threads=threads, prune=prune).image

    light: Mask = box_maximum(np.max(ask(_nothing), axis=-1), 3) > 0
    sent, arrived, shaded = np.moveaxis(np.where(light[..., None], 0.0, ask(_visibility)), -1, 0)
    near = (ask(_nearness, prune=True)[..., 0] > 0) & ~light
    lit_nearby = box_maximum(arrived, 3) > 0
    dark = (shaded > 0) & ~light & ~lit_nearby
    whole = (arrived == sent) & (sent > 0)
    label = np.select(
        [light, shaded == 0, near, dark, whole],
        [LIGHT, BACKGROUND, CONTACT_LABEL, UMBRA, LIT],
        default=PENUMBRA,
    )
    share = np.divide(arrived, sent, out=np.zeros_like(sent), where=sent > 0)
    return Regions(label.astype(np.int64), np.where(shaded > 0, share, np.nan), dark)


# (scene, plan, hit, u) -> flags (3, n), 0 or 1
Rule = Callable[[RenderScene, RenderPlan, SurfaceHit, Floats], Floats]


@dataclass(frozen=True)
class _Probe(Estimator):
    """An estimator that returns the three flags of a rule in place of radiance."""

    rule: Rule

    def refuses(self, scene: SceneDescription) -> str | None:
        return None

    def dimensions(self, scene: RenderScene) -> int:
        """Two for a direction, one to choose among lights."""
        return 3

    def estimate(self, scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Reflected:
        if hit.p.shape[1] == 0:
            return Reflected(np.zeros((3, 0)), 0)
        return Reflected(self.rule(scene, plan, hit, u), 0)


def _nothing(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Floats:
    """No reflected light, so that only emission is left."""
    return np.zeros_like(hit.p)


def _visibility(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Floats:
    """Whether a light sample is sent to the point's front, whether it arrives, and 1 for the point itself."""
    light, u = choose_light(scene, u)
    sample = sample_light(scene, supporting_techniques(scene, *BEST), hit, light, u)
    with np.errstate(invalid="ignore"):
        sent = sample.valid & (dot(sample.wi, hit.ns) > 0) & np.any(sample.radiance > 0, axis=0)
    seen = Seen(light, sample.wi, sample.dist, sample.normal)
    one = np.ones(hit.p.shape)
    arrived = visible(scene, plan, hit, seen, sent, one)
    return np.stack([sent * one[0], arrived.radiance[0], one[0]])


def _nearness(scene: RenderScene, plan: RenderPlan, hit: SurfaceHit, u: Floats) -> Floats:
    """Whether a light or an occluder is nearer than CONTACT along a random direction of the hemisphere."""
    wi = combine(frame_about(hit.n), *uniform_hemisphere(u))
    reach = CONTACT * scene.camera.distance(hit.p)
    near = light_along(scene, hit, wi)[0].dist < reach
    rows = np.arange(reach.size, dtype=np.int64)
    near |= hidden(scene, plan, hit, Seen(np.full_like(rows, -1), wi, reach, -wi), rows)
    return np.where(near, np.array([[1.0], [0.0], [0.0]]), 0.0)


def to_channels(regions: Regions) -> dict[str, Floats]:
    """The channels of a label image: `region` (an index into LABELS), `visibility` and `dark`."""
    return {
        "region": regions.label.astype(np.float64),
        "visibility": regions.visibility,
        "dark": regions.dark.astype(np.float64),
    }


def from_channels(channels: dict[str, Floats]) -> Regions:
    """The inverse of `to_channels`."""
    return Regions(channels["region"].astype(np.int64), channels["visibility"], channels["dark"] > 0)

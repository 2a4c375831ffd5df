"""Environments: light from all around, constant or from an image. No surface, no position: a direction is all
there is.

Look-ups are by the nearest texel, as pbrt's [pharr2023, sec. 12.5.2], so that what is sampled is exactly what
lights:

- `solid-angle`: uniform over the sphere, or over the hemisphere of an environment that ends at its horizon.
- `environment`: in proportion to the mean of red, green and blue, and uniform inside a texel.
- `environment-compensated`: in proportion to what exceeds the mean over the sphere [karlik2019]. Darker
directions are left to another
  technique: alone it is biased, with MIS and a technique that covers the hemisphere it is not.

A hemisphere of an image: images of an odd height are doubled, whereupon the horizon passes along edges and
diagonals of texels only, and a direction from a cut texel's lower half is turned up by changing the sign of
z, which stays in that texel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.math.piecewise import PiecewiseConstant2D
from renderer.math.vectors import Floats, combine, dot, gather
from renderer.math.warp import uniform_hemisphere, uniform_sphere
from renderer.records import LightSample
from renderer.spherical.grid import SphereGrid
from scenes.arrays import Mask
from scenes.description.lights import Environment
from scenes.errors import SceneError

MAPPINGS = ("equal-area", "latitude-longitude")
# Axes from decimal text are orthonormal to some 1e-16; what is off by more was scaled or sheared.
ORTHONORMAL = 1e-9
# Below this contrast a map counts as constant: the excess over its mean would be rounding.
CONTRAST = 1e-9
# What is divided by where all is black.
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class TexelDensity:
    """distribution: over texels. density: (m,) in 1/sr of all texels, 0 where the distribution never goes."""

    distribution: PiecewiseConstant2D
    density: Floats

    @staticmethod
    def of(lit: Sequence[Floats], bright: Sequence[Floats]) -> TexelDensity:
        """A distribution in proportion to `bright`, per solid angle, times the lit solid angles `lit`; both
        (h, w), one array an image.
        """
        distribution = PiecewiseConstant2D.of(
            [b / max(b.max(), TINY) * s for b, s in zip(bright, lit, strict=True)]
        )
        chance = [distribution.probability(i, *s.shape) for i, s in enumerate(lit)]
        density = [
            np.divide(c, s, out=np.zeros_like(c), where=s > 0) for c, s in zip(chance, lit, strict=True)
        ]
        return TexelDensity(distribution, np.concatenate([d.reshape(-1) for d in density]))


@dataclass(frozen=True, eq=False)
class EnvironmentLights:
    """frame: (3, 3, k), [:, j] the light's j-th axis in the world. hemisphere, constant: (k,) bool. grid: the
    images.

    radiance: (m, 3) of all texels. plain, compensated: the two densities over them.
    """

    parts: Parts
    frame: Floats
    hemisphere: Mask
    constant: Mask
    grid: SphereGrid
    radiance: Floats
    plain: TexelDensity
    compensated: TexelDensity

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """The techniques by name; all are the uniform one where every light is constant."""
        uniform = UniformDirections(self)
        if self.constant.all():
            return {"solid-angle": uniform, "environment": uniform, "environment-compensated": uniform}
        return {
            "solid-angle": uniform,
            "environment": TexelSampling(self, self.plain),
            "environment-compensated": TexelSampling(self, self.compensated),
        }

    @property
    def flux(self) -> Floats:
        lit = [_lit(self.grid, i, half) for i, half in enumerate(self.hemisphere)]
        cuts = self.grid.first[1:]
        bright = np.split(self.radiance.mean(axis=1), cuts)
        return np.array([float(b @ s.ravel()) for b, s in zip(bright, lit, strict=True)])

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> EnvironmentLights:
        """The lights of a scene. Raises SceneError for an image that is no map of the sphere or holds
        negative or infinite light.
        """
        own = [s for s in sources if isinstance(s, Environment)]
        images = [_image(e) for e in own]
        constant = np.array([image.shape[:2] == (1, 1) for image in images], dtype=np.bool_)
        images = [_even(image) if e.hemisphere else image for e, image in zip(own, images, strict=True)]
        height, width = np.array([image.shape[:2] for image in images], dtype=np.int64).T.copy()
        latlong = np.array([e.image is not None and e.mapping == MAPPINGS[1] for e in own], dtype=np.bool_)
        grid = SphereGrid(height, width, latlong, np.cumsum(height * width) - height * width)
        hemisphere = np.array([e.hemisphere for e in own], dtype=np.bool_)
        lit = [_lit(grid, i, half) for i, half in enumerate(hemisphere)]
        bright = [_brightness(image) for image in images]
        radiance = np.concatenate([image.reshape(-1, 3) for image in images])
        excess = [_excess(s, b) for s, b in zip(lit, bright, strict=True)]
        return cls(
            Parts.whole(index),
            np.stack([_axes(e) for e in own], axis=2),
            hemisphere,
            constant,
            grid,
            radiance,
            TexelDensity.of(lit, bright),
            TexelDensity.of(lit, excess),
        )

    def radiance_along(self, index: Index, ref_p: Floats, wi: Floats) -> Floats:
        """Radiance (3, n) along unit directions wi (3, n) that leave the scene. index: (n,) the
        environment.
        """
        w = self.local(index, wi)
        radiance = self.of_texels(self.texel_along(index, w))
        return np.where(self.lit(index, w), radiance, 0.0) if self.hemisphere.any() else radiance

    def texel_along(self, index: Index, w: Floats) -> NDArray[np.int64]:
        """The number (n,) of the texel in directions w (3, n) of the light's own axes; any texel where the
        light is constant.
        """
        return self.grid.first.take(index) if self.constant.all() else self.grid.texel_at(index, w)

    def of_texels(self, texel: Index) -> Floats:
        """Radiance (3, n) of texels (n,) by number."""
        return np.ascontiguousarray(self.radiance.take(texel, axis=0).T)

    def local(self, index: Index, wi: Floats) -> Floats:
        """Directions (3, n) in the light's own axes."""
        frame = gather(self.frame, index)
        return np.stack([dot(frame[:, 0], wi), dot(frame[:, 1], wi), dot(frame[:, 2], wi)])

    def world(self, index: Index, w: Floats) -> Floats:
        """Directions (3, n) in the world; the inverse of `local`."""
        frame = gather(self.frame, index)
        return combine((frame[:, 0], frame[:, 1], frame[:, 2]), *w)

    def lit(self, index: Index, w: Floats) -> Mask:
        """(n,): whether the light extends to w (3, n) in its own axes. A hemisphere leaves z = 0 out."""
        return ~self.hemisphere.take(index) | (w[2] > 0)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """pi L of a constant sphere; pi L (1 + cos t)/2 of a constant hemisphere at angle t from the
        surface's normal. None for images.
        """
        if not self.constant[index].all():
            return None
        up = dot(gather(self.frame, index)[:, 2], ref_n)
        seen = np.where(self.hemisphere[index], 0.5 * (1.0 + np.clip(up, -1.0, 1.0)), 1.0)
        return np.pi * seen * self.of_texels(self.grid.first[index])


@dataclass(frozen=True, eq=False)
class TexelSampling:
    """A texel by its density, then a uniform direction inside it."""

    lights: EnvironmentLights
    texels: TexelDensity

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """One direction a row; not valid for an environment that is black all over."""
        li = self.lights
        place = self.texels.distribution.sample(index, u)
        w = li.grid.direction(index, place)
        if li.hemisphere.any():
            w[2] = np.where(li.hemisphere.take(index), np.abs(w[2]), w[2])
        texel = li.grid.texel(index, place)
        pdf = self.texels.density.take(texel)
        wi = li.world(index, w)
        valid = (pdf > 0) & li.lit(index, w)
        return LightSample(wi, np.full(pdf.size, np.inf), -wi, li.of_texels(texel), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        li = self.lights
        w = li.local(index, wi)
        pdf = self.texels.density.take(li.grid.texel_at(index, w))
        return np.where(li.lit(index, w), pdf, 0.0)


@dataclass(frozen=True, eq=False)
class UniformDirections:
    """Uniform over the sphere or the light's hemisphere."""

    lights: EnvironmentLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        w = uniform_sphere(u)
        if li.hemisphere.any():
            w = np.where(li.hemisphere[index], uniform_hemisphere(u), w)
        wi = li.world(index, w)
        texel = li.texel_along(index, w)
        pdf = self._pdf(index)
        return LightSample(wi, np.full(pdf.size, np.inf), -wi, li.of_texels(texel), pdf, li.lit(index, w))

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        return np.where(self.lights.lit(index, self.lights.local(index, wi)), self._pdf(index), 0.0)

    def _pdf(self, index: Index) -> Floats:
        return np.where(self.lights.hemisphere.take(index), 0.5 / np.pi, 0.25 / np.pi)


def _lit(grid: SphereGrid, image: int, hemisphere: np.bool_ | bool) -> Floats:
    """(h, w): the solid angle of each texel from which light comes."""
    omega = np.repeat(grid.solid_angle(image), grid.width[image], axis=1)
    return omega * grid.above(image) if hemisphere else omega


def _excess(lit: Floats, bright: Floats) -> Floats:
    """(h, w): the part of `bright`, per solid angle, above its mean over the sphere; all of `bright` where
    nothing exceeds it. lit: solid angles.
    """
    scaled = bright / max(bright.max(), TINY)
    excess = np.maximum(scaled - (scaled * lit).sum() / (4 * np.pi), 0.0)
    return excess if excess.max(where=lit > 0, initial=0.0) > CONTRAST else scaled


def _image(e: Environment) -> Floats:
    """The radiance (h, w, 3) of an environment. Raises SceneError for values that are not finite or
    below 0.
    """
    image = np.ones((1, 1, 3)) if e.image is None else e.image
    if e.mapping not in MAPPINGS:
        raise SceneError(
            f"unknown mapping {e.mapping!r} of an environment; there are: {', '.join(MAPPINGS)}", e.where
        )
    if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
        raise SceneError(
            f"an environment's image must be (h, w, 3) with h, w > 0, not {image.shape}", e.where
        )
    if e.image is not None and e.mapping == MAPPINGS[0] and image.shape[0] != image.shape[1]:
        size = f"{image.shape[1]}x{image.shape[0]}"
        raise SceneError(f"an equal-area environment's image must be square; this one is {size}", e.where)
    with np.errstate(over="ignore", invalid="ignore"):
        radiance = image * e.radiance
    wrong = ~(np.isfinite(radiance) & (radiance >= 0))
    if wrong.any():
        row, column, _ = (int(i) for i in np.argwhere(wrong)[0])
        value = ", ".join(f"{v:.6g}" for v in radiance[row, column])
        at = "" if e.image is None else f" in row {row}, column {column} of its image"
        raise SceneError(
            f"an environment's radiance must be finite and not negative; it is {value}{at}", e.where
        )
    return radiance


def _brightness(image: Floats) -> Floats:
    """(h, w): the mean of red, green and blue. It divides first, since the sum might overflow."""
    return image[:, :, 0] / 3.0 + image[:, :, 1] / 3.0 + image[:, :, 2] / 3.0


def _even(image: Floats) -> Floats:
    """The same map with an even number of rows."""
    return image.repeat(2, axis=0).repeat(2, axis=1) if image.shape[0] % 2 else image


def _axes(e: Environment) -> Floats:
    """The frame (3, 3); SceneError where it is not orthonormal."""
    off = np.abs(e.frame.T @ e.frame - np.eye(3)).max()
    if not off < ORTHONORMAL:
        raise SceneError("an environment may be turned and mirrored, but not scaled or sheared", e.where)
    return e.frame


def _examples() -> list[LightExample]:
    p, n = np.array([[0.0], [-1.0], [2.0]]), np.array([[0.0], [0.6], [0.8]])
    frame = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    row, column = np.mgrid[:6, :6]
    smooth = 1.0 + np.sin(1.3 * row + 0.7 * column)[:, :, None] * np.array([0.9, 0.5, 0.2])
    sun = 0.1 * smooth
    sun[1, 2] = [60.0, 50.0, 30.0]
    rgb = np.array([3.0, 2.0, 1.0])
    maps = [
        ("a constant environment", Environment(rgb)),
        ("a constant hemisphere", Environment(rgb, frame=frame, hemisphere=True)),
        ("an octahedral image, turned", Environment(rgb, smooth, frame=frame)),
        ("an octahedral image with a sun", Environment(rgb, sun)),
        (
            "a hemisphere of an octahedral image",
            Environment(rgb, smooth[:5, :5], frame=frame, hemisphere=True),
        ),
        (
            "a latitude-longitude image, mirrored",
            Environment(rgb, smooth[:4], MAPPINGS[1], frame * [1, 1, -1]),
        ),
    ]
    return [LightExample(name, light, p, n) for name, light in maps]


TECHNIQUES = ("solid-angle", "environment", "environment-compensated")
ABSENT = {
    "area": "an environment has no surface",
    "projected-solid-angle": "an environment is not a polygon",
}
LIGHTS.add(
    "environment",
    LightKind(Environment, EnvironmentLights.make, "environments", TECHNIQUES, _examples, ABSENT),
)

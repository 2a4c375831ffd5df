"""Portals: what a sky sends in through a rectangle [bitterli2015], [pharr2023, sec. 12.5.3].

The sky's image is resampled to the angles u = (pi/2 + atan(x/z))/pi and v = (pi/2 + atan(y/z))/pi about the
portal's axes, in which the portal is an axis-aligned window from wherever it is seen. Look-ups take the
nearest texel of that image, as pbrt's, so that what is sampled is exactly what lights:

- `solid-angle`: uniform in the solid angle of the rectangle [urena2013].
- `environment`, `environment-compensated`: in proportion to the resampled image inside the window, and
  uniform in u and v inside a texel. pbrt compensates no portal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.interfaces.light import LIGHTS, DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.math.piecewise import WindowedPiecewiseConstant2D
from renderer.math.vectors import Floats, combine, cross, dot, gather
from renderer.records import LightSample
from renderer.spherical.octahedral import bilinear_on_sphere
from renderer.spherical.rectangle import invert, solid_angle
from scenes.arrays import Mask
from scenes.description.lights import Environment, PortalLight
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class PortalLights:
    """corner: (3, k). frame: (3, 3, k), columns along the rectangle's edges and the way that one looks out.
    extent: (2, k) lengths of the edges. size: (k,) of the resampled images, square. first: (k,) an image's
    first texel. radiance: (m, 3) of all texels. texels: their distributions.
    """

    parts: Parts
    corner: Floats
    frame: Floats
    extent: Floats
    size: NDArray[np.int64]
    first: NDArray[np.int64]
    radiance: Floats
    texels: WindowedPiecewiseConstant2D

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        window = WindowSampling(self)
        return {
            "solid-angle": PortalSolidAngle(self),
            "environment": window,
            "environment-compensated": window,
        }

    @property
    def flux(self) -> Floats:
        return self.texels.total

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> PortalLights:
        """The portals of a scene; SceneError for a sky that pbrt lets no portal have."""
        own = [s for s in sources if isinstance(s, PortalLight)]
        across, up = (np.stack([s.corners[i] - s.corners[0] for s in own], axis=1) for i in (3, 1))
        extent = np.sqrt(np.stack([dot(across, across), dot(up, up)]))
        x, y = across / extent[0], up / extent[1]
        frame = np.stack([x, y, cross(x, y)], axis=1)
        images = [_resampled(s.sky, frame[:, :, i]) for i, s in enumerate(own)]
        size = np.array([len(image) for image in images], dtype=np.int64)
        return cls(
            Parts.whole(index),
            np.stack([s.corners[0] for s in own], axis=1),
            frame,
            extent,
            size,
            np.cumsum(size**2) - size**2,
            np.concatenate([image.reshape(-1, 3) for image in images]),
            WindowedPiecewiseConstant2D.of([_weights(image) for image in images]),
        )

    def radiance_along(self, index: Index, ref_p: Floats, wi: Floats) -> Floats:
        """Radiance (3, n) along unit directions wi (3, n) from ref_p (3, n) or (3, 1)."""
        place, _ = self.place(index, wi)
        low, high, open_ = self.window(index, ref_p)
        inside = open_ & ((place >= low) & (place <= high)).all(axis=0)
        return np.where(inside, self.of_texels(index, place), 0.0)

    def of_texels(self, index: Index, place: Floats) -> Floats:
        """The resampled image (3, n) at places (2, n)."""
        size = self.size.take(index)
        column, row = np.minimum((np.fmax(place, 0.0) * size).astype(np.int64), size - 1)
        texel: NDArray[np.int64] = self.first.take(index) + row * size + column
        return np.ascontiguousarray(self.radiance.take(texel, axis=0).T)

    def place(self, index: Index, wi: Floats) -> tuple[Floats, Floats]:
        """Places (u, v) (2, n) of unit vectors, -1 for those that point the other way, and the solid angle
        (n,) of a unit of area there.
        """
        frame = gather(self.frame, index)
        x, y, z = (dot(frame[:, i], wi) for i in range(3))
        ahead = z > 0
        z = np.where(ahead, z, 1.0)
        place = np.where(ahead, 0.5 + np.arctan2([x, y], z) / np.pi, -1.0)
        return place, _stretch(x, y, z)

    def direction(self, index: Index, place: Floats) -> tuple[Floats, Floats]:
        """Unit vectors of places (u, v); the inverse of `place`."""
        x, y = np.tan(np.pi * (place - 0.5))
        z = 1.0 / np.sqrt(1.0 + x * x + y * y)
        frame = gather(self.frame, index)
        wi = combine((frame[:, 0], frame[:, 1], frame[:, 2]), x * z, y * z, z)
        return wi, _stretch(x * z, y * z, z)

    def window(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Mask]:
        """Low and high ends (2, n) in (u, v) of the portal as seen from points, and whether it faces them
        (n,).
        """
        low, z = self.local(index, ref_p)
        open_ = z > 0
        z = np.where(open_, z, 1.0)
        high = low + gather(self.extent, index)
        return 0.5 + np.arctan2(low, z) / np.pi, 0.5 + np.arctan2(high, z) / np.pi, open_

    def local(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats]:
        """The first corner relative to ref_p: (2, n) along the two edges, and (n,) along the
        portal's axis.
        """
        d, frame = gather(self.corner, index) - ref_p, gather(self.frame, index)
        return np.stack([dot(frame[:, 0], d), dot(frame[:, 1], d)]), dot(frame[:, 2], d)

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        return None


@dataclass(frozen=True, eq=False)
class WindowSampling:
    """A place in the window by the resampled image."""

    lights: PortalLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        low, high, open_ = li.window(index, ref_p)
        place, density = li.texels.sample(index, low, high, u)
        wi, stretch = li.direction(index, place)
        with np.errstate(invalid="ignore", divide="ignore"):
            pdf = density / stretch
        valid = open_ & (density > 0) & np.isfinite(pdf)
        return LightSample(wi, np.full(pdf.size, np.inf), -wi, li.of_texels(index, place), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        li = self.lights
        low, high, open_ = li.window(index, ref_p)
        place, stretch = li.place(index, wi)
        inside = open_ & ((place >= low) & (place <= high)).all(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            pdf = li.texels.density(index, low, high, np.fmax(place, 0.0)) / stretch
        return np.where(inside & np.isfinite(pdf), pdf, 0.0)


@dataclass(frozen=True, eq=False)
class PortalSolidAngle:
    """Directions uniform in the solid angle of the rectangle, whatever lies behind it."""

    lights: PortalLights

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        li = self.lights
        edges, z, omega = self._seen(index, ref_p)
        with np.errstate(invalid="ignore", divide="ignore"):
            x, y = invert(u, omega, edges[0], edges[1], edges[2], edges[3], z)
            scale = 1.0 / np.sqrt(x * x + y * y + z * z)
            frame = gather(li.frame, index)
            wi = combine((frame[:, 0], frame[:, 1], frame[:, 2]), x * scale, y * scale, z * scale)
            pdf = 1.0 / omega
        valid = (z > 0) & (omega > 0)
        place, _ = li.place(index, np.where(valid, wi, frame[:, 2]))
        return LightSample(wi, np.full(pdf.size, np.inf), -wi, li.of_texels(index, place), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        li = self.lights
        _, _, omega = self._seen(index, ref_p)
        low, high, open_ = li.window(index, ref_p)
        place, _ = li.place(index, wi)
        inside = open_ & ((place >= low) & (place <= high)).all(axis=0) & (omega > 0)
        return np.where(inside, 1.0 / np.where(inside, omega, 1.0), 0.0)

    def _seen(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        """Ends (4, n) of the rectangle along its edges, its plane's distance and its solid angle (n,)."""
        li = self.lights
        low, z = li.local(index, ref_p)
        high = low + gather(li.extent, index)
        edges = np.stack([low[0], high[0], low[1], high[1]])
        return edges, z, solid_angle(edges[0], edges[1], edges[2], edges[3], z)


def _stretch(x: Floats, y: Floats, z: Floats) -> Floats:
    """The solid angle (n,) of a unit of area in (u, v) towards unit vectors: pi^2 (1 - x^2)(1 - y^2)/z."""
    # 1 - x^2 is y^2 + z^2, which does not cancel.
    return np.pi**2 * (y * y + z * z) * (x * x + z * z) / z


def _middles(size: int) -> Floats:
    """(u, v) (2, size^2) of an image's texels, row by row."""
    middle = (np.arange(size) + 0.5) / size
    return np.stack([np.tile(middle, size), middle.repeat(size)])


def _resampled(sky: Environment, frame: Floats) -> Floats:
    """The sky's radiance (h, h, 3) at the middle of each texel, interpolated as pbrt does; SceneError for a
    sky that pbrt lets no portal have.
    """
    if sky.hemisphere or sky.mapping != "equal-area":
        raise SceneError("a portal's sky is whole, and by pbrt's own mapping", sky.where)
    image = np.ones((1, 1, 3)) if sky.image is None else sky.image
    if image.ndim != 3 or image.shape[0] != image.shape[1] or image.shape[2] != 3 or not image.size:
        raise SceneError(f"a portal's image must be square, (h, h, 3), not {image.shape}", sky.where)
    radiance = image * sky.radiance
    if not (np.isfinite(radiance) & (radiance >= 0)).all():
        raise SceneError("the radiance behind a portal must be finite and not negative", sky.where)
    size = len(image)
    x, y = np.tan(np.pi * (_middles(size) - 0.5))
    z = 1.0 / np.sqrt(1.0 + x * x + y * y)
    world = frame @ np.stack([x * z, y * z, z])
    return bilinear_on_sphere(radiance, sky.frame.T @ world).T.reshape(size, size, 3)


def _weights(image: Floats) -> Floats:
    """(h, h): the mean of red, green and blue of each texel times the solid angle of a unit of area there."""
    x, y = np.tan(np.pi * (_middles(len(image)) - 0.5))
    z = 1.0 / np.sqrt(1.0 + x * x + y * y)
    return (image / 3).sum(axis=2) * _stretch(x * z, y * z, z).reshape(image.shape[:2])


def _examples() -> list[LightExample]:
    corners = np.array([[1.0, 2.0, -1.0], [1.0, 2.0, 1.0], [-1.0, 2.0, 1.0], [-1.0, 2.0, -1.0]])
    # Below the middle, aside, near the plane, and seen through at a slant.
    p = np.array([[0.0, 0.0, 0.0], [3.0, 0.5, 1.0], [0.4, 1.9, 0.2], [-2.0, 1.0, 0.3]]).T
    n = np.array([[0.0, 1.0, 0.0], [-0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [0.0, 0.6, 0.8]]).T
    row, column = np.mgrid[:8, :8]
    smooth = 1.0 + np.sin(0.9 * row + 0.5 * column)[:, :, None] * np.array([0.9, 0.5, 0.2])
    frame = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    rgb = np.array([3.0, 2.0, 1.0])
    return [
        LightExample("a constant sky through a portal", PortalLight(Environment(rgb), corners), p, n),
        LightExample(
            "an image through a portal", PortalLight(Environment(rgb, smooth, frame=frame), corners), p, n
        ),
    ]


TECHNIQUES = ("solid-angle", "environment", "environment-compensated")
ABSENT = {
    "area": "light through a portal comes from no surface",
    "projected-solid-angle": "a portal is sampled by solid angle only",
}
LIGHTS.add("portal", LightKind(PortalLight, PortalLights.make, "portals", TECHNIQUES, _examples, ABSENT))

"""Lights that are no shapes.

Every kind says the same few things of itself, so that nobody else needs to know which kinds there are:

    where            its line of the scene file
    place            the point (3,) that it shines from, None without one
    towards          the unit vector (3,) towards a light at infinity, None for any other
    surrounds        whether it lies around the scene, the only one that a ray can meet
    has_closed_form  whether its unshadowed irradiance is a formula
    scaled           the light with its radiometric amount multiplied
    map_colors       the light with a function applied to its colours (..., 3)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PointLight:
    """A point light. position: (3,). intensity: (3,) W/sr."""

    surrounds: ClassVar[bool] = False
    towards: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = True

    position: Array
    intensity: Array
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def place(self) -> Array:
        return self.position

    def scaled(self, factor: float) -> PointLight:
        return replace(self, intensity=self.intensity * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> PointLight:
        return replace(self, intensity=change(self.intensity))


@dataclass(frozen=True, eq=False)
class SpotLight:
    """A point light that fades out around its axis.

    position: (3,). axis: (3,) unit, the way it shines. intensity: (3,) W/sr along the axis. It shines in full
    up to `falloff_start` degrees off the axis and not at all from `cone` degrees on, with pbrt's smoothstep
    of the cosine in between.
    """

    surrounds: ClassVar[bool] = False
    towards: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = True

    position: Array
    axis: Array
    intensity: Array
    cone: float
    falloff_start: float
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def place(self) -> Array:
        return self.position

    def scaled(self, factor: float) -> SpotLight:
        return replace(self, intensity=self.intensity * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> SpotLight:
        return replace(self, intensity=change(self.intensity))


@dataclass(frozen=True, eq=False)
class DistantLight:
    """Light from one direction. wi: (3,) unit, towards the light. irradiance: (3,) W/m^2 on a surface that
    faces it, pbrt's `L`.
    """

    surrounds: ClassVar[bool] = False
    place: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = True

    wi: Array
    irradiance: Array
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def towards(self) -> Array:
        return self.wi

    def scaled(self, factor: float) -> DistantLight:
        return replace(self, irradiance=self.irradiance * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> DistantLight:
        return replace(self, irradiance=change(self.irradiance))


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all around, or from the half about the frame's third axis only.

    radiance: (3,), W/(m^2 sr), multiplies the image. image: (h, w, 3) float64 or None. frame: (3, 3) float64,
    columns the light's own axes in world space, orthonormal (left-handed under a mirror). hemisphere: whether
    the light ends where its own z is 0.

    mapping: how directions fall on the image. "equal-area" is pbrt's square octahedral map. In
    "latitude-longitude", which is ours, the first row is about +z of the light's own space, and columns go by
    the angle from +x towards +y.
    """

    surrounds: ClassVar[bool] = True
    place: ClassVar[None] = None
    towards: ClassVar[None] = None

    radiance: Array
    image: Array | None = None
    mapping: str = "equal-area"
    frame: Array = field(default_factory=lambda: np.eye(3))
    hemisphere: bool = False
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def has_closed_form(self) -> bool:
        return self.image is None

    @property
    def in_pbrt(self) -> bool:
        """Whether pbrt-v4 has such a light: one over the whole sphere, by its own mapping."""
        return not self.hemisphere and (self.image is None or self.mapping == "equal-area")

    def scaled(self, factor: float) -> Environment:
        return replace(self, radiance=self.radiance * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> Environment:
        image = None if self.image is None else change(self.image)
        return replace(self, radiance=change(self.radiance), image=image)


@dataclass(frozen=True, eq=False)
class PortalLight:
    """A sky that shines in through a rectangle; from everywhere else it is dark.

    sky: an `Environment` over the whole sphere, by pbrt's own mapping. corners: (4, 3), in turn around the
    rectangle, in world space. Light passes against the cross product of the edges from the first corner to
    the last and to the second: a point on the other side gets none.

    pbrt does not look the sky's image up itself. It resamples it to angles about the portal's axes, as many
    texels as the image has, and reads the nearest of those [pharr2023, sec. 12.5.3].
    """

    surrounds: ClassVar[bool] = True
    place: ClassVar[None] = None
    towards: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = False

    sky: Environment
    corners: Array

    @property
    def where(self) -> Location | None:
        return self.sky.where

    def scaled(self, factor: float) -> PortalLight:
        return replace(self, sky=self.sky.scaled(factor))

    def map_colors(self, change: Callable[[Array], Array]) -> PortalLight:
        return replace(self, sky=self.sky.map_colors(change))


@dataclass(frozen=True, eq=False)
class GoniometricLight:
    """A point light whose intensity in each direction is a texel of an image.

    position: (3,). frame: (3, 3), columns the axes of the image's equal-area map in world space, orthonormal
    (left-handed under a mirror). intensity: (3,), W/sr, multiplies the image (h, h), one number a texel.
    Source: [pharr2023, sec. 12.2.3].
    """

    surrounds: ClassVar[bool] = False
    towards: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = True

    position: Array
    frame: Array
    intensity: Array
    image: Array
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def place(self) -> Array:
        return self.position

    def scaled(self, factor: float) -> GoniometricLight:
        return replace(self, intensity=self.intensity * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> GoniometricLight:
        return replace(self, intensity=change(self.intensity))


@dataclass(frozen=True, eq=False)
class ProjectionLight:
    """A slide projector: a point light whose intensity is an image on a plane before it.

    position: (3,). frame: (3, 3), columns the way that the image's columns go, up to its first row, and along
    its middle, in world space, orthonormal (left-handed under a mirror). intensity: (3,), W/sr, multiplies
    the image (h, w, 3). fov: degrees that its shorter side spans. Source: [pharr2023, sec. 12.2.2].
    """

    surrounds: ClassVar[bool] = False
    towards: ClassVar[None] = None
    has_closed_form: ClassVar[bool] = True

    position: Array
    frame: Array
    intensity: Array
    image: Array
    fov: float
    where: Location | None = field(default=None, metadata={"content": False})

    @property
    def place(self) -> Array:
        return self.position

    @property
    def half(self) -> tuple[float, float]:
        """Half the width and half the height of the image on the plane at distance 1."""
        height, width = self.image.shape[:2]
        pixel = float(np.tan(np.radians(self.fov) / 2)) / min(height, width)
        return pixel * width, pixel * height

    def scaled(self, factor: float) -> ProjectionLight:
        return replace(self, intensity=self.intensity * factor)

    def map_colors(self, change: Callable[[Array], Array]) -> ProjectionLight:
        return replace(self, intensity=change(self.intensity), image=change(self.image))


Light = PointLight | SpotLight | DistantLight | Environment | PortalLight | GoniometricLight | ProjectionLight


def environments(lights: Iterable[Light]) -> tuple[Environment, ...]:
    """The environment lights among `lights`, without those behind a portal."""
    return tuple(light for light in lights if isinstance(light, Environment))

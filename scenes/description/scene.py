"""The description of a scene: frozen, in world space, in float64, free of any renderer.

Conventions are pbrt-v4's. Camera space is left-handed: x right, y up, z into the scene. `fov` is the full
angle in degrees over the shorter side of the film. Radiance is linear RGB. Normals are geometric, and an
emitting shape emits on the side of its normal only.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from scenes.description.lights import Light
from scenes.description.shapes import ShapeDescription
from scenes.errors import SceneError
from scenes.hashing import hash_values

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Lens:
    """A thin lens in the plane z = 0 of camera space that images the plane z = `distance` sharply.

    radius, distance: in units of camera space. Source: [pharr2023, sec. 5.2.3].
    """

    radius: float
    distance: float


@dataclass(frozen=True, eq=False)
class PerspectiveCamera:
    """A pinhole or a thin lens at the origin of pbrt's left-handed camera space.

    camera_to_world: (4, 4) float64, any invertible affine map. fov: degrees that two units of the screen
    span. window: (4,) left, right, bottom and top of the film on the screen; None for the film's own shape,
    whose shorter side reaches from -1 to 1. lens: None for a pinhole.
    """

    camera_to_world: Array
    fov: float
    window: Array | None = None
    lens: Lens | None = None
    kind: ClassVar[str] = "perspective"

    @property
    def own(self) -> dict[str, float | str]:
        """The parameters of this kind of camera alone, as pbrt names them."""
        return {"fov": self.fov}

    def whole(self, width: int, height: int) -> Array:
        """The window (4,) of a film of this size, without `screenwindow` and `frameaspectratio`."""
        return np.array([-width, width, -height, height]) / min(width, height)

    def film_plane(self, film: Film) -> tuple[float, float, float, float]:
        """Left, top, dx, dy: the film point (x, y), in pixels, lies at (left + x dx, top - y dy, 1).

        Source: [pharr2023, sec. 5.2.2].
        """
        return _film_plane(float(np.tan(np.radians(self.fov) / 2)), self.window, film)

    def pinhole(self, who: str) -> PerspectiveCamera:
        """The camera itself. Raises SceneError for a camera with a lens, which `who` does not support."""
        if self.lens is not None:
            raise SceneError(f"{who} takes a pinhole camera only, not one with a lens")
        return self


@dataclass(frozen=True, eq=False)
class OrthographicCamera:
    """Parallel rays along z from the film, which lies in the plane z = 0 of camera space.

    camera_to_world, window, lens: as of `PerspectiveCamera`; the film is the window itself. With a lens all
    rays start on the lens, as pbrt has it, towards the points that parallel rays meet at its distance.
    Source: [pharr2023, sec. 5.2.1].
    """

    camera_to_world: Array
    window: Array | None = None
    lens: Lens | None = None
    kind: ClassVar[str] = "orthographic"
    own: ClassVar[dict[str, float | str]] = {}

    def whole(self, width: int, height: int) -> Array:
        """The window (4,) of a film of this size; see `PerspectiveCamera`."""
        return np.array([-width, width, -height, height]) / min(width, height)

    def film_plane(self, film: Film) -> tuple[float, float, float, float]:
        """Left, top, dx, dy: the film point (x, y), in pixels, lies at (left + x dx, top - y dy, 0)."""
        return _film_plane(1.0, self.window, film)

    def pinhole(self, who: str) -> PerspectiveCamera:
        """Raises SceneError: an orthographic camera has no pinhole."""
        raise SceneError(f"{who} takes a pinhole camera only, not an orthographic one")


@dataclass(frozen=True, eq=False)
class SphericalCamera:
    """Rays all around from the origin of camera space, whose y is up.

    camera_to_world: as of `PerspectiveCamera`. mapping: "equalarea", the map of environments with y and z
    swapped, or "equirectangular": columns turn from +x towards +z, and rows go from +y to -y. window: (4,)
    left, right, bottom and top of the film on that map, whose top left is (0, 0); None for all of it.
    Source: [pharr2023, sec. 5.3].
    """

    camera_to_world: Array
    mapping: str = "equalarea"
    window: Array | None = None
    lens: ClassVar[None] = None
    kind: ClassVar[str] = "spherical"

    @property
    def own(self) -> dict[str, float | str]:
        """The parameters of this kind of camera alone; see `PerspectiveCamera`."""
        return {"mapping": self.mapping}

    def whole(self, width: int, height: int) -> Array:
        """The window (4,) of a film of this size; see `PerspectiveCamera`."""
        return np.array([0.0, 1.0, 1.0, 0.0])

    def film_plane(self, film: Film) -> tuple[float, float, float, float]:
        """Left, top, dx, dy: the film point (x, y), in pixels, lies at (left + x dx, top - y dy) of the
        map.
        """
        left, right, bottom, top = (self.whole(0, 0) if self.window is None else self.window).tolist()
        return left, top, (right - left) / film.width, (top - bottom) / film.height

    def crop(self, film: Film) -> tuple[tuple[int, int], tuple[int, int, int, int]] | None:
        """Width and height of the whole film, and the pixels x0, x1, y0, y1 of it that are rendered."""
        if self.window is None:
            return None
        left, right, bottom, top = self.window.tolist()
        width, height = round(film.width / (right - left)), round(film.height / (bottom - top))
        x, y = round(left * width), round(top * height)
        return (width, height), (x, x + film.width, y, y + film.height)

    def pinhole(self, who: str) -> PerspectiveCamera:
        """Raises SceneError: a spherical camera has no film plane before its pinhole."""
        raise SceneError(f"{who} takes a pinhole camera only, not a spherical one")


Camera = PerspectiveCamera | OrthographicCamera | SphericalCamera


def _film_plane(half: float, window: Array | None, film: Film) -> tuple[float, float, float, float]:
    """Left, top, dx, dy of a camera whose screen reaches from -half to half over the film's shorter side."""
    if window is None:
        pixel = 2 * half / min(film.width, film.height)
        return -(pixel * film.width / 2), pixel * film.height / 2, pixel, pixel
    left, right, bottom, top = (window * half).tolist()
    return left, top, (right - left) / film.width, (top - bottom) / film.height


@dataclass(frozen=True, eq=False)
class PixelFilter:
    """pbrt's pixel filter: the weight of a sample by its offset from a pixel's centre. kind: "box",
    "triangle" or "gaussian". xradius, yradius: in pixels, beyond which the weight is 0. sigma: in pixels, of
    the gaussian alone.
    """

    kind: str = "box"
    xradius: float = 0.5
    yradius: float = 0.5
    sigma: float = 0.5


@dataclass(frozen=True, eq=False)
class Film:
    """Size in pixels and pixel filter. `filename` is the name that the file asks for; it is no part of the
    content.
    """

    width: int
    height: int
    filename: str = field(default="", metadata={"content": False})
    pixel_filter: PixelFilter = PixelFilter()


@dataclass(frozen=True, eq=False)
class RenderDefaults:
    """The sampler and estimator that a file asks for, which a request may override. A field is None where the
    file gives none.
    """

    sampler: str = "independent"
    spp: int = 16
    seed: int = 0
    estimator: str | None = None


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A whole scene.

    lights: the lights that have no shape. occlusion_distance: the reach of ambient occlusion, in world units.
    parameters: the values of a template's `$name`s, no part of the content. notes: sentences on how the image
    differs from pbrt's of the same file. substitutions: sentences on what is rendered as something else by
    request; such a scene gets no reference.
    """

    name: str = field(metadata={"content": False})
    camera: Camera
    film: Film
    shapes: tuple[ShapeDescription, ...]
    lights: tuple[Light, ...] = ()
    occlusion_distance: float = np.inf
    defaults: RenderDefaults = field(default=RenderDefaults(), metadata={"content": False})
    parameters: tuple[tuple[str, float], ...] = field(default=(), metadata={"content": False})
    notes: tuple[str, ...] = field(default=(), metadata={"content": False})
    substitutions: tuple[str, ...] = field(default=(), metadata={"content": False})

    def content_hash(self) -> str:
        """SHA-256 over all that an image depends on: every number of geometry, materials, emission, camera
        and film.

        Assets count by content: an edited mesh file changes the hash. Names, comments and source locations do
        not.
        """
        return hash_values(self)

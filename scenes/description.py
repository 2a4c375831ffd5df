"""What a scene is, once its text is read: frozen, in world space, in float64, free of any renderer.

Conventions are pbrt-v4's: the camera space is left-handed (x right, y up, z into the scene), `fov` is the
full angle in degrees over the shorter side of the film, radiance is linear RGB, normals are geometric and
an emitting shape emits on the side of its normal only.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles; a face's normal is (p1-p0) x (p2-p0), turned round where `reverse` is set.

    vertices: (m, 3) float64, world space. faces: (t, 3) int64.
    """

    vertices: Array
    faces: NDArray[np.int64]
    reverse: bool = False


@dataclass(frozen=True, eq=False)
class BilinearMesh:
    """Planar bilinear patches, corners in pbrt's order p00 p10 p01 p11; normal (p10-p00) x (p01-p00), turned if `reverse`.

    vertices: (m, 3) float64, world space. faces: (q, 4) int64.
    """

    vertices: Array
    faces: NDArray[np.int64]
    reverse: bool = False


@dataclass(frozen=True, eq=False)
class Sphere:
    """A full sphere; its normal points outwards, inwards if `reverse`. center: (3,) float64, world space."""

    center: Array
    radius: float
    reverse: bool = False


@dataclass(frozen=True, eq=False)
class Disk:
    """A full disk. center: (3,) float64; normal: (3,) float64, unit, the side it emits on (`ReverseOrientation` is already in it)."""

    center: Array
    normal: Array
    radius: float


Geometry = TriangleMesh | BilinearMesh | Sphere | Disk


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambertian, two-sided as pbrt's. reflectance: (3,) float64 in [0, 1]."""

    reflectance: Array


Material = Diffuse


@dataclass(frozen=True, eq=False)
class Emission:
    """Diffuse area emission. radiance: (3,) float64, W/(m^2 sr), `scale` and the like already in it."""

    radiance: Array
    two_sided: bool = False


@dataclass(frozen=True, eq=False)
class ShapeDescription:
    """One `Shape` of the scene file. `where` is for messages and no part of the content."""

    geometry: Geometry
    material: Material
    emission: Emission | None = None
    where: Location | None = field(default=None, metadata={"content": False})


@dataclass(frozen=True, eq=False)
class PerspectiveCamera:
    """camera_to_world: (4, 4) float64 from pbrt's left-handed camera space. fov: degrees over the shorter side of the film."""

    camera_to_world: Array
    fov: float


@dataclass(frozen=True, eq=False)
class Film:
    """Size in pixels and the box filter of one pixel; `filename` is what the file asked for, and no part of the content."""

    width: int
    height: int
    filename: str = field(default="", metadata={"content": False})


@dataclass(frozen=True, eq=False)
class RenderDefaults:
    """What the file asks of a renderer: `Sampler` and `Integrator`, defaults that a request may override."""

    sampler: str = "independent"
    spp: int = 16
    seed: int = 0


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A whole scene. `parameters` are the values of a template's `$name`s; they are no part of the content."""

    name: str = field(metadata={"content": False})
    camera: PerspectiveCamera
    film: Film
    shapes: tuple[ShapeDescription, ...]
    defaults: RenderDefaults = field(default=RenderDefaults(), metadata={"content": False})
    parameters: tuple[tuple[str, float], ...] = field(default=(), metadata={"content": False})

    def content_hash(self) -> str:
        """SHA-256 over all that an image depends on: every number of geometry, materials, emission, camera and film.

        Assets count by content, not by name: a mesh file that was edited changes the hash. Names, comments and
        source locations do not.
        """
        digest = hashlib.sha256()
        _feed(digest, self)
        return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    """Feed `value` into `digest` unambiguously: each item goes in with its type and its length."""
    if is_dataclass(value) and not isinstance(value, type):
        digest.update(f"<{type(value).__name__}>".encode())
        for item in fields(value):
            if item.metadata.get("content", True):
                digest.update(item.name.encode())
                _feed(digest, getattr(value, item.name))
    elif isinstance(value, np.ndarray):
        value = cast("NDArray[Any]", value)
        digest.update(f"[{value.dtype.str}{value.shape}]".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, tuple):
        value = cast("tuple[Any, ...]", value)
        digest.update(f"({len(value)})".encode())
        for item in value:
            _feed(digest, item)
    else:
        text = repr(value).encode()
        digest.update(f"{type(value).__name__}:{len(text)}:".encode() + text)

"""A `SceneDescription` as real pbrt-v4 text: one self-contained file that pbrt-v4 renders to the same image.

Numbers are written so that reading them gives the same float64, and transformations so that no rounding enters
(a rotation is inverted by transposition, and translations stand apart from it). What is read back is therefore
bitwise the description that was written, with the same `content_hash`; a camera whose axes are farther from
orthonormal than `transforms.ROUNDING` cannot come from a scene file and is refused.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from scenes.description import (
    Disk,
    Film,
    Geometry,
    PerspectiveCamera,
    RenderDefaults,
    SceneDescription,
    ShapeDescription,
    Sphere,
    TriangleMesh,
)
from scenes.errors import PenumbraError
from scenes.transforms import ROUNDING

WRAP = 12  # numbers a line


def to_pbrt(scene: SceneDescription) -> str:
    """The scene as pbrt-v4 text, meshes inline, in the world's coordinates and with direct light only."""
    lines = [f"# {_comment(scene.name)}, exported by penumbra"]
    if scene.parameters:
        lines.append("# with " + ", ".join(f"{name} = {value!r}" for name, value in scene.parameters))
    lines += [*_camera(scene.camera), *_film(scene.film, scene.name), *_sampling(scene.defaults), "", "WorldBegin"]
    for shape in scene.shapes:
        lines += ["", "AttributeBegin", *(f"  {line}" for line in _shape(shape)), "AttributeEnd"]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    return " ".join(text.split()) or "scene"


def _camera(camera: PerspectiveCamera) -> list[str]:
    rotation = camera.camera_to_world[:3, :3]
    if np.abs(rotation.T @ rotation - np.eye(3)).max() > ROUNDING:
        raise PenumbraError("the camera's axes are not orthonormal: there is no exact pbrt text for it")
    x, y, z = (-camera.camera_to_world[:3, 3]).tolist()
    return [
        *_matrix("Transform", rotation.T),
        f"Translate {x!r} {y!r} {z!r}",
        f'Camera "perspective" "float fov" [ {camera.fov!r} ]',
    ]


def _matrix(directive: str, linear: NDArray[np.float64]) -> list[str]:
    """A linear map, column after column as pbrt reads it."""
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    columns = (" ".join(repr(value) for value in column) for column in (matrix.T + 0.0).tolist())
    return [f"{directive} [ {'  '.join(columns)} ]"]


def _film(film: Film, name: str) -> list[str]:
    filename = film.filename or f"{_comment(name)}.exr"
    return [
        f'Film "rgb" "integer xresolution" [ {film.width} ] "integer yresolution" [ {film.height} ]'
        f' "string filename" [ {_quoted(filename)} ] "bool savefp16" [ false ]',
        'PixelFilter "box" "float xradius" [ 0.5 ] "float yradius" [ 0.5 ]',
    ]


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    return f'"{escaped}"'


def _sampling(defaults: RenderDefaults) -> list[str]:
    return [
        f'Sampler "{defaults.sampler}" "integer pixelsamples" [ {defaults.spp} ] "integer seed" [ {defaults.seed} ]',
        'Integrator "path" "integer maxdepth" [ 1 ]',
    ]


def _shape(shape: ShapeDescription) -> list[str]:
    lines: list[str] = []
    if shape.emission is not None:
        sides = ' "bool twosided" [ true ]' if shape.emission.two_sided else ""
        lines.append(f'AreaLightSource "diffuse" "rgb L" [ {_numbers(shape.emission.radiance)} ]{sides}')
    lines.append(f'Material "diffuse" "rgb reflectance" [ {_numbers(shape.material.reflectance)} ]')
    return [*lines, *_geometry(shape.geometry)]


def _geometry(geometry: Geometry) -> list[str]:
    if isinstance(geometry, Disk):
        return [*_frame(geometry), f'Shape "disk" "float radius" [ {geometry.radius!r} ]']
    lines = ["ReverseOrientation"] if geometry.reverse else []
    if isinstance(geometry, Sphere):
        center = f"Translate {_numbers(geometry.center)}"
        return [*lines, center, f'Shape "sphere" "float radius" [ {geometry.radius!r} ]']
    kind = "trianglemesh" if isinstance(geometry, TriangleMesh) else "bilinearmesh"
    points = _block('"point3 P"', geometry.vertices.ravel().tolist())
    return [*lines, f'Shape "{kind}"', *points, *_block('"integer indices"', geometry.faces.ravel().tolist())]


def _frame(disk: Disk) -> list[str]:
    """A right-handed frame at the disk's centre whose third axis is its normal, to the bit."""
    normal = disk.normal
    tangent = np.cross(np.eye(3)[int(np.argmin(np.abs(normal)))], normal)
    tangent /= np.linalg.norm(tangent)
    frame = np.stack([tangent, np.cross(normal, tangent), normal], axis=1)
    return [f"Translate {_numbers(disk.center)}", *_matrix("ConcatTransform", frame)]


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(repr(value) for value in values.tolist())


def _block(name: str, values: list[float] | list[int]) -> list[str]:
    rows: Iterable[str] = (" ".join(map(repr, values[i : i + WRAP])) for i in range(0, len(values), WRAP))
    return [f"  {name} [", *(f"    {row}" for row in rows), "  ]"]

"""A pbrt-v4 scene file under construction: directives, images beside it, and the losses of the conversion."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scenes.arrays import Array, Index
from scenes.description.lights import Light
from scenes.description.materials import Material
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Emission
from scenes.errors import Location, PenumbraError
from scenes.images.exr import write_exr
from scenes.pbrt.directives.lights import area_light_text, light_text
from scenes.pbrt.directives.materials import material_text
from scenes.pbrt.directives.textures import TextureWriter
from scenes.pbrt.parser import parse_file
from scenes.pbrt.write.side_files import SideFiles
from scenes.pbrt.write.text import block, comment, numbers

DIRECT = 'Integrator "path" "integer maxdepth" [ 1 ]'


@dataclass(eq=False)
class Losses:
    """Everything that a conversion could not keep, by kind, with the places where it stood."""

    _kinds: dict[str, list[str]] = field(default_factory=dict[str, list[str]])

    def add(self, what: str, where: Location | str) -> None:
        """Note a kind of loss at a place; the same place counts once."""
        places = self._kinds.setdefault(what, [])
        if str(where) not in places:
            places.append(str(where))

    def lines(self) -> tuple[str, ...]:
        """One line for each kind: its first place, and how many more there are."""
        return tuple(
            f"{what} ({places[0]}{f' and {len(places) - 1} more' if len(places) > 1 else ''})"
            for what, places in self._kinds.items()
        )


@dataclass(eq=False)
class Document:
    """A scene file that grows by directives.

    stem: how the names of its images begin. head: the lines before WorldBegin.
    """

    stem: str
    losses: Losses = field(default_factory=Losses)
    head: list[str] = field(default_factory=list[str])
    _body: list[str] = field(default_factory=list[str])

    def __post_init__(self) -> None:
        self._files = SideFiles(self.stem)
        self._textures = TextureWriter(self._files)

    @property
    def images(self) -> dict[str, Array]:
        """The images beside the file, (h, w, 3) by file name, to be written as float32."""
        return self._files.images

    def light(self, light: Light) -> None:
        """Add a light without a shape."""
        self._attribute(light_text(light, self._files))

    def shape(self, lines: Sequence[str], material: Material, emission: Emission | None) -> None:
        """Add a shape. lines: the directives that place it."""
        before = [] if emission is None else [area_light_text(emission, self._files)]
        self._attribute([*before, *material_text(material, self._textures), *lines])

    def _attribute(self, lines: Sequence[str]) -> None:
        self._body += ["", "AttributeBegin", *(f"  {line}" for line in lines), "AttributeEnd"]

    def camera(self, to_world: Array, directive: str) -> None:
        """Set the camera. to_world: (4, 4), from pbrt's left-handed camera space. directive: its `Camera`
        line.
        """
        try:
            to_camera = np.linalg.inv(to_world)
        except np.linalg.LinAlgError:
            raise PenumbraError(f"{self.stem}: the camera's transformation has no inverse") from None
        self.head += [placed("Transform", to_camera.astype(np.float64)), directive]

    def film(self, width: int, height: int, pixel_filter: str, spp: int) -> None:
        """Set the film, its `PixelFilter` directive and the samples a pixel, and ask for direct light."""
        self.head += [
            f'Film "rgb" "integer xresolution" [ {width} ] "integer yresolution" [ {height} ]'
            f' "string filename" [ "{self.stem}.exr" ] "bool savefp16" [ false ]',
            pixel_filter,
            f'Sampler "independent" "integer pixelsamples" [ {spp} ]',
            DIRECT,
        ]

    def text(self, origin: str) -> str:
        """The text of the whole file. origin: the name of the file that was converted."""
        told = [f"# {comment(line)}" for line in self.losses.lines()]
        title = f"# {comment(origin)}, converted by penumbra"
        return "\n".join([title, *told, *self.head, "", "WorldBegin", *self._body]) + "\n"


def placed(directive: str, matrix: Array) -> str:
    """`Transform` or `ConcatTransform` of a matrix (4, 4), column after column as pbrt reads it."""
    columns = (" ".join(repr(value) for value in column) for column in (matrix.T + 0.0).tolist())
    return f"{directive} [ {'  '.join(columns)} ]"


def mesh_lines(
    vertices: Array,
    faces: Index,
    uv: Array | None = None,
    normals: Array | None = None,
    reverse: bool = False,
) -> list[str]:
    """A triangle mesh in world space: vertices (m, 3), faces (t, 3), uv (m, 2), normals (m, 3).

    reverse: whether the geometric normal is opposite to that of the corners' order. The shading normals lie
    on the side of the geometric one.
    """
    lines = ["ReverseOrientation"] if reverse else []
    lines += ['Shape "trianglemesh"', *block('"point3 P"', (vertices + 0.0).ravel().tolist())]
    if uv is not None:
        lines += block('"point2 uv"', (uv + 0.0).ravel().tolist())
    if normals is not None:  # ReverseOrientation turns them too
        lines += block('"normal N"', ((-normals if reverse else normals) + 0.0).ravel().tolist())
    return [*lines, *block('"integer indices"', faces.ravel().tolist())]


def patch_lines(corners: Array, reverse: bool = False) -> list[str]:
    """One bilinear patch with corners (4, 3) p00 p10 p01 p11."""
    lines = ["ReverseOrientation"] if reverse else []
    return [*lines, f'Shape "bilinearmesh" "point3 P" [ {numbers(corners + 0.0)} ]']


def write(document: Document, origin: str, output: Path) -> SceneDescription:
    """Write the text and its images, which get their final names once all are read back as a scene.

    Returns that scene. PenumbraError if a file cannot be written, or Penumbra cannot render the scene.
    """
    if output.name in document.images:
        raise PenumbraError(f"{output}: an image beside it would have its name")
    try:
        with tempfile.TemporaryDirectory(prefix=".convert-", dir=output.parent) as name:
            folder = Path(name)
            for file, image in document.images.items():
                write_exr(folder / file, {channel: image[..., i] for i, channel in enumerate("RGB")})
            (folder / output.name).write_text(document.text(origin), encoding="utf-8")
            scene = parse_file(folder / output.name)
            for file in (*document.images, output.name):
                (folder / file).replace(output.with_name(file))
    except OSError as error:
        raise PenumbraError(f"{output}: cannot be written: {error.strerror or error}") from error
    return scene

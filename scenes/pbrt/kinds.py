"""The kinds of each directive: rendered, with a stand-in, or refused.

`python -m scenes.pbrt.kinds` prints them as the table of docs/scenes.md; a test compares the two.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from scenes.pbrt.directives import camera, integrator, lights, materials, media, shapes, stand_ins, textures
from scenes.pbrt.state import FILTERS
from scenes.pbrt.text.parameters import SPACES

# What the `Create` functions of pbrt-v4's sources know.
PBRT = {
    "Camera": "perspective orthographic spherical realistic",
    "Film": "rgb gbuffer spectral",
    "PixelFilter": "box triangle gaussian mitchell sinc",
    "Sampler": "independent stratified halton paddedsobol sobol zsobol pmj02bn",
    "Integrator": (
        "path simplepath volpath simplevolpath randomwalk lightpath bdpt mlt sppm ambientocclusion function"
    ),
    "Shape": "sphere disk cylinder trianglemesh plymesh bilinearmesh loopsubdiv curve",
    "LightSource": "point spot distant infinite goniometric projection",
    "AreaLightSource": "diffuse",
    "Material": (
        "diffuse conductor dielectric thindielectric coateddiffuse coatedconductor diffusetransmission mix "
        "interface subsurface measured hair"
    ),
    "Texture": (
        "constant scale mix directionmix imagemap ptex bilerp checkerboard dots fbm marble windy wrinkled"
    ),
    "MakeNamedMedium": "homogeneous uniformgrid rgbgrid cloud nanovdb",
    "ColorSpace": "srgb rec2020 dci-p3 aces2065-1",
}


@dataclass(frozen=True)
class Kinds:
    """The kinds of one directive. other: kinds that are read and are not pbrt-v4's."""

    directive: str
    rendered: tuple[str, ...]
    substituted: tuple[str, ...]
    refused: tuple[str, ...]
    other: tuple[str, ...]


def _read() -> dict[str, tuple[Collection[str], Collection[str]]]:
    """The kinds that are rendered, by directive, and those with a stand-in."""
    transport = (*integrator.PATHS, *integrator.TRANSPORT, "ambientocclusion")
    return {
        "Camera": (_but(camera.KINDS, camera.STAND_INS), camera.STAND_INS),
        "Film": (camera.FILMS, ()),
        "PixelFilter": (FILTERS, camera.SHARPENING),
        "Sampler": (integrator.SAMPLERS, ()),
        "Integrator": (transport, ()),
        "Shape": (shapes.kinds(), ()),
        "LightSource": (lights.kinds(), ()),
        "AreaLightSource": (("diffuse",), ()),
        "Material": (_but(materials.kinds(), stand_ins.KINDS), stand_ins.KINDS),
        "Texture": (_but(textures.kinds(), textures.STAND_INS), textures.STAND_INS),
        "MakeNamedMedium": ((), media.MEDIA),
        "ColorSpace": (SPACES, ()),
    }


def _but(kinds: Collection[str], others: Collection[str]) -> tuple[str, ...]:
    return tuple(kind for kind in kinds if kind not in others)


def kinds() -> Iterator[Kinds]:
    """The kinds of every directive, in pbrt's order."""
    for directive, (rendered, substituted) in _read().items():
        known = PBRT[directive].split()
        yield Kinds(
            directive,
            tuple(kind for kind in known if kind in rendered),
            tuple(kind for kind in known if kind in substituted),
            tuple(kind for kind in known if kind not in rendered and kind not in substituted),
            tuple(kind for kind in (*rendered, *substituted) if kind not in known),
        )


def table() -> str:
    """The kinds as Markdown."""
    lines = ["| directive | rendered | rendered by `--substitute` | refused |", "| --- | --- | --- | --- |"]
    for row in kinds():
        cells = (
            ", ".join(f"`{kind}`" for kind in part) for part in (row.rendered, row.substituted, row.refused)
        )
        lines.append(f"| `{row.directive}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(table(), end="")

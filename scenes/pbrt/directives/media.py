"""Participating media and the surfaces between them: `MakeNamedMedium`, `MediumInterface`, `"interface"`.

No medium is simulated. pbrt's surface integrators ignore media too, so a medium counts only under a
volumetric integrator. Even then a ray must be able to enter it: from a camera inside, or at a surface between
two media that is not closed around one of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from scenes.description.shapes import Geometry
from scenes.errors import Location, SceneError
from scenes.pbrt.directives.enclosures import enclosure, hides
from scenes.pbrt.state import (
    AreaLight,
    Builder,
    Interface,
    MaterialUse,
    MediumUse,
    NamedMaterial,
    PlacedShape,
    check_room,
)
from scenes.pbrt.text.parameters import Parameters

VOLUMETRIC = ("volpath", "simplevolpath", "bdpt", "mlt")
MEDIA = ("homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb")
LIGHTLESS = 'a shape of material "interface" is no area light: its light is left out, as in pbrt'
BLOCKING = (
    'in pbrt this integrator lets material "interface" block point, spot and distant lights and occlusion; '
    "light passes here, as volpath has it"
)


def named_medium(builder: Builder, name: str, parameters: Parameters) -> None:
    """`MakeNamedMedium`. A medium counts only where something uses it."""
    if name in builder.media:
        raise SceneError(f'medium "{name}" is made twice', parameters.where)
    check_room(builder.media, "media", parameters.where)
    builder.media[name] = parameters.where
    kind = parameters.text("type", "")
    parameters.ignore()
    if kind not in MEDIA:
        allowed = ", ".join(f'"{one}"' for one in MEDIA)
        raise parameters.fail("type", f'MakeNamedMedium "{name}" needs "string type", one of {allowed}')


def is_interface(builder: Builder, use: MaterialUse) -> bool:
    """Whether light passes through a surface of this material, as far as names are known so far."""
    return isinstance(builder.materials.get(use.name) if isinstance(use, NamedMaterial) else use, Interface)


def leave_out(builder: Builder, light: AreaLight | None, where: Location) -> None:
    """Leave out a shape that light passes through, and its light with it, as pbrt does."""
    builder.interfaces += 1
    if light is not None:
        builder.report.remark(LIGHTLESS, where)


def surfaces(builder: Builder, shapes: Iterable[PlacedShape]) -> list[PlacedShape]:
    """The shapes that light does not pass through."""
    kept: list[PlacedShape] = []
    for shape in shapes:
        if is_interface(builder, shape.material):
            leave_out(builder, shape.light, shape.where)
        else:
            kept.append(shape)
    return kept


def check_media(builder: Builder) -> None:
    """Raise SceneError for a medium that is used but never made."""
    for use in builder.media_used:
        for name in filter(None, (use.media.inside, use.media.outside)):
            if name not in builder.media:
                there = ", ".join(builder.media) or "none"
                raise SceneError(f"no medium is called {name!r}; there are: {there}", use.media.where)


def report_media(builder: Builder) -> None:
    """Report each medium that would change the image, and interfaces that pbrt would let block light."""
    kind, place = builder.integrator or ("volpath", None)
    instanced = {None, *(use.name for use in builder.uses)}
    emitters = [shape.geometry for shape in builder.shapes if shape.light is not None]
    for use in builder.media_used:
        media = use.media
        if media.inside == media.outside or use.owner not in instanced:  # no ray enters it there
            continue
        if kind in VOLUMETRIC:
            if not _enclosed(builder, use, emitters):
                builder.report.substitute("a medium", "as empty space", media.where)
        else:
            ignored = f'a medium is left out, as pbrt leaves it out with Integrator "{kind}"'
            builder.report.remark(ignored, media.where)
    blockable = kind == "ambientocclusion" or any(not light.surrounds for light in builder.lights)
    if builder.interfaces and kind not in VOLUMETRIC and place is not None and blockable:
        builder.report.note(BLOCKING, place)


def _enclosed(builder: Builder, use: MediumUse, emitters: Sequence[Geometry]) -> bool:
    """Whether closed surfaces hide the medium from direct light; see `enclosures`."""

    def encloses(part: PlacedShape) -> bool:
        if part.alpha is not None or part.light is not None or is_interface(builder, part.material):
            return False
        shell = enclosure(part.geometry)
        outside = None if shell is None else use.media.outside if shell.outward else use.media.inside
        return shell is not None and outside == "" and hides(shell, builder.camera, builder.lights, emitters)

    return use.owner is None and bool(use.parts) and all(encloses(part) for part in use.parts)

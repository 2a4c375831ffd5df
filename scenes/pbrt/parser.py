"""pbrt-v4 text to a frozen `SceneDescription`.

Every directive of the format is read. The tables of docs/scenes.md list what is simulated of each. A file
that asks for anything else is refused with one message that lists all of it by kind; what is malformed is an
error at once, at its place.

Where a file says nothing, pbrt's defaults hold: its camera, its film, its gaussian filter of 1.5 pixels. Two
are ours: without an `Integrator` it is direct light (pbrt's would go on for five bounces), without a
`Sampler` independent samples (pbrt's are zsobol).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from scenes.description.materials import MixedMaterial
from scenes.description.scene import SceneDescription
from scenes.description.shapes import Emission, Geometry, Quadric, ShapeDescription
from scenes.errors import PenumbraError, Report, SceneError
from scenes.files import Files
from scenes.pbrt.directives.emission import apply_area_light
from scenes.pbrt.directives.environment import sum_environments
from scenes.pbrt.directives.integrator import check_delta
from scenes.pbrt.directives.materials import resolve_material, resolve_perturbation
from scenes.pbrt.directives.media import check_media, surfaces
from scenes.pbrt.directives.shapes import resolve_alpha
from scenes.pbrt.instances import expand_instances
from scenes.pbrt.reader import Reader
from scenes.pbrt.state import Builder, PlacedShape
from scenes.pbrt.text.lexer import Source, decode, read_source
from scenes.pbrt.text.template import Bindings, Values, read_header


def parse_file(
    path: Path,
    parameters: Values | None = None,
    name: str | None = None,
    allow_outside: bool = False,
    strict: bool = False,
    substitute: bool = False,
    progress: Callable[[float], None] | None = None,
) -> SceneDescription:
    """Read a .pbrt file; SceneError or PenumbraError for whatever is wrong with it.

    parameters: values for the template's `$name`s. name: of the scene, by default the file's without
    extension. allow_outside: whether files that the scene names may lie outside its own folder. strict:
    whether a scene is refused whose image would not be the one that pbrt makes. substitute: whether what is
    not simulated is rendered as the nearest that is, where there is one. progress: told of the share of the
    text that is read, where that takes more than a second.
    """
    return parse_source(
        read_source(path), parameters, name or path.stem, allow_outside, strict, substitute, progress
    )


def parse(
    text: str | bytes,
    parameters: Values | None = None,
    file: str = "<text>",
    allow_outside: bool = False,
    strict: bool = False,
    substitute: bool = False,
) -> SceneDescription:
    """Parse scene text; the files that it names are relative to the working directory."""
    source = Source(file, decode(text, file) if isinstance(text, bytes) else text)
    return parse_source(source, parameters, Path(file).stem, allow_outside, strict, substitute)


def parse_source(
    source: Source,
    parameters: Values | None,
    name: str,
    allow_outside: bool = False,
    strict: bool = False,
    substitute: bool = False,
    progress: Callable[[float], None] | None = None,
) -> SceneDescription:
    """The scene of a text that has been read."""
    if strict and substitute:
        raise PenumbraError("strict and substitute: a scene is either refused or rendered as the nearest")
    header = read_header(source)
    bindings = Bindings(header, parameters or {})
    reader = Reader(
        source,
        header,
        bindings,
        Files(source.folder or Path(), allow_outside),
        Report(strict, substitute),
        progress,
    )
    try:
        reader.run()
        with np.errstate(all="ignore"):
            scene = _described(reader.builder, name, tuple(bindings.values.items()))
    except (
        SceneError
    ) as error:  # of what is malformed: what was found to be unsupported up to there is told with it
        raise reader.builder.report.behind(error) from None
    bindings.check_used()
    return scene


def _described(builder: Builder, name: str, parameters: tuple[tuple[str, float], ...]) -> SceneDescription:
    """The description of the scene that was read. SceneError with all that it asks for and is not
    supported.
    """
    report = builder.report
    check_media(builder)
    ratio = builder.exposure * builder.iso / 100  # by which pbrt's film multiplies what it measures
    lights = sum_environments(builder.lights)
    check_delta(builder)
    objects = {name: surfaces(builder, shapes) for name, shapes in builder.objects.items()}
    placed = [*surfaces(builder, builder.shapes), *expand_instances(builder.uses, objects)]
    shapes = tuple(shape for item in placed for shape in _shapes(item, builder))
    report.check()
    if ratio != 1:
        lights = tuple(light.scaled(ratio) for light in lights)
        shapes = tuple(shape.scaled(ratio) for shape in shapes)
    return SceneDescription(
        name,
        builder.camera,
        builder.film,
        shapes,
        lights,
        builder.occlusion_distance,
        builder.defaults,
        parameters,
        report.notes(),
        report.substitutions(),
    )


def _shapes(placed: PlacedShape, builder: Builder) -> list[ShapeDescription]:
    """The shape, split where its faces differ in radiance. Without a texture it drops texture coordinates,
    which are then no part of the content.
    """
    material = resolve_material(placed.material, builder)
    alpha, perturbation = resolve_alpha(placed.alpha, builder), resolve_perturbation(placed.material, builder)
    varies = (
        material.needs_uv or perturbation is not None or not (alpha is None or isinstance(alpha, np.ndarray))
    )
    parts: list[tuple[Geometry, Emission | None]] = [(placed.geometry, None)]
    if placed.light is not None:
        parts = [*apply_area_light(placed.geometry, placed.light, placed.where, builder.report)]
    if isinstance(alpha, np.ndarray) and not alpha.any() and placed.light is None:
        return []  # no ray ever meets it
    mixed = isinstance(material, MixedMaterial) and material.perturbs_normals
    if (perturbation is not None or mixed) and isinstance(placed.geometry, Quadric):
        builder.report.substitute(
            f"a normal map or displacement on part of a {placed.geometry.form}", "without it", placed.where
        )
        perturbation = None
        material = material.without_perturbations() if isinstance(material, MixedMaterial) else material
    if not varies:
        parts = [(geometry.untextured(), emission) for geometry, emission in parts]
    return [
        ShapeDescription(one, material, emission, placed.where, alpha, perturbation)
        for one, emission in parts
    ]

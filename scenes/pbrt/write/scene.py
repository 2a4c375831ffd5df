"""A `SceneDescription` as real pbrt-v4 text: one file, with its images beside it, that pbrt-v4 renders to the
same image.

Numbers are written so that reading them gives the same float64, and transformations so that no rounding
enters (a rotation is inverted by transposition, and translations stand apart from it). The description that
is read back is therefore bitwise the one that was written, with the same `content_hash`. Images are rounded
to float32, the precision of EXR files. A camera whose axes are farther from orthonormal than
`transforms.ROUNDING` cannot come from a scene file and is refused. Things that pbrt-v4 lacks are written in
words of ours, under a comment that says so.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from scenes.description.lights import environments
from scenes.description.scene import Camera, Film, RenderDefaults, SceneDescription, SphericalCamera
from scenes.description.shapes import Array, ShapeDescription
from scenes.errors import PenumbraError
from scenes.pbrt.directives.lights import area_light_text, light_text
from scenes.pbrt.directives.materials import material_text, perturbation_text
from scenes.pbrt.directives.shapes import shape_text
from scenes.pbrt.directives.textures import TextureWriter
from scenes.pbrt.write.side_files import SideFiles
from scenes.pbrt.write.text import comment, is_orthonormal, matrix, numbers, quoted

AMBIENT = "ambient-occlusion"
SIMPLE_PATH = {
    "bsdf": "true",
    "hemisphere": "false",
}  # estimators that pbrt's `simplepath` has, by its `samplebsdf`


@dataclass(frozen=True, eq=False)
class ExportedScene:
    """text: the scene. images: (h, w, 3) float64 by the file names that it gives, to be written as float32.
    notes: what a user should know.
    """

    text: str
    images: dict[str, Array] = field(default_factory=dict[str, Array])
    notes: tuple[str, ...] = ()


def to_pbrt(scene: SceneDescription) -> str:
    """The scene as text alone; PenumbraError where it has images, which need files: see `export`."""
    exported = export(scene, comment(scene.name))
    if exported.images:
        raise PenumbraError(
            f"scene {scene.name}: it has images, which go into files beside the text: give an output file"
        )
    return exported.text


def export(scene: SceneDescription, stem: str) -> ExportedScene:
    """The scene as pbrt-v4 text, meshes inline, in the world's coordinates and with direct light only.

    stem: what the names of its images begin with. PenumbraError where there is no text for it.
    """
    files = SideFiles(stem)
    textures = TextureWriter(files)
    body: list[str] = []
    for light in scene.lights:
        body += _attribute(light_text(light, files))
    for shape in scene.shapes:
        body += _attribute(_shape(shape, textures))
    notes = _notes(scene, files)
    head = [f"# {comment(scene.name)}, exported by penumbra"]
    if scene.parameters:
        head.append("# with " + ", ".join(f"{name} = {value!r}" for name, value in scene.parameters))
    head += [f"# {note}" for note in notes]
    head += [
        *_camera(scene.camera),
        *_film(scene.film, scene.camera, scene.name),
        *_sampling(_written(scene), scene.occlusion_distance),
    ]
    return ExportedScene("\n".join([*head, "", "WorldBegin", *body]) + "\n", files.images, notes)


def _attribute(lines: list[str]) -> list[str]:
    return ["", "AttributeBegin", *(f"  {line}" for line in lines), "AttributeEnd"]


def _notes(scene: SceneDescription, files: SideFiles) -> tuple[str, ...]:
    notes: list[str] = []
    if not all(light.in_pbrt for light in environments(scene.lights)):
        notes.append(
            "pbrt-v4 itself will refuse this file: an infinite light has parameters that are Penumbra's own"
        )
    if np.isfinite(scene.occlusion_distance) and scene.defaults.estimator != AMBIENT:
        notes.append(
            f"the occlusion distance, {scene.occlusion_distance:g}, is left out: pbrt has one for ambient "
            "occlusion only"
        )
    if files.rounded:
        notes.append("images are rounded to float32")
    if files.uneven:
        notes.append(
            "textures have sides that are no powers of two; whoever reads the file resizes them, as pbrt does"
        )
    return tuple(notes)


def _camera(camera: Camera) -> list[str]:
    axes = camera.camera_to_world[:3, :3]
    to_camera = axes.T if is_orthonormal(axes) else np.linalg.inv(axes).astype(np.float64)
    given = dict(camera.own)
    if camera.lens is not None:
        given |= {"lensradius": camera.lens.radius, "focaldistance": camera.lens.distance}
    shown = "".join(_parameter(name, value) for name, value in given.items())
    if camera.window is not None and not isinstance(camera, SphericalCamera):
        shown += f' "float screenwindow" [ {numbers(camera.window)} ]'
    return [
        matrix("Transform", to_camera),
        f"Translate {numbers(-camera.camera_to_world[:3, 3])}",
        f'Camera "{camera.kind}"{shown}',
    ]


def _parameter(name: str, value: float | str) -> str:
    return f' "string {name}" {quoted(value)}' if isinstance(value, str) else f' "float {name}" [ {value!r} ]'


def _film(film: Film, camera: Camera, name: str) -> list[str]:
    """`Film`; a crop of a spherical camera is told in pixels, of any other by its window."""
    filename = film.filename or f"{comment(name)}.exr"
    size, bounds = (film.width, film.height), ""
    if isinstance(camera, SphericalCamera) and (cut := camera.crop(film)) is not None:
        size, bounds = cut[0], f' "integer pixelbounds" [ {" ".join(map(str, cut[1]))} ]'
    chosen = film.pixel_filter
    sigma = f' "float sigma" [ {chosen.sigma!r} ]' if chosen.kind == "gaussian" else ""
    return [
        f'Film "rgb" "integer xresolution" [ {size[0]} ] "integer yresolution" [ {size[1]} ]{bounds}'
        f' "string filename" [ {quoted(filename)} ] "bool savefp16" [ false ]',
        (
            f'PixelFilter "{chosen.kind}" "float xradius" [ {chosen.xradius!r} ] "float yradius" [ '
            f"{chosen.yradius!r} ]{sigma}"
        ),
    ]


def _written(scene: SceneDescription) -> RenderDefaults:
    """The defaults that the text can express. Without light sampling pbrt would lose lights that no direction
    meets.
    """
    lost = scene.defaults.estimator in SIMPLE_PATH and not all(light.surrounds for light in scene.lights)
    return replace(scene.defaults, estimator=None) if lost else scene.defaults


def _sampling(defaults: RenderDefaults, occlusion_distance: float) -> list[str]:
    count = f'"integer pixelsamples" [ {defaults.spp} ]'
    if defaults.sampler == "stratified":
        rows = next(n for n in range(int(np.sqrt(defaults.spp)), 0, -1) if defaults.spp % n == 0)
        count = f'"integer xsamples" [ {defaults.spp // rows} ] "integer ysamples" [ {rows} ]'
    return [
        f'Sampler "{defaults.sampler}" {count} "integer seed" [ {defaults.seed} ]',
        _integrator(defaults, occlusion_distance),
    ]


def _integrator(defaults: RenderDefaults, occlusion_distance: float) -> str:
    if defaults.estimator == AMBIENT:
        ends = np.isfinite(occlusion_distance)
        return 'Integrator "ambientocclusion"' + (
            f' "float maxdistance" [ {occlusion_distance!r} ]' if ends else ""
        )
    if defaults.estimator in SIMPLE_PATH:
        brdf = SIMPLE_PATH[defaults.estimator]
        return (
            'Integrator "simplepath" "integer maxdepth" [ 1 ] "bool samplelights" [ false ] "bool '
            f'samplebsdf" [ {brdf} ]'
        )
    return 'Integrator "path" "integer maxdepth" [ 1 ]'


def _shape(shape: ShapeDescription, textures: TextureWriter) -> list[str]:
    lines: list[str] = []
    if shape.emission is not None:
        lines.append(area_light_text(shape.emission, textures.files))
    lines += material_text(shape.material, textures)
    if shape.perturbation is not None:
        made = lines.pop()
        part = perturbation_text(shape.perturbation, textures, lines)
        lines.append(f"{made} {part}")
    alpha = [] if shape.alpha is None else [f"  {textures.parameter('float', 'alpha', shape.alpha, lines)}"]
    return [*lines, *shape_text(shape.geometry, shape.emission is not None), *alpha]

"""A scene as Mitsuba 3 XML, with its meshes and images in files beside it.

`mitsuba scene.xml` renders it as the reference is rendered, in the same coordinates, near the origin and of a
size that float32 resolves (scene.py). A comment says how to get back to the scene's. pbrt's rough surfaces
and pixel filters, which the reference adds to Mitsuba, are not in the file; a comment says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, cast
from xml.sax.saxutils import quoteattr

import numpy as np

from pipeline.references.mitsuba.scene import convert, normalising_frame
from pipeline.references.mitsuba.shapes import Frame
from pipeline.references.mitsuba.worker import Faces, MitsubaScene, Plugin
from scenes.description.scene import Film, SceneDescription
from scenes.description.shapes import Array
from scenes.errors import PenumbraError

MICROFACETS = (
    "rough metal and glass are Mitsuba's roughconductor and roughdielectric, whose shadowing and masking are "
    "independent; Penumbra's and pbrt's are correlated by height"
)


@dataclass(frozen=True, eq=False)
class MitsubaFiles:
    """A scene's files. text: the XML. notes: differences that a user should know.

    images: (h, w, 1 or 3) by file name, to be written as float32 EXR. meshes: PLY by file name.
    """

    text: str
    images: dict[str, Array]
    meshes: dict[str, bytes]
    notes: tuple[str, ...]


def to_xml(scene: SceneDescription, stem: str) -> MitsubaFiles:
    """Write a scene as XML. stem: how the names of the other files begin.

    SceneError or PenumbraError for a part of the scene that Mitsuba cannot have.
    """
    converted, frame = convert(scene), normalising_frame(scene)
    writer = _Writer(stem)
    rfilter, notes = _filter(scene.film)
    body = [
        '<integrator type="direct">',
        *_indented(
            [*_value("emitter_samples", 1), *_value("bsdf_samples", 1), *_value("hide_emitters", False)]
        ),
        "</integrator>",
        *_sensor(converted, rfilter, scene.defaults.spp),
    ]
    for plugin in converted.objects:
        body += writer.plugin(plugin, None)
    notes = [
        _moved(frame),
        *notes,
        *([MICROFACETS] if writer.microfacets else []),
        *(f"{k}: {v}" for k, v in converted.notes.items()),
    ]
    head = [
        f"<!-- {_comment(scene.name)}, exported by penumbra -->",
        *(f"<!-- {_comment(note)} -->" for note in notes),
    ]
    text = "\n".join(
        [
            '<?xml version="1.0" encoding="utf-8"?>',
            *head,
            '<scene version="3.0.0">',
            *_indented(body),
            "</scene>",
        ]
    )
    return MitsubaFiles(text + "\n", writer.images, writer.meshes, tuple(notes))


def _comment(text: str) -> str:
    return " ".join(text.split()).replace("--", "- -").rstrip("-")


def _moved(frame: Frame) -> str:
    center = ", ".join(repr(value) for value in frame.center.tolist())
    return (
        f"a point p of the scene is at {frame.scale!r} * (p - ({center})): "
        "Mitsuba computes in float32, best near the origin"
    )


def _filter(film: Film) -> tuple[list[str], list[str]]:
    """The reconstruction filter, and notes on it; PenumbraError if Mitsuba has none like it."""
    chosen = film.pixel_filter
    if chosen.kind == "box" and chosen.xradius == chosen.yradius == 0.5:
        return ['<rfilter type="box"/>'], []
    if chosen.kind == "box" or chosen.xradius != chosen.yradius:
        raise PenumbraError(
            f"Mitsuba has no {chosen.kind} filter of radii {chosen.xradius:g} and {chosen.yradius:g}: "
            "its box is one pixel wide, and its others are round"
        )
    said = (
        "Mitsuba splats samples into all pixels within the filter's radius, and divides by the sum of their "
        "weights; pbrt keeps each in its pixel"
    )
    if chosen.kind == "triangle":
        return ['<rfilter type="tent">', *_indented(_value("radius", chosen.xradius)), "</rfilter>"], [said]
    lines = ['<rfilter type="gaussian">', *_indented(_value("stddev", chosen.sigma)), "</rfilter>"]
    return lines, [
        f"{said}; its gaussian ends at four standard deviations, {4 * chosen.sigma:g} pixels, "
        f"where the scene's ends at {chosen.xradius:g}"
    ]


def _sensor(scene: MitsubaScene, rfilter: list[str], spp: int) -> list[str]:
    if scene.film is not None:
        raise PenumbraError(
            "Mitsuba's own camera has square pixels about the middle of its film: a screenwindow, a crop or "
            "a camera that stretches space cannot be exported"
        )
    film = [*_value("width", scene.width), *_value("height", scene.height), *_value("pixel_format", "rgb")]
    film += [*_value("component_format", "float32"), *rfilter]
    inside = [
        *_transform("to_world", scene.camera_to_world),
        *(line for name, value in scene.sensor.values.items() for line in _value(name, value)),
        *_value("near_clip", scene.clip[0]),
        *_value("far_clip", scene.clip[1]),
        '<film type="hdrfilm">',
        *_indented(film),
        "</film>",
        '<sampler type="independent">',
        *_indented(_value("sample_count", spp)),
        "</sampler>",
    ]
    return [f'<sensor type="{scene.sensor.kind}">', *_indented(inside), "</sensor>"]


@dataclass(eq=False)
class _Writer:
    """Writes plug-ins as XML, and collects the images and meshes beside it.

    microfacets: whether a rough surface was written, which Mitsuba masks in another way.
    """

    stem: str
    images: dict[str, Array] = field(default_factory=dict[str, Array])
    meshes: dict[str, bytes] = field(default_factory=dict[str, bytes])
    microfacets: bool = False

    def plugin(self, plugin: Plugin, name: str | None) -> list[str]:
        if plugin.kind == "penumbra_conductor":
            return self.plugin(self._metal(plugin), name)
        if plugin.kind == "penumbra_dielectric":
            return self.plugin(self._glass(plugin), name)
        kind, values = plugin.kind, dict(plugin.values)
        if kind == "mesh":
            kind, values = "ply", self._mesh(values)
        named = "" if name is None else f" name={quoteattr(name)}"
        lines = [f"<{plugin.tag} type={quoteattr(kind)}{named}>"]
        for key, value in values.items():
            lines += _indented(self._part(key, value))
        return [*lines, f"</{plugin.tag}>"]

    def _part(self, name: str, value: Any) -> list[str]:
        if isinstance(value, Plugin):
            return self.plugin(value, name)
        if isinstance(value, np.ndarray) and value.ndim == 3:
            file = f"{self.stem}-{len(self.images) + 1}.exr"
            self.images[file] = value
            return _value("filename", file)
        return _value(name, value)

    def _mesh(self, values: dict[str, Any]) -> dict[str, Any]:
        file = f"{self.stem}-{len(self.meshes) + 1}.ply"
        self.meshes[file] = ply(
            values.pop("vertices"),
            values.pop("faces"),
            values.pop("uv", None),
            normals := values.pop("normals"),
        )
        return {"filename": file, "face_normals": normals is None, **values}

    def _metal(self, plugin: Plugin) -> Plugin:
        self.microfacets = True
        indices = {name: np.array([plugin.values[f"{name}{c}"] for c in range(3)]) for name in ("eta", "k")}
        values = {"distribution": "ggx", **_alphas(plugin), **indices}
        return Plugin("bsdf", "twosided", {"one": Plugin("bsdf", "roughconductor", values)})

    def _glass(self, plugin: Plugin) -> Plugin:
        self.microfacets = True
        indices = {"int_ior": plugin.values["eta"], "ext_ior": 1.0}
        values = {"distribution": "ggx", **_alphas(plugin), **indices}
        return Plugin("bsdf", "roughdielectric", values)


def _alphas(plugin: Plugin) -> dict[str, float]:
    """The roughness by Mitsuba's own names."""
    values = plugin.values
    if "alpha_v" not in values:
        return {"alpha": values["alpha"]}
    return {"alpha_u": values["alpha"], "alpha_v": values["alpha_v"]}


def _value(name: str, value: Any) -> list[str]:
    """The XML of one parameter of a plug-in."""
    if isinstance(value, np.ndarray):
        value = cast("Array", value)
        if value.ndim == 2:
            return _transform(name, value)
        return [f'<rgb name={quoteattr(name)} value="{" ".join(repr(x) for x in value.tolist())}"/>']
    tag = {bool: "boolean", int: "integer", float: "float", str: "string"}[type(value)]
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return [f"<{tag} name={quoteattr(name)} value={quoteattr(text)}/>"]


def _transform(name: str, matrix: Array) -> list[str]:
    """The XML of a transformation (4, 4), or (3, 3) of the plane, always as sixteen numbers.

    Of nine numbers Mitsuba would drop the translation.
    """
    if len(matrix) == 3:
        plane, matrix = matrix, np.eye(4)
        matrix[:2, :2], matrix[:2, 3] = plane[:2, :2], plane[:2, 2]
    numbers = " ".join(repr(x) for x in matrix.ravel().tolist())
    return [f"<transform name={quoteattr(name)}>", f'    <matrix value="{numbers}"/>', "</transform>"]


def _indented(lines: list[str]) -> Iterator[str]:
    return (f"    {line}" for line in lines)


def ply(vertices: Array, faces: Faces, uv: Array | None, normals: Array | None = None) -> bytes:
    """A mesh as binary PLY in float32. vertices, normals: (m, 3). faces: (t, 3). uv: (m, 2)."""
    columns = {"xyz": vertices, "n": normals, "uv": uv}
    given = {key: column for key, column in columns.items() if column is not None}
    names = [name for key in given for name in (("nx", "ny", "nz") if key == "n" else key)]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    table = np.concatenate(list(given.values()), axis=1)
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
    rows["count"], rows["corners"] = 3, faces
    return "\n".join(header).encode() + b"\n" + table.astype("<f4").tobytes() + rows.tobytes()

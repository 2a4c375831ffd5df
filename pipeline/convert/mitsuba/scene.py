"""A Mitsuba scene as a document of pbrt's.

Both have a camera that looks along its +z. Mitsuba's has +x to the left and is right-handed, pbrt's +x to the
right: one mirror in x between them makes the same image, in world coordinates that stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from pipeline.convert.document import Document
from pipeline.convert.mitsuba.document import Plugin, read_document
from pipeline.convert.mitsuba.shapes import Placed, place_shape
from pipeline.convert.mitsuba.surfaces import Surfaces
from pipeline.references.mitsuba.environment import equal_area_direction, interpolated
from pipeline.references.mitsuba.lights import MITSUBA_AXES
from scenes.arrays import Array
from scenes.description.lights import DistantLight, Environment, Light, PointLight, SpotLight
from scenes.description.shapes import Emission
from scenes.errors import Location, PenumbraError, SceneError
from scenes.files import Files
from scenes.images.exr import read_texture

MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
FINEST = 2048  # rows that are made of fewer, so that interpolation between them is kept
HARMLESS = {  # parameters that change no image here, or that somebody else reads
    "near_clip", "far_clip", "id", "fov_axis", "focal_length", "srgb", "raw", "filter_type", "wrap_mode",
    "sample_count", "alpha", "alpha_u", "alpha_v", "distribution", "to_world", "sample_visible",
    "mis_compensation", "accel", "format", "shutter_open", "shutter_close",
}  # fmt: skip


def convert(path: Path, given: Mapping[str, str], stem: str, allow_outside: bool = False) -> Document:
    """Convert the scene of an XML file. given: a value for each `$name`. stem: how its images' names begin.

    SceneError at the place of malformed text. The document lists what could not be kept.
    """
    files = Files(path.parent, allow_outside)
    scene = read_document(path, given, files)
    document = Document(stem)
    _Converter(document, files).scene(scene)
    return document


class _Converter:
    def __init__(self, document: Document, files: Files) -> None:
        self._document, self._files = document, files
        self._lost = document.losses.add
        self._surfaces = Surfaces(files, document.losses)

    def scene(self, scene: Plugin) -> None:
        sensors = scene.all("sensor")
        if not sensors:
            raise SceneError("the scene has no sensor", scene.where)
        if len(sensors) > 1:
            self._lost("one sensor is converted, the first", sensors[1].where)
        for integrator in scene.all("integrator"):
            if integrator.type not in ("direct", "aov"):
                self._lost(f"of integrator {integrator.type!r} the direct light is kept", integrator.where)
            if integrator.flag("hide_emitters", False):
                self._lost("hide_emitters is left out: lights are seen", integrator.where)
        self._sensor(sensors[0])
        for part in scene.parts:
            if part.tag == "emitter":
                self._emitter(part)
            elif part.tag == "shape":
                self._shape(part, np.eye(4))
            elif part.tag == "medium":
                self._lost("media are left out", part.where)

    def _sensor(self, sensor: Plugin) -> None:
        if sensor.type not in _SENSORS:
            raise SceneError(
                f"sensor {sensor.type!r} is not converted; there are: {', '.join(_SENSORS)}", sensor.where
            )
        film = sensor.part("film") or Plugin("film", "hdrfilm", "", sensor.where)
        width, height = film.count("width", 768), film.count("height", 576)
        for name in ("crop_width", "crop_height", "crop_offset_x", "crop_offset_y"):
            if film.given(name):
                self._lost("the crop of the film is left out: all of it is rendered", film.where)
        for name in ("principal_point_offset_x", "principal_point_offset_y"):
            if sensor.number(name, 0.0):
                self._lost("the offset of the principal point is left out", sensor.where)
        to_world = sensor.transform() @ MIRROR
        self._document.camera(to_world, _SENSORS[sensor.type](sensor, width / height))
        sampler = sensor.part("sampler")
        spp = 16 if sampler is None else sampler.count("sample_count", 4)
        self._document.film(width, height, self._filter(film), spp)
        self._unread(sensor)

    def _filter(self, film: Plugin) -> str:
        chosen = film.part("rfilter")
        kind = "gaussian" if chosen is None else chosen.type
        if chosen is not None and kind == "box":
            return 'PixelFilter "box" "float xradius" [ 0.5 ] "float yradius" [ 0.5 ]'
        if chosen is not None and kind == "tent":
            radius = chosen.number("radius", 1.0)
            return f'PixelFilter "triangle" "float xradius" [ {radius!r} ] "float yradius" [ {radius!r} ]'
        if kind != "gaussian":
            self._lost(f"the filter {kind!r} is a gaussian instead", film.where)
        sigma = chosen.number("stddev", 0.5) if chosen is not None and kind == "gaussian" else 0.5
        radius = f'"float xradius" [ {4 * sigma!r} ] "float yradius" [ {4 * sigma!r} ]'
        return f'PixelFilter "gaussian" {radius} "float sigma" [ {sigma!r} ]'

    def _emitter(self, emitter: Plugin) -> None:
        if emitter.type not in _EMITTERS:
            self._lost(f"emitter {emitter.type!r} is left out", emitter.where)
            return
        if emitter.part("texture") is not None:
            self._lost(f"the texture of a {emitter.type} emitter is left out", emitter.where)
        self._document.light(_EMITTERS[emitter.type](emitter, self._files))
        self._unread(emitter)

    def _shape(self, shape: Plugin, outer: Array) -> None:
        if shape.type == "shapegroup":
            return  # its instances stand for it
        if shape.type in ("instance", "merge"):
            inner = outer @ shape.transform()
            for group in shape.all("shape"):
                for part in group.all("shape") if group.type == "shapegroup" else [group]:
                    self._shape(part, inner)
            return
        lamp = shape.part("emitter", None)
        made = place_shape(shape, outer, self._files, lamp is not None)
        if made is None:
            self._lost(f"shape {shape.type!r} is left out", shape.where)
            return
        for part in shape.parts:
            if part.tag in ("medium", "sensor"):
                self._lost(f"a {part.tag} in a shape is left out", part.where)
        bsdf = shape.part("bsdf")
        material = self._surfaces.material(bsdf, made.to_uv, lamp is not None)
        emission = None if lamp is None else self._emission(lamp, made)
        self._document.shape(made.lines, material, emission)
        for one in (shape, lamp, bsdf):
            if one is not None:
                self._unread(one)

    def _emission(self, lamp: Plugin, made: Placed) -> Emission | None:
        if lamp.type != "area":
            self._lost(f"emitter {lamp.type!r} of a shape is left out", lamp.where)
            return None
        texture = lamp.part("texture", "radiance")
        if texture is None:
            return Emission(_light(lamp, "radiance"))
        image = self._surfaces.image(texture) if texture.type == "bitmap" else None
        to_uv = texture.transform("to_uv")
        flipped = np.diag([1.0, -1.0, 1.0, 1.0])
        flipped[1, 3] = 1.0
        if (
            image is None
            or not made.rectangle
            or not any(np.array_equal(to_uv, m) for m in (np.eye(4), flipped))
        ):
            self._lost("a texture on a light is kept on rectangles alone, and laid straight", texture.where)
            return Emission(np.ones(3) if image is None else image.mean(axis=(0, 1)))
        # Mitsuba's first row is at v = 0, pbrt's at v = 1.
        return Emission(np.ones(3), image=image[::-1].copy() if np.array_equal(to_uv, np.eye(4)) else image)

    def _unread(self, plugin: Plugin) -> None:
        for name in plugin.values:
            if name not in plugin.read and name not in HARMLESS:
                self._lost(f"{plugin.tag} {plugin.type!r}: {name} is left out", plugin.values[name].where)


def _light(emitter: Plugin, name: str) -> Array:
    """The colour (3,) of an emitter; SceneError if it is negative."""
    color = emitter.color(name, 1.0)
    if (color < 0).any():
        raise SceneError(f"{name} must not be negative", emitter.where)
    return color


def _perspective(sensor: Plugin, aspect: float) -> str:
    """The `Camera` line of a perspective sensor. aspect: width over height.

    pbrt's angle is over the shorter side, Mitsuba's over the side that it names.
    """
    if sensor.given("focal_length"):
        words = sensor.text("focal_length", "50mm").removesuffix("mm")
        try:  # of a film whose diagonal is 36 x 24 mm's
            half = np.hypot(36.0, 24.0) / 2 / float(words)
        except (ValueError, ZeroDivisionError):
            raise SceneError(f"focal_length {words!r} is no length in mm", sensor.where) from None
        axis = "diagonal"
    else:
        half, axis = np.tan(np.radians(sensor.number("fov", 50.0)) / 2), sensor.text("fov_axis", "x")
    wide = max(aspect, 1 / aspect)  # the longer side over the shorter
    over = {
        "x": max(aspect, 1.0),
        "y": 1.0 if aspect >= 1 else wide,
        "smaller": 1.0,
        "larger": wide,
        "diagonal": float(np.hypot(1.0, wide)),
    }
    if axis not in over:
        raise SceneError(f"fov_axis {axis!r}; there are: {', '.join(over)}", sensor.where)
    degrees = float(2 * np.degrees(np.arctan(half / over[axis])))
    if not 0 < degrees < 180:
        raise SceneError("the field of view must lie between 0 and 180 degrees", sensor.where)
    return f'Camera "perspective" "float fov" [ {degrees!r} ]'


def _thin_lens(sensor: Plugin, aspect: float) -> str:
    radius, distance = sensor.number("aperture_radius", 0.0), sensor.number("focus_distance", 1.0)
    lens = f'"float lensradius" [ {radius!r} ] "float focaldistance" [ {distance!r} ]'
    return f"{_perspective(sensor, aspect)} {lens}"


def _orthographic(sensor: Plugin, aspect: float) -> str:
    """Mitsuba's film reaches from -1 to 1 over its width."""
    return f'Camera "orthographic" "float screenwindow" [ -1 1 {-1 / aspect!r} {1 / aspect!r} ]'


def _point(emitter: Plugin, files: Files) -> Light:
    at = emitter.transform()[:3, 3]
    if emitter.given("position"):
        at = emitter.vector("position", (0.0, 0.0, 0.0))
    return PointLight(at + 0.0, _light(emitter, "intensity"))


def _spot(emitter: Plugin, files: Files) -> Light:
    """The falloff is linear in the angle in Mitsuba, and smooth in its cosine in pbrt."""
    matrix = emitter.transform()
    cone = emitter.number("cutoff_angle", 20.0)
    start = min(emitter.number("beam_width", cone * 3 / 4), cone)
    axis = _unit(matrix[:3, 2], emitter.where)
    return SpotLight(matrix[:3, 3] + 0.0, axis, _light(emitter, "intensity"), cone, start)


def _directional(emitter: Plugin, files: Files) -> Light:
    along = emitter.transform()[:3, 2]
    if emitter.given("direction"):
        along = emitter.vector("direction", (0.0, 0.0, 1.0))
    return DistantLight(-_unit(along, emitter.where) + 0.0, _light(emitter, "irradiance"))


def _constant(emitter: Plugin, files: Files) -> Light:
    return Environment(_light(emitter, "radiance"))


def _envmap(emitter: Plugin, files: Files) -> Light:
    path = files.find(emitter.text("filename", ""), None, emitter.where)
    try:
        image = read_texture(path)
    except PenumbraError as error:
        raise SceneError(str(error), emitter.where) from None
    frame = emitter.transform()[:3, :3] @ MITSUBA_AXES.T
    return Environment(np.full(3, emitter.number("scale", 1.0)), equal_area(image), frame=frame)


def equal_area(image: Array) -> Array:
    """Resample Mitsuba's latitude-longitude image (h, w, 3) to pbrt's equal-area square (n, n, 3).

    Each texel is the mean over 4 x 4 places: pbrt takes the nearest texel, and Mitsuba interpolates.
    """
    own = int(np.ceil(np.sqrt(image.shape[0] * image.shape[1])))
    size, fine = max(own, min(4 * own, FINEST)), 4
    out = np.zeros((size, size, 3))
    across = (np.arange(size * fine) + 0.5) / (size * fine)
    for row, down in enumerate(across.reshape(size, fine, 1)):
        d = equal_area_direction(across, down).reshape(-1, 3)
        out[row] = interpolated(image, d).reshape(fine, size, fine, 3).mean(axis=(0, 2))
    return out


def _unit(v: Array, where: Location) -> Array:
    length = float(np.linalg.norm(v))
    if not length > 0:
        raise SceneError("a direction must not be zero", where)
    return v / length


_SENSORS: dict[str, Callable[[Plugin, float], str]] = {
    "perspective": _perspective,
    "thinlens": _thin_lens,
    "orthographic": _orthographic,
}
_EMITTERS: dict[str, Callable[[Plugin, Files], Light]] = {
    "point": _point,
    "spot": _spot,
    "directional": _directional,
    "constant": _constant,
    "envmap": _envmap,
}

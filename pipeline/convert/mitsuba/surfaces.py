"""Mitsuba's BSDFs and textures as pbrt's materials and textures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pipeline.convert.document import Losses
from pipeline.convert.mitsuba.document import Plugin
from scenes.arrays import Array
from scenes.color import METALS, conductor_of_reflectance, metal
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Material
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Texture, UVMapping, mean
from scenes.errors import PenumbraError, SceneError
from scenes.files import Files
from scenes.images.exr import read_texels, texture_header

# Indices of refraction by name, as in Mitsuba's own table.
INDICES = {
    "vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277, "carbon dioxide": 1.00045,
    "water": 1.3330, "acetone": 1.36, "ethanol": 1.361, "carbon tetrachloride": 1.461, "glycerol": 1.4729,
    "benzene": 1.501, "silicone oil": 1.52045, "bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458,
    "pyrex": 1.470, "acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544,
    "amber": 1.55, "pet": 1.5750, "diamond": 2.419,
}  # fmt: skip
GRAY = 0.5  # Mitsuba's reflectance where none is given
ROUGH = 0.1  # and its roughness
IDENTITY = np.eye(3)


@dataclass(eq=False)
class Surfaces:
    """Converts BSDFs, each once for every layout of texture coordinates."""

    files: Files
    losses: Losses
    _known: dict[tuple[int, bytes], Material] = field(default_factory=dict[tuple[int, bytes], Material])
    _images: dict[tuple[str, bool], Array] = field(default_factory=dict[tuple[str, bool], Array])

    def material(self, bsdf: Plugin | None, to_uv: Array | None, emits: bool = False) -> Material:
        """The material of a BSDF. Without one it is Mitsuba's default for a shape, black if the shape emits.

        to_uv: (3, 3), from pbrt's texture coordinates of the shape to Mitsuba's; None if no affine map does
        it.
        """
        if bsdf is None:
            return Diffuse(np.full(3, 0.0 if emits else GRAY))
        key = id(bsdf), b"" if to_uv is None else to_uv.tobytes()
        if key not in self._known:
            self._known[key] = self._convert(bsdf, to_uv, False)
        return self._known[key]

    def _convert(self, bsdf: Plugin, to_uv: Array | None, both_sides: bool) -> Material:
        if bsdf.type in _INSIDE:
            inner = bsdf.all("bsdf")
            if not inner:
                raise SceneError(f"a {bsdf.type} needs a BSDF inside", bsdf.where)
            if bsdf.type != "twosided":
                self.losses.add(f"BSDF {bsdf.type!r} is left out, and what it wraps is kept", bsdf.where)
            elif len(inner) > 1:
                self.losses.add("the second side of a twosided BSDF is the first", bsdf.where)
            return self._convert(inner[0], to_uv, both_sides or bsdf.type == "twosided")
        if bsdf.type not in _KINDS:
            self.losses.add(f"BSDF {bsdf.type!r} is a gray diffuse surface instead", bsdf.where)
            return Diffuse(np.full(3, GRAY))
        if not both_sides and bsdf.type in _ONE_SIDED:
            self.losses.add(
                f"a {bsdf.type} that is not twosided is black from behind in Mitsuba alone", bsdf.where
            )
        if (bsdf.given("distribution") and bsdf.text("distribution", "") != "ggx") or (
            bsdf.type.startswith("rough") and not bsdf.given("distribution")
        ):
            self.losses.add("the distribution of microfacets is GGX instead of Beckmann's", bsdf.where)
        return _KINDS[bsdf.type](self, bsdf, to_uv)

    def blend(self, bsdf: Plugin, to_uv: Array | None) -> Material:
        """A mix of diffuse surfaces becomes one diffuse surface; of other surfaces the heavier is kept."""
        parts = [self._convert(part, to_uv, True) for part in bsdf.all("bsdf")]
        if len(parts) != 2:
            raise SceneError("a blendbsdf needs two BSDFs", bsdf.where)
        weight = self.texture(bsdf, "weight", GRAY, to_uv)
        first, second = parts
        if isinstance(first, Diffuse) and isinstance(second, Diffuse):
            return Diffuse(Mix(first.reflectance, second.reflectance, weight))
        self.losses.add("a blend of BSDFs that are not diffuse is the heavier one", bsdf.where)
        return second if float(mean(weight).mean()) > 0.5 else first

    def texture(self, owner: Plugin, name: str, default: float, to_uv: Array | None) -> Texture:
        """A parameter in [0, 1], as a colour or as a texture."""
        found = owner.part("texture", name)
        if found is None:
            return self.within(owner.color(name, default), name, owner)
        if found.type not in ("bitmap", "checkerboard"):
            self.losses.add(f"a texture {found.type!r} is its default colour instead", found.where)
            return np.full(3, default)
        mapping = self._mapping(found, to_uv)
        if found.type == "checkerboard":
            colors = [self.within(found.color(n, c), n, found) for n, c in (("color0", 0.4), ("color1", 0.2))]
            if mapping is None:
                return (colors[0] + colors[1]) / 2
            twice = UVMapping(2 * mapping.su, 2 * mapping.sv, 2 * mapping.du, 2 * mapping.dv)
            return Checkerboard(colors[0], colors[1], twice)
        image = np.clip(self.image(found), 0.0, 1.0)
        if mapping is None:
            return image.mean(axis=(0, 1))
        wrap = found.text("wrap_mode", "repeat")
        if wrap == "mirror":
            self.losses.add("a mirrored texture is repeated instead", found.where)
        # Mitsuba's first row is at v = 0, pbrt's at t = 1.
        placed = UVMapping(mapping.su, -mapping.sv, mapping.du, 1.0 - mapping.dv)
        kind = "point" if found.text("filter_type", "bilinear") == "nearest" else "bilinear"
        return ImageTexture(image, placed, "clamp" if wrap == "clamp" else "repeat", kind)

    def _mapping(self, texture: Plugin, to_uv: Array | None) -> UVMapping | None:
        """The mapping of pbrt's coordinates to the texture's; None, with a loss noted, if pbrt has none
        like it.
        """
        if to_uv is not None:
            given = texture.transform("to_uv")
            plane = np.eye(3)
            plane[:2, :2], plane[:2, 2] = given[:2, :2], given[:2, 3]
            m = plane @ to_uv
            if m[0, 1] == 0 and m[1, 0] == 0:
                return UVMapping(float(m[0, 0]), float(m[1, 1]), float(m[0, 2]), float(m[1, 2]))
        self.losses.add("a texture that lies turned on its shape, or on a disk, is its mean", texture.where)
        return None

    def image(self, texture: Plugin) -> Array:
        """The pixels (h, w, 3) of a bitmap, in linear RGB."""
        name, raw = texture.text("filename", ""), texture.flag("raw", False)
        if (name, raw) not in self._images:
            path = self.files.find(name, None, texture.where)
            try:
                texels = read_texels(texture_header(path), "linear" if raw else "sRGB")
            except PenumbraError as error:
                raise SceneError(str(error), texture.where) from None
            rgb = texels[..., :3] if texels.shape[2] >= 3 else np.repeat(texels[..., :1], 3, axis=2)
            self._images[name, raw] = np.ascontiguousarray(rgb)
        return self._images[name, raw]

    def within(self, color: Array, name: str, owner: Plugin) -> Array:
        """A reflectance clamped to [0, 1], with a loss noted if that changes it."""
        if (color < 0).any() or (color > 1).any():
            self.losses.add(f"{name} is cut off to [0, 1]", owner.where)
        return np.clip(color, 0.0, 1.0)

    def constant(self, owner: Plugin, name: str, default: float) -> Array:
        """A parameter as one colour (3,): a texture is replaced by its mean, with a loss noted."""
        if (found := owner.part("texture", name)) is not None:
            self.losses.add(f"a texture of {name} is its mean", found.where)
        return mean(self.texture(owner, name, default, None)) if found else owner.color(name, default)


def _index(bsdf: Plugin, name: str, default: str) -> float:
    text = bsdf.text(name, default).strip().lower()
    if text in INDICES:
        return INDICES[text]
    value = bsdf.number(name, 1.0)
    if value <= 0:
        raise SceneError(f"{name} must be above 0, not {value:g}", bsdf.where)
    return value


def _eta(bsdf: Plugin, inside: str) -> float:
    return _index(bsdf, "int_ior", inside) / _index(bsdf, "ext_ior", "air")


def _alphas(surfaces: Surfaces, bsdf: Plugin, default: float) -> tuple[float, float | None]:
    both = [float(surfaces.constant(bsdf, name, -1.0)[0]) for name in ("alpha_u", "alpha_v")]
    if min(both) >= 0:
        return (both[0], both[1]) if both[0] != both[1] else (both[0], None)
    alpha = float(surfaces.constant(bsdf, "alpha", default)[0])
    if alpha < 0:
        raise SceneError(f"alpha must not be below 0, not {alpha:g}", bsdf.where)
    return alpha, None


def _diffuse(surfaces: Surfaces, bsdf: Plugin, to_uv: Array | None) -> Material:
    return Diffuse(surfaces.texture(bsdf, "reflectance", GRAY, to_uv))


def _conductor(surfaces: Surfaces, bsdf: Plugin, to_uv: Array | None) -> Material:
    name = bsdf.text("material", "none")
    tint = surfaces.within(surfaces.constant(bsdf, "specular_reflectance", 1.0), "specular_reflectance", bsdf)
    plain = name == "none" and not bsdf.given("eta") and bsdf.part("texture", "eta") is None
    if plain:
        eta, k = conductor_of_reflectance(tint)  # of a perfect mirror to 1e-4: pbrt has no better one
    elif f"metal-{name}" in METALS:
        eta, k = metal(f"metal-{name}")
    else:
        if name != "none":
            surfaces.losses.add(f"metal {name!r} is aluminium instead", bsdf.where)
            eta, k = metal("metal-Al")
        else:
            eta, k = surfaces.constant(bsdf, "eta", 0.0), surfaces.constant(bsdf, "k", 1.0)
    if (tint < 1).any():
        surfaces.losses.add(
            "specular_reflectance of a metal is a Fresnel reflectance or left out", bsdf.where
        )
    alpha, across = _alphas(surfaces, bsdf, ROUGH) if bsdf.type.startswith("rough") else (0.0, None)
    return Conductor(eta, k, alpha, across)


def _dielectric(surfaces: Surfaces, bsdf: Plugin, to_uv: Array | None) -> Material:
    for name in ("specular_reflectance", "specular_transmittance"):
        if not np.array_equal(surfaces.constant(bsdf, name, 1.0), np.ones(3)):
            surfaces.losses.add(f"{name} of glass is left out", bsdf.where)
    alpha, across = _alphas(surfaces, bsdf, ROUGH) if bsdf.type.startswith("rough") else (0.0, None)
    return Dielectric(_eta(bsdf, "bk7"), alpha, bsdf.type == "thindielectric", across)


def _plastic(surfaces: Surfaces, bsdf: Plugin, to_uv: Array | None) -> Material:
    surfaces.losses.add(
        f"BSDF {bsdf.type!r} is pbrt's coateddiffuse, whose layers are another model", bsdf.where
    )
    alpha = _alphas(surfaces, bsdf, ROUGH)[0] if bsdf.type.startswith("rough") else 0.0
    base = Diffuse(surfaces.texture(bsdf, "diffuse_reflectance", GRAY, to_uv))
    return Coated(Dielectric(_eta(bsdf, "polypropylene"), alpha), base)


def _principled(surfaces: Surfaces, bsdf: Plugin, to_uv: Array | None) -> Material:
    surfaces.losses.add("BSDF 'principled' is a conductor or pbrt's coateddiffuse instead", bsdf.where)
    metallic, rough = (
        float(surfaces.constant(bsdf, n, d)[0]) for n, d in (("metallic", 0.0), ("roughness", 0.5))
    )
    color = surfaces.texture(bsdf, "base_color", GRAY, to_uv)
    if metallic > 0.5:
        return Conductor(*conductor_of_reflectance(mean(color)), rough**2)
    return Coated(Dielectric(bsdf.number("eta", 1.5), rough**2), Diffuse(color))


_Maker = Callable[[Surfaces, Plugin, Array | None], Material]
_INSIDE = ("twosided", "mask", "bumpmap", "normalmap")
_ONE_SIDED = ("diffuse", "conductor", "roughconductor", "plastic", "roughplastic")
_KINDS: dict[str, _Maker] = {
    "diffuse": _diffuse,
    "conductor": _conductor,
    "roughconductor": _conductor,
    "dielectric": _dielectric,
    "roughdielectric": _dielectric,
    "thindielectric": _dielectric,
    "plastic": _plastic,
    "roughplastic": _plastic,
    "principled": _principled,
    "blendbsdf": Surfaces.blend,
}

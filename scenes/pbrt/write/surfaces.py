"""Textures, materials and emission as pbrt-v4 text, and the images that go beside it."""

from __future__ import annotations

import numpy as np

from scenes.description.materials import Conductor, Dielectric, Material, Microfacets
from scenes.description.shapes import Array, Emission
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture, UVMapping
from scenes.errors import PenumbraError
from scenes.pbrt.write.text import numbers, quoted


class SideFiles:
    """The images (h, w, 3) that a text names, by file name; one that is used twice is written once.

    rounded: whether float32 changes any. uneven: whether a texture has a side that is no power of two.
    """

    def __init__(self, stem: str) -> None:
        self._stem = stem
        self._names: dict[int, str] = {}
        self.images: dict[str, Array] = {}
        self.rounded = self.uneven = False

    def add(self, image: Array) -> str:
        """The quoted name of the file that will hold `image`."""
        if id(image) not in self._names:
            name = f"{self._stem}-{len(self.images) + 1}.exr"
            self._names[id(image)], self.images[name] = name, image
            with np.errstate(over="ignore"):
                self.rounded |= not np.array_equal(image.astype(np.float32).astype(np.float64), image)
        return quoted(self._names[id(image)])


class Surfaces:
    """Writes materials; the textures that they need are written before the first that uses them."""

    def __init__(self, files: SideFiles) -> None:
        self.files = files
        self._textures: dict[tuple[str, int], str] = {}

    def material(self, material: Material) -> list[str]:
        """The textures that are new, and `Material`."""
        if isinstance(material, Conductor):
            optical = f'"rgb eta" [ {numbers(material.eta)} ] "rgb k" [ {numbers(material.k)} ]'
            return [f'Material "conductor" {optical} {_roughness(material)}']
        if isinstance(material, Dielectric):
            rough = f" {_roughness(material)}"
            kind = "thindielectric" if material.thin else "dielectric"
            return [f'Material "{kind}" "float eta" [ {material.eta!r} ]{"" if material.thin else rough}']
        lines: list[str] = []
        part = self._part("spectrum", "reflectance", material.reflectance, lines)
        return [*lines, f'Material "diffuse" {part}']

    def _part(self, type_: str, name: str, texture: Texture, lines: list[str]) -> str:
        """A parameter that is a constant or the name of a texture, whose own text goes to `lines`."""
        if not isinstance(texture, np.ndarray):
            return f'"texture {name}" [ {self._texture(type_, texture, lines)} ]'
        if type_ == "spectrum":
            return f'"rgb {name}" [ {numbers(texture)} ]'
        _check_gray(texture)
        return f'"float {name}" [ {float(texture[0])!r} ]'

    def _texture(self, type_: str, texture: Texture, lines: list[str]) -> str:
        key = (type_, id(texture))
        if key not in self._textures:
            body = self._body(type_, texture, lines)
            self._textures[key] = quoted(f"texture {len(self._textures) + 1}")
            lines.append(f'Texture {self._textures[key]} "{type_}" {body}')
        return self._textures[key]

    def _body(self, type_: str, texture: Texture, lines: list[str]) -> str:
        match texture:
            case ImageTexture():
                if type_ == "float":
                    _check_gray(texture.image)
                _check_kind(texture, type_)
                self.files.uneven |= any(side & (side - 1) for side in texture.image.shape[:2])
                look = f'"string filter" "{texture.filter}" "string wrap" "{texture.wrap}"'
                return (
                    f'"imagemap" "string filename" {self.files.add(texture.image)} '
                    f"{look}{_value(texture)}{_mapping(texture.mapping)}"
                )
            case Checkerboard():
                parts = self._parts({"tex1": (type_, texture.first), "tex2": (type_, texture.second)}, lines)
                return f'"checkerboard" {parts}{_mapping(texture.mapping)}'
            case Product() if (pair := _folded(texture, type_)) is not None:
                named: dict[str, tuple[str, Texture]] = {
                    "tex1": (type_, np.zeros(3)),
                    "tex2": (type_, pair[0]),
                    "amount": ("float", pair[1]),
                }
                return f'"mix" {self._parts(named, lines)}'
            case Product():
                return (
                    '"scale" '
                    f"{self._parts({'tex': (type_, texture.first), 'scale': ('float', texture.second)}, lines)}"  # noqa: E501
                )
            case Mix():
                named = {
                    "tex1": (type_, texture.first),
                    "tex2": (type_, texture.second),
                    "amount": ("float", texture.amount),
                }
                return f'"mix" {self._parts(named, lines)}'
            case _:
                raise TypeError(texture)

    def _parts(self, named: dict[str, tuple[str, Texture]], lines: list[str]) -> str:
        return " ".join(self._part(type_, name, texture, lines) for name, (type_, texture) in named.items())


def _roughness(material: Microfacets) -> str:
    one = f'"float roughness" [ {material.alpha!r} ]'
    two = f'"float uroughness" [ {material.alpha!r} ] "float vroughness" [ {material.alpha_v!r} ]'
    return f'{one if material.alpha_v is None else two} "bool remaproughness" [ false ]'


def _folded(product: Product, type_: str) -> tuple[ImageTexture, Array] | None:
    """The image and the factor of what pbrt makes one image of, scaling it before it is inverted and bounded;
    None for others.
    """
    if isinstance(product.first, ImageTexture) and isinstance(product.second, np.ndarray):
        return product.first, product.second
    if (
        type_ == "float"
        and isinstance(product.second, ImageTexture)
        and isinstance(product.first, np.ndarray)
    ):
        return product.second, product.first
    return None


def _check_gray(values: Array) -> None:
    if np.any(values != values[..., :1]):
        raise PenumbraError(
            "a texture is multiplied or mixed by colours; pbrt does so by numbers, so that there is no "
            "text for it"
        )


def _check_kind(texture: ImageTexture, type_: str) -> None:
    """pbrt bounds colours by 1 and numbers not."""
    if texture.clamped != (type_ == "spectrum") and texture.value(texture.image).max(initial=0.0) > 1:
        raise PenumbraError(
            f"an image texture exceeds 1 or is cut off there as no {type_} texture of pbrt's is"
        )


def _value(texture: ImageTexture) -> str:
    scale = "" if texture.scale == 1 else f' "float scale" [ {texture.scale!r} ]'
    return scale + (' "bool invert" [ true ]' if texture.invert else "")


def _mapping(mapping: UVMapping) -> str:
    named = {
        "uscale": (mapping.su, 1.0),
        "vscale": (mapping.sv, 1.0),
        "udelta": (mapping.du, 0.0),
        "vdelta": (mapping.dv, 0.0),
    }
    return "".join(
        f' "float {name}" [ {value!r} ]' for name, (value, default) in named.items() if value != default
    )


def area_light(emission: Emission, files: SideFiles) -> str:
    """`AreaLightSource`."""
    sides = ' "bool twosided" [ true ]' if emission.two_sided else ""
    if emission.image is None:
        return f'AreaLightSource "diffuse" "rgb L" [ {numbers(emission.radiance)} ]{sides}'
    name, scale = scaled_image(emission.image, emission.radiance, files)
    return f'AreaLightSource "diffuse" "string filename" {name}{scale}{sides}'


def scaled_image(image: Array, radiance: Array, files: SideFiles) -> tuple[str, str]:
    """The file and ` "float scale"` of an image that is multiplied by `radiance` (3,); pbrt scales by a
    number only, and a colour goes into the image.
    """
    if np.all(radiance == radiance[0]):
        return files.add(image), f' "float scale" [ {float(radiance[0])!r} ]'
    return files.add(image * radiance), ""

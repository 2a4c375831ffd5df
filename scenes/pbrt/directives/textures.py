"""`Texture`: all of pbrt-v4's but `ptex`, of numbers and of colours, as it reads them, and written back.

Numbers are textures of three equal components here. What is made of constants alone is a constant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from scenes.description.textures import (
    VEINS,
    Bilerp,
    Checkerboard,
    CylindricalMapping,
    DirectionMix,
    Dots,
    ImageTexture,
    Mapping2D,
    Marble,
    Mix,
    NoiseTexture,
    PlanarMapping,
    PointMapping,
    Product,
    SphericalMapping,
    Texture,
    UVMapping,
)
from scenes.errors import Location, PenumbraError, SceneError, Unsupported
from scenes.pbrt.directives.texels import image_of, numbers_of
from scenes.pbrt.spectra import colour_of
from scenes.pbrt.state import Builder, NamedTexture, check_room
from scenes.pbrt.text.parameters import Parameters
from scenes.pbrt.transforms import FLAT, Transform, unit
from scenes.pbrt.write.side_files import SideFiles
from scenes.pbrt.write.text import numbers, quoted

Array = NDArray[np.float64]

MOST_OCTAVES = 64  # beyond it the lattice is finer than any number's last digit
NODES = 200  # of one texture with all those inside it, which doubling names would else grow as a power of two


def declare(builder: Builder, name: str, type_: str, where: Location) -> None:
    """Note that a `Texture` has been read; SceneError where it is of no type, or its name is taken."""
    if type_ not in ("float", "spectrum"):
        raise SceneError(f'a texture is of type "float" or "spectrum", not "{type_}"', where)
    if (type_, name) in builder.texture_names:
        raise SceneError(f'{type_} texture "{name}" is made twice', where)
    check_room(builder.texture_names, "textures", where)
    builder.texture_names.add((type_, name))


def texture(
    builder: Builder, name: str, type_: str, kind: str, parameters: Parameters, transform: Transform
) -> None:
    """`Texture "name" "float" or "spectrum" "kind"`; the names of the two types are apart, as in pbrt.

    transform: the current one where the directive stands, which may be read later.
    """
    if kind in _OF_TYPE and type_ != _OF_TYPE[kind]:
        raise SceneError(f'a texture "{kind}" is of type "{_OF_TYPE[kind]}", not "{type_}"', parameters.where)
    if kind not in _KINDS:
        builder.textures[type_, name] = NamedTexture(None, 1)
        parameters.ignore()
        supported = ", ".join(f'"{known}"' for known in _KINDS)
        raise Unsupported(f'Texture "{kind}" is not supported; supported: {supported}', parameters.where)
    maker = _Maker(builder, type_, parameters, transform)
    made = _KINDS[kind](maker)
    if maker.size > NODES:
        raise SceneError(f'texture "{name}" is made of more than {NODES} others', parameters.where)
    builder.textures[type_, name] = NamedTexture(made, maker.size, maker.plain)


STAND_INS = ("ptex",)  # the kinds that --substitute renders as something else


def kinds() -> tuple[str, ...]:
    """The kinds that are read."""
    return tuple(_KINDS)


def named_texture(builder: Builder, type_: str, name: str, where: Location) -> NamedTexture:
    """The texture of this type and name; SceneError at `where` if there is none."""
    if (type_, name) not in builder.textures:
        known = ", ".join(known for kind, known in builder.textures if kind == type_) or "none"
        raise SceneError(f"no {type_} texture is called {name!r}; there are: {known}", where)
    return builder.textures[type_, name]


class _Maker:
    """Reads the parts of one texture. size: its nodes so far. plain: whether it is one of pbrt's "constant",
    and not made of such.
    """

    def __init__(self, builder: Builder, type_: str, parameters: Parameters, transform: Transform) -> None:
        self.type = type_
        self.parameters = parameters
        self.size = 1
        self.plain = False
        self._mixed: set[str] = set()
        self.builder = builder
        self.transform = transform

    def part(self, name: str, default: float, type_: str | None = None) -> Texture:
        """A texture, a colour or a number given as parameter `name`; of `type_`, by default the whole's
        own.
        """
        type_ = type_ or self.type
        types = ("float",) if type_ == "float" else ("rgb", "spectrum")
        parameter = self.parameters.take(name, *types, "texture")
        if parameter is None:
            return np.full(3, default)
        if parameter.type == "float":
            return np.full(3, self.parameters.number(name, default))
        if parameter.type != "texture":
            return colour_of(self.parameters, parameter, "reflectance")
        found = named_texture(self.builder, type_, self.parameters.text_of(parameter), parameter.where)
        self.size += found.size
        if not found.plain:
            self._mixed.add(name)
        return np.full(3, default) if found.value is None else found.value

    def number(self, name: str, default: float) -> Array:
        """A number or a colour, (3,), that is no texture."""
        if self.type == "float":
            return np.full(3, self.parameters.number(name, default))
        parameter = self.parameters.take(name, "rgb", "spectrum")
        return (
            np.full(3, default) if parameter is None else colour_of(self.parameters, parameter, "reflectance")
        )

    def is_plain(self, name: str) -> bool:
        """Whether a part that was read is a number, a colour, or a "constant" by its name."""
        return name not in self._mixed


def _constant(maker: _Maker) -> Texture:
    maker.plain = True
    return maker.part("value", 1.0)


def _scale(maker: _Maker) -> Texture:
    first, second = maker.part("tex", 1.0), maker.part("scale", 1.0, "float")
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray):
        maker.plain = _is_plain(maker, "tex", "scale", second) or _is_plain(maker, "scale", "tex", first)
        return first * second
    # pbrt gives a factor that is a "constant" to the image itself, whose own inversion and bounds then come
    # after it.
    if isinstance(first, ImageTexture) and isinstance(second, np.ndarray) and maker.is_plain("scale"):
        return replace(first, scale=first.scale * float(second[0]))
    if (
        isinstance(second, ImageTexture)
        and isinstance(first, np.ndarray)
        and maker.type == "float"
        and maker.is_plain("tex")
    ):
        return replace(second, scale=second.scale * float(first[0]))
    return Product(first, second)


def _is_plain(maker: _Maker, name: str, other: str, factor: Array) -> bool:
    """Whether pbrt takes the whole for its part `name`, since the other one is the "constant" 1."""
    return maker.is_plain(name) and maker.is_plain(other) and bool(np.all(factor == 1))


def _mix(maker: _Maker) -> Texture:
    first, second = maker.part("tex1", 0.0), maker.part("tex2", 1.0)
    amount = maker.part("amount", 0.5, "float")
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray) and isinstance(amount, np.ndarray):
        return (1 - amount) * first + amount * second
    return Mix(first, second, amount)


def _directionmix(maker: _Maker) -> Texture:
    given = maker.parameters.vectors("vector3", "dir")
    if given is not None and len(given) != 1:
        raise maker.parameters.fail("dir", f'"vector3 dir" is one vector, not {len(given)}')
    own = np.array([0.0, 1.0, 0.0]) if given is None else given[0]
    try:
        direction = unit(maker.transform.vector(own)) + 0.0
    except ValueError:
        raise maker.parameters.fail("dir", "dir must not be the zero vector") from None
    return DirectionMix(maker.part("tex1", 0.0), maker.part("tex2", 1.0), direction)


def _bilerp(maker: _Maker) -> Texture:
    defaults = {"v00": 0.0, "v01": 1.0, "v10": 0.0, "v11": 1.0}
    corners = [maker.number(name, default) for name, default in defaults.items()]
    return Bilerp(corners[0], corners[1], corners[2], corners[3], _mapping(maker))


def _checkerboard(maker: _Maker) -> Texture:
    dimension = maker.parameters.integer("dimension", 2)
    if dimension not in (2, 3):
        raise maker.parameters.fail("dimension", f"a checkerboard has dimension 2 or 3, not {dimension}")
    mapping = _mapping(maker) if dimension == 2 else PointMapping(_from_texture(maker))
    return Checkerboard(maker.part("tex1", 1.0), maker.part("tex2", 0.0), mapping)


def _dots(maker: _Maker) -> Texture:
    """pbrt lays `inside` around the dots and `outside` into them."""
    return Dots(maker.part("inside", 1.0), maker.part("outside", 0.0), _mapping(maker))


def _noise(kind: str) -> Callable[[_Maker], Texture]:
    def made(maker: _Maker) -> Texture:
        if kind == "windy":
            return NoiseTexture(kind, mapping=PointMapping(_from_texture(maker)))
        return NoiseTexture(kind, *_octaves(maker), PointMapping(_from_texture(maker)))

    return made


def _octaves(maker: _Maker) -> tuple[int, float]:
    octaves = maker.parameters.integer("octaves", 8)
    if not 0 <= octaves <= MOST_OCTAVES:
        raise maker.parameters.fail("octaves", f"octaves is between 0 and {MOST_OCTAVES}, not {octaves}")
    return octaves, maker.parameters.number("roughness", 0.5)


def _marble(maker: _Maker) -> Texture:
    scale, variation = (maker.parameters.number(*one) for one in (("scale", 1.0), ("variation", 0.2)))
    return Marble(*_octaves(maker), scale, variation, PointMapping(_from_texture(maker)))


def _ptex(maker: _Maker) -> Texture:
    """A stand-in: a number for each face cannot be read."""
    maker.parameters.substitute("", 'Texture "ptex"', "as a constant of 0.5")
    maker.parameters.ignore()
    return np.full(3, 0.5)


def _mapping(maker: _Maker) -> Mapping2D:
    parameters = maker.parameters
    kind = parameters.text("mapping", "uv")
    if kind not in _MAPPINGS:
        raise parameters.fail("mapping", f'unknown mapping "{kind}"; there are: {", ".join(_MAPPINGS)}')
    return _MAPPINGS[kind](maker)


def _uv(maker: _Maker) -> UVMapping:
    scale = [maker.parameters.number(name, 1.0) for name in ("uscale", "vscale")]
    shift = [maker.parameters.number(name, 0.0) for name in ("udelta", "vdelta")]
    return UVMapping(scale[0], scale[1], shift[0], shift[1])


def _planar(maker: _Maker) -> PlanarMapping:
    axes: list[Array] = []
    for name, default in (("v1", [1.0, 0.0, 0.0]), ("v2", [0.0, 1.0, 0.0])):
        given = maker.parameters.vectors("vector3", name)
        if given is not None and len(given) != 1:
            raise maker.parameters.fail(name, f'"vector3 {name}" is one vector, not {len(given)}')
        axes.append(np.array(default) if given is None else given[0])
    shift = [maker.parameters.number(name, 0.0) for name in ("udelta", "vdelta")]
    return PlanarMapping(_from_texture(maker), axes[0], axes[1], shift[0], shift[1])


_MAPPINGS: dict[str, Callable[[_Maker], Mapping2D]] = {
    "uv": _uv,
    "spherical": lambda maker: SphericalMapping(_from_texture(maker)),
    "cylindrical": lambda maker: CylindricalMapping(_from_texture(maker)),
    "planar": _planar,
}


def _from_texture(maker: _Maker) -> Array:
    """(4, 4) from the texture's space to the world."""
    if maker.transform.flattens:
        raise SceneError(FLAT, maker.parameters.where)
    return maker.transform.matrix


# pbrt-v4 looks all of these up bilinearly at the finest level where it has no ray differentials.
_FILTERS = {
    "bilinear": "bilinear",
    "point": "point",
    "trilinear": "bilinear",
    "ewa": "bilinear",
    "EWA": "bilinear",
}


_WRAPS = ("repeat", "black", "clamp", "octahedralsphere")


def _imagemap(maker: _Maker) -> Texture:
    parameters = maker.parameters
    filter_, wrap = parameters.text("filter", "bilinear"), parameters.text("wrap", "repeat")
    if filter_ not in _FILTERS:
        raise parameters.fail("filter", f'unknown filter "{filter_}"; there are: {", ".join(_FILTERS)}')
    if wrap not in _WRAPS:
        raise parameters.fail("wrap", f'unknown wrap "{wrap}"; there are: {", ".join(_WRAPS)}')
    parameters.number("maxanisotropy", 8.0)  # of the filter that is not simulated
    scale, invert = parameters.number("scale", 1.0), parameters.flag("invert", False)
    colours = maker.type == "spectrum"
    image = _texels(maker, wrap, filter_)
    return ImageTexture(image, _mapping(maker), wrap, _FILTERS[filter_], scale, invert, clamped=colours)


def _texels(maker: _Maker, wrap: str, filter_: str) -> Array:
    parameters = maker.parameters
    name, encoding = parameters.text("filename", ""), parameters.text("encoding", "sRGB")
    if not name:
        raise parameters.fail("filename", 'an imagemap needs "string filename"')
    if maker.type == "float":
        return numbers_of(maker.builder, parameters, name, encoding, wrap, filter_)
    return image_of(maker.builder, parameters, name, encoding, wrap)


_KINDS: dict[str, Callable[[_Maker], Texture]] = {
    "constant": _constant,
    "scale": _scale,
    "mix": _mix,
    "directionmix": _directionmix,
    "bilerp": _bilerp,
    "checkerboard": _checkerboard,
    "dots": _dots,
    "imagemap": _imagemap,
    "fbm": _noise("fbm"),
    "wrinkled": _noise("wrinkled"),
    "windy": _noise("windy"),
    "marble": _marble,
    "ptex": _ptex,
}
# pbrt has these of one type only.
_OF_TYPE = {"fbm": "float", "wrinkled": "float", "windy": "float", "marble": "spectrum"}


class TextureWriter:
    """Writes parameters of materials; the textures that they name are written before the first that uses
    them.
    """

    def __init__(self, files: SideFiles) -> None:
        self.files = files
        self._names: dict[tuple[str, int], str] = {}
        self._materials: dict[str, str] = {}

    def parameter(self, type_: str, name: str, texture: Texture, lines: list[str]) -> str:
        """A parameter of `type_` that is a constant or the name of a texture, whose text goes to `lines`."""
        if not isinstance(texture, np.ndarray):
            return f'"texture {name}" [ {self._name(type_, texture, lines)} ]'
        if type_ == "spectrum":
            return f'"rgb {name}" [ {numbers(texture)} ]'
        _check_gray(texture)
        return f'"float {name}" [ {float(texture[0])!r} ]'

    def parameters(self, named: Mapping[str, tuple[str, Texture]], lines: list[str]) -> str:
        """Several, given as name -> (type, texture)."""
        return " ".join(self.parameter(type_, name, one, lines) for name, (type_, one) in named.items())

    def material_name(self, text: str) -> tuple[str, bool]:
        """The name in quotes that the material of a text has or is to be given, and whether that is new."""
        new = text not in self._materials
        return self._materials.setdefault(text, quoted(f"material {len(self._materials) + 1}")), new

    def _name(self, type_: str, texture: Texture, lines: list[str]) -> str:
        key = (type_, id(texture))
        if key not in self._names:
            body = texture_text(texture, type_, self, lines)
            self._names[key] = quoted(f"texture {len(self._names) + 1}")
            directive = f'Texture {self._names[key]} "{type_}" {body}'
            placed = _placed(getattr(texture, "mapping", None))
            lines += [directive] if placed is None else ["AttributeBegin", placed, directive, "AttributeEnd"]
        return self._names[key]


@singledispatch
def texture_text(texture: Texture, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    """The kind and parameters of a `Texture` directive; those it is made of go to `lines` first."""
    raise TypeError(f"no pbrt text is known for a {type(texture).__name__}")


@texture_text.register
def _(texture: ImageTexture, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    if type_ == "float":
        _check_gray(texture.image)
    _check_bounds(texture, type_)
    writer.files.uneven |= any(side & (side - 1) for side in texture.image.shape[:2])
    look = f'"string filter" "{texture.filter}" "string wrap" "{texture.wrap}"'
    scale = "" if texture.scale == 1 else f' "float scale" [ {texture.scale!r} ]'
    invert = ' "bool invert" [ true ]' if texture.invert else ""
    return (
        f'"imagemap" "string filename" {writer.files.add(texture.image)} '
        f"{look}{scale}{invert}{mapping_text(texture.mapping)}"
    )


@texture_text.register
def _(texture: DirectionMix, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    mixed = writer.parameters({"tex1": (type_, texture.first), "tex2": (type_, texture.second)}, lines)
    return f'"directionmix" {mixed} "vector3 dir" [ {numbers(texture.direction)} ]'


@texture_text.register
def _(texture: Bilerp, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    corners = {name: (type_, getattr(texture, name)) for name in ("v00", "v01", "v10", "v11")}
    return f'"bilerp" {writer.parameters(corners, lines)}{mapping_text(texture.mapping)}'


@texture_text.register
def _(texture: Dots, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    parts = writer.parameters({"inside": (type_, texture.around), "outside": (type_, texture.within)}, lines)
    return f'"dots" {parts}{mapping_text(texture.mapping)}'


@texture_text.register
def _(texture: NoiseTexture, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    if type_ != "float":
        raise PenumbraError(f"pbrt's texture {texture.kind} is of numbers only")
    if texture.kind == "windy":
        return '"windy"'
    octaves = f'"integer octaves" [ {texture.octaves} ] "float roughness" [ {texture.roughness!r} ]'
    return f'"{texture.kind}" {octaves}'


@texture_text.register
def _(texture: Marble, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    if type_ != "spectrum" or not np.array_equal(texture.colors, VEINS):
        raise PenumbraError("pbrt's texture marble is of its own colours only")
    octaves = f'"integer octaves" [ {texture.octaves} ] "float roughness" [ {texture.roughness!r} ]'
    return (
        f'"marble" {octaves} "float scale" [ {texture.scale!r} ] "float variation" [ {texture.variation!r} ]'
    )


@texture_text.register
def _(texture: Checkerboard, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    squares = writer.parameters({"tex1": (type_, texture.first), "tex2": (type_, texture.second)}, lines)
    solid = ' "integer dimension" [ 3 ]' if type(texture.mapping) is PointMapping else ""
    return f'"checkerboard" {squares}{solid}{mapping_text(texture.mapping)}'


@texture_text.register
def _(texture: Product, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    """A product that pbrt would fold into its image is written as a mix with black, which it does not."""
    folded = _folded(texture, type_)
    if folded is None:
        factors = {"tex": (type_, texture.first), "scale": ("float", texture.second)}
        return f'"scale" {writer.parameters(factors, lines)}'
    image, factor = folded
    mixed = {"tex1": (type_, np.zeros(3)), "tex2": (type_, image), "amount": ("float", factor)}
    return f'"mix" {writer.parameters(mixed, lines)}'


@texture_text.register
def _(texture: Mix, type_: str, writer: TextureWriter, lines: list[str]) -> str:
    first, second = (type_, texture.first), (type_, texture.second)
    mixed = {"tex1": first, "tex2": second, "amount": ("float", texture.amount)}
    return f'"mix" {writer.parameters(mixed, lines)}'


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


def _check_bounds(texture: ImageTexture, type_: str) -> None:
    """pbrt bounds colours by 1 and numbers not."""
    if texture.clamped != (type_ == "spectrum") and texture.value(texture.image).max(initial=0.0) > 1:
        raise PenumbraError(
            f"an image texture exceeds 1 or is cut off there as no {type_} texture of pbrt's is"
        )


def _placed(mapping: UVMapping | PointMapping | None) -> str | None:
    """The directive before a texture that lies in a space of its own; None where it needs none."""
    if not isinstance(mapping, PointMapping) or np.array_equal(mapping.from_texture, np.eye(4)):
        return None
    return f"Transform [ {numbers(mapping.from_texture.T)} ]"


@singledispatch
def mapping_text(mapping: UVMapping | PointMapping) -> str:
    """The parameters of a mapping; "" for that of points."""
    return ""


@mapping_text.register
def _(mapping: UVMapping) -> str:
    named = {"uscale": (mapping.su, 1.0), "vscale": (mapping.sv, 1.0)}
    return _numbers_but_defaults(named | {"udelta": (mapping.du, 0.0), "vdelta": (mapping.dv, 0.0)})


@mapping_text.register
def _(mapping: SphericalMapping) -> str:
    return ' "string mapping" "spherical"'


@mapping_text.register
def _(mapping: CylindricalMapping) -> str:
    return ' "string mapping" "cylindrical"'


@mapping_text.register
def _(mapping: PlanarMapping) -> str:
    axes = f'"vector3 v1" [ {numbers(mapping.v1)} ] "vector3 v2" [ {numbers(mapping.v2)} ]'
    shift = _numbers_but_defaults({"udelta": (mapping.udelta, 0.0), "vdelta": (mapping.vdelta, 0.0)})
    return f' "string mapping" "planar" {axes}{shift}'


def _numbers_but_defaults(named: Mapping[str, tuple[float, float]]) -> str:
    return "".join(
        f' "float {name}" [ {value!r} ]' for name, (value, default) in named.items() if value != default
    )

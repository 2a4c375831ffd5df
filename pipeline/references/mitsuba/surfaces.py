"""Materials and textures for Mitsuba.

Mitsuba cannot multiply or mix textures. It can blend two BSDFs by a texture, and Lambertian reflection is
linear in its reflectance: a mix or a checkerboard of textures is a blend of diffuse surfaces, exactly.
Constants are multiplied into the textures that they scale. Two images are multiplied if neither is
interpolated, since their product is then an image.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from pipeline.references.mitsuba.worker import Plugin
from scenes.description.materials import Conductor, Dielectric, Diffuse, Material, Microfacets, MixedMaterial
from scenes.description.shapes import Array
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture, UVMapping
from scenes.errors import Location, SceneError

ASKEW = 1e-9  # of coordinates' axes whose parts in each other are rounding
MOST_TEXELS = 2**24  # of a product of two images: 200 MB in float32


@dataclass(frozen=True, eq=False)
class _Blend:
    """A blend (1 - weight) first + weight second. weight: a number, or a texture of equal channels."""

    first: _Tree
    second: _Tree
    weight: float | ImageTexture | UVMapping  # a mapping: the checkerboard of 0 and 1 under it


_Tree = Array | ImageTexture | _Blend


def bsdf(material: Material, to_uv: Array, where: Location | None) -> Plugin:
    """Mitsuba's BSDF of a material, two-sided as pbrt's. to_uv: (3, 3), from Mitsuba's uv of the shape to
    pbrt's.

    SceneError if Mitsuba cannot have the material or its textures.
    """
    if isinstance(material, Microfacets) and material.varying is not None:
        raise SceneError("a roughness that varies is not handed to Mitsuba", where)
    return _bsdf(material, to_uv, where)


@singledispatch
def _bsdf(material: Material, to_uv: Array, where: Location | None) -> Plugin:
    raise SceneError(f"Mitsuba has no counterpart of pbrt's {type(material).__name__} materials", where)


@_bsdf.register
def _(material: Diffuse, to_uv: Array, where: Location | None) -> Plugin:
    """Two-sided: Mitsuba's `diffuse` alone is black from behind, and pbrt's is not."""
    return Plugin("bsdf", "twosided", {"one": _diffuse(_expand(material.reflectance, where), to_uv)})


@_bsdf.register
def _(material: Conductor, to_uv: Array, where: Location | None) -> Plugin:
    """Mitsuba's mirrors are pbrt's; its rough metal has another shadowing term (plugins.py)."""
    if material.alpha == 0:
        mirror = Plugin("bsdf", "conductor", {"eta": material.eta, "k": material.k})
        return Plugin("bsdf", "twosided", {"one": mirror})
    values: dict[str, float] = {f"eta{c}": float(material.eta[c]) for c in range(3)}
    values |= {f"k{c}": float(material.k[c]) for c in range(3)}
    return Plugin("bsdf", "penumbra_conductor", {**_alphas(material, to_uv, where), **values})


@_bsdf.register
def _(material: Dielectric, to_uv: Array, where: Location | None) -> Plugin:
    """Mitsuba's smooth glass is pbrt's; its rough glass has another shadowing term (plugins.py)."""
    indices = {"int_ior": material.eta, "ext_ior": 1.0}
    if material.alpha == 0:
        return Plugin("bsdf", "thindielectric" if material.thin else "dielectric", indices)
    return Plugin("bsdf", "penumbra_dielectric", {**_alphas(material, to_uv, where), "eta": material.eta})


def _alphas(material: Microfacets, to_uv: Array, where: Location | None) -> dict[str, float]:
    """The roughness along Mitsuba's dp/du, and across where that differs. SceneError where Mitsuba's
    coordinates lie askew on pbrt's.
    """
    if material.alpha_v is None:
        return {"alpha": material.alpha}
    turn = np.abs(to_uv[:2, :2])
    straight, crossed = turn[0, 0] * turn[1, 1], turn[0, 1] * turn[1, 0]
    if min(straight, crossed) > ASKEW * max(straight, crossed) or turn.any(axis=0).sum() < 2:
        raise SceneError("anisotropic roughness on askew coordinates is not handed to Mitsuba", where)
    along, across = material.alpha, material.alpha_v
    return {"alpha": along, "alpha_v": across} if straight > crossed else {"alpha": across, "alpha_v": along}


@_bsdf.register
def _(material: MixedMaterial, to_uv: Array, where: Location | None) -> Plugin:
    """A mix of diffuse materials has the light of one whose reflectance is the mean of theirs."""
    reflectance = _reflectance(material)
    if reflectance is None:
        raise SceneError("Mitsuba is given a MixedMaterial of diffuse materials alone", where)
    return _bsdf(Diffuse(reflectance), to_uv, where)


@singledispatch
def _reflectance(material: Material) -> Texture | None:
    """The reflectance of a diffuse material, or of a mix of such; None for other materials."""
    return None


@_reflectance.register
def _(material: Diffuse) -> Texture:
    return material.reflectance


@_reflectance.register
def _(material: MixedMaterial) -> Texture | None:
    first, second = (_reflectance(part) for part in material.parts)
    return None if first is None or second is None else Mix(first, second, material.amount)


def is_textured(material: Material, where: Location | None) -> bool:
    """Whether the material's reflectance varies over the shape."""
    reflectance = _reflectance(material)
    return reflectance is not None and not isinstance(_expand(reflectance, where), np.ndarray)


def bitmap(image: Array, mapping: UVMapping, wrap: str, filtering: str, to_uv: Array) -> Plugin:
    """Mitsuba's texture of an image (h, w, c), whose first row is at t = 1 in pbrt and at v = 0 in
    Mitsuba.
    """
    h, w = image.shape[:2]
    place = np.array([[mapping.su, 0, mapping.du], [0, -mapping.sv, 1 - mapping.dv], [0, 0, 1]])
    if wrap == "black":  # Mitsuba has no such mode: a frame of black texels, repeated outwards
        image = np.pad(image, ((1, 1), (1, 1), (0, 0)))
        place = np.array([[w / (w + 2), 0, 1 / (w + 2)], [0, h / (h + 2), 1 / (h + 2)], [0, 0, 1]]) @ place
    image = image.repeat(2 if image.shape[0] == 1 else 1, axis=0).repeat(
        2 if image.shape[1] == 1 else 1, axis=1
    )
    values = {
        "bitmap": image,
        "raw": True,
        "format": "variant",
        "filter_type": "nearest" if filtering == "point" else "bilinear",
        "wrap_mode": "repeat" if wrap == "repeat" else "clamp",
        "to_uv": place @ to_uv,
    }
    return Plugin("texture", "bitmap", values)


def _diffuse(tree: _Tree, to_uv: Array) -> Plugin:
    if isinstance(tree, _Blend):
        parts = {"bsdf_0": _diffuse(tree.first, to_uv), "bsdf_1": _diffuse(tree.second, to_uv)}
        return Plugin("bsdf", "blendbsdf", {"weight": _weight(tree.weight, to_uv), **parts})
    if isinstance(tree, ImageTexture):
        return Plugin("bsdf", "diffuse", {"reflectance": _image(tree, to_uv)})
    return Plugin("bsdf", "diffuse", {"reflectance": tree})


def _image(texture: ImageTexture, to_uv: Array) -> Plugin:
    mapping = _uv_mapping(texture, None)
    return bitmap(texture.image, mapping, texture.wrap, texture.filter, to_uv)


def _weight(weight: float | ImageTexture | UVMapping, to_uv: Array) -> float | Plugin:
    if isinstance(weight, ImageTexture):
        return _image(replace(weight, image=weight.image[..., :1]), to_uv)
    if not isinstance(weight, UVMapping):
        return weight
    squares = np.array([[1.0, 0.0], [0.0, 1.0]])[
        ..., None
    ]  # first row at t = 1, one period in each direction
    half = UVMapping(weight.su / 2, weight.sv / 2, weight.du / 2, weight.dv / 2)
    return bitmap(squares, half, "repeat", "point", to_uv)


@singledispatch
def _expand(texture: Texture, where: Location | None) -> _Tree:
    """A texture as blends of images and constants."""
    raise SceneError(f"Mitsuba has no counterpart of a texture {type(texture).__name__}", where)


@_expand.register
def _(texture: np.ndarray, where: Location | None) -> _Tree:
    return texture


def _uv_mapping(texture: ImageTexture | Checkerboard, where: Location | None) -> UVMapping:
    """The texture's mapping; SceneError unless it is by texture coordinates."""
    if not isinstance(texture.mapping, UVMapping):
        raise SceneError(f"Mitsuba has no counterpart of a {type(texture.mapping).__name__}", where)
    return texture.mapping


@_expand.register
def _(texture: ImageTexture, where: Location | None) -> _Tree:
    _uv_mapping(texture, where)
    if texture.wrap == "octahedralsphere":
        raise SceneError('Mitsuba has no counterpart of the wrap "octahedralsphere"', where)
    plain = texture.plain()
    if plain is None:
        raise SceneError(
            "an image texture whose interpolated values are cut off, or that is inverted with black around "
            "it, cannot be given to Mitsuba",
            where,
        )
    return plain


@_expand.register
def _(texture: Checkerboard, where: Location | None) -> _Tree:
    first, second = _expand(texture.first, where), _expand(texture.second, where)
    return _blend(first, second, _uv_mapping(texture, where))


@_expand.register
def _(texture: Product, where: Location | None) -> _Tree:
    return _multiply(_expand(texture.first, where), _expand(texture.second, where), where)


@_expand.register
def _(texture: Mix, where: Location | None) -> _Tree:
    first, second, amount = (_expand(one, where) for one in (texture.first, texture.second, texture.amount))
    return _mix(first, second, amount, where)


def _blend(first: _Tree, second: _Tree, weight: float | ImageTexture | UVMapping) -> _Tree:
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray) and np.array_equal(first, second):
        return first
    return _Blend(first, second, weight)


def _multiply(a: _Tree, b: _Tree, where: Location | None) -> _Tree:
    if isinstance(a, _Blend):
        return _Blend(_multiply(a.first, b, where), _multiply(a.second, b, where), a.weight)
    if isinstance(b, _Blend):
        return _multiply(b, a, where)
    if isinstance(a, ImageTexture) and isinstance(b, ImageTexture):
        return _product(a, b, where)
    if isinstance(a, ImageTexture):
        assert isinstance(b, np.ndarray)
        return replace(a, image=a.image * b)
    return replace(b, image=b.image * a) if isinstance(b, ImageTexture) else a * b


def _product(a: ImageTexture, b: ImageTexture, where: Location | None) -> ImageTexture:
    """The product of two images under one mapping, on the texels of both."""
    same = all(getattr(a.mapping, name) == getattr(b.mapping, name) for name in ("su", "sv", "du", "dv"))
    if not (same and a.wrap == b.wrap and a.filter == b.filter == "point"):
        raise SceneError(
            "a product of two image textures can be given to Mitsuba only where both have one mapping, one "
            'wrap and the filter "point"',
            where,
        )
    h, w = (int(np.lcm(x, y)) for x, y in zip(a.image.shape[:2], b.image.shape[:2], strict=True))
    if h * w > MOST_TEXELS:
        raise SceneError(f"a product of two image textures would have {w} x {h} texels", where)
    fine = [
        one.image.repeat(h // one.image.shape[0], axis=0).repeat(w // one.image.shape[1], axis=1)
        for one in (a, b)
    ]
    return replace(a, image=fine[0] * fine[1])


def _mix(first: _Tree, second: _Tree, amount: _Tree, where: Location | None) -> _Tree:
    if isinstance(amount, _Blend):
        lower, upper = (_mix(first, second, part, where) for part in (amount.first, amount.second))
        return _blend(lower, upper, amount.weight)
    if isinstance(first, np.ndarray) and isinstance(second, np.ndarray) and isinstance(amount, np.ndarray):
        return (1 - amount) * first + amount * second
    values = amount.image if isinstance(amount, ImageTexture) else amount
    if np.any(values != values[..., :1]):
        raise SceneError(
            "a mix of textures by a coloured amount cannot be given to Mitsuba: give a gray one", where
        )
    return _Blend(first, second, amount if isinstance(amount, ImageTexture) else float(amount[0]))

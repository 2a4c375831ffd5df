"""Images of textures and lights, as pbrt-v4 reads, resizes and keeps them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError
from scenes.images.encodings import as_stored, checked_encoding
from scenes.images.resampling import resized, rounded_up
from scenes.pbrt.state import Builder
from scenes.pbrt.text.parameters import Parameters

Array = NDArray[np.float64]
T = TypeVar("T")

# Of all images of a scene: 3.2 GB as they are held. Measured while two textures of 8192 x 8192 are read: at
# most 3.3 GB in all where their
# sides are powers of two, 4.7 GB where they are resized, 4.4 GB as textures of numbers.
TEXELS = 2**27
SRGB = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)  # x and y of red, green, blue and white
CLOSE = 1e-3  # relative, of chromaticities: `RGBColorSpace::Lookup`


def image_of(
    builder: Builder, parameters: Parameters, name: str, encoding: str = "sRGB", wrap: str | None = None
) -> Array:
    """The image file `name`, which the parameter "filename" gives: (h, w, 3) float64, linear RGB, nothing
    below 0, rounded to float32.

    encoding: as `images.read_texels` takes it. wrap: "repeat", "clamp" or "black" for a texture, which is
    resized to powers of two; None for a light's image, which is not. The same file gives the same array.
    SceneError at the parameter where it cannot be read.
    """
    return _found(builder, parameters, name, encoding, wrap, "")


def numbers_of(
    builder: Builder, parameters: Parameters, name: str, encoding: str, wrap: str, filter_: str
) -> Array:
    """The image file `name`, as by `image_of`, for a texture of numbers: three equal components.

    From a file of colours pbrt-v4 takes red for the filter "point". For interpolating filters it takes alpha,
    or the mean of red, green and blue if the file is opaque. "EWA" takes now red and now the other: it is
    reported unless both are equal.
    """
    return _found(builder, parameters, name, encoding, wrap, filter_.lower())


def normals_of(builder: Builder, parameters: Parameters, name: str) -> Array:
    """The image file `name` of the parameter "normalmap": (h, w, 3) float64 as the file holds it."""
    from scenes.images.exr import read_texture

    path = str(_at(parameters, "normalmap", lambda: parameters.resolve(name)))
    key = (path, "normalmap", "", "")
    if key not in builder.images:
        image = _at(parameters, "normalmap", lambda: read_texture(path, "linear"))
        builder.texels += image.shape[0] * image.shape[1]
        if builder.texels > TEXELS:
            raise parameters.fail(
                "normalmap", f"the images of the scene have more than {TEXELS} texels in all"
            )
        builder.images[key] = image
    return builder.images[key]


def means_of(builder: Builder, parameters: Parameters, name: str) -> Array:
    """The image of a light with one number a texel, (h, w): the mean of red, green and blue in the precision
    of the file, as pbrt takes it.
    """
    from scenes.images.exr import texture_header

    image = image_of(builder, parameters, name)
    header = texture_header(parameters.resolve(name))
    return single(as_stored(image.mean(axis=2), header.storage, "sRGB"))


def single(image: Array) -> Array:
    """Texels rounded to float32, as image files hold them, so that a scene that is written and read again
    keeps its bits.
    """
    return image.astype(np.float32).astype(np.float64)


def _found(
    builder: Builder, parameters: Parameters, name: str, encoding: str, wrap: str | None, filter_: str
) -> Array:
    """Texels of an image, kept from an earlier reading if there was one. filter_: in lower case for numbers,
    "" for colours.
    """
    # Here, because most scenes name no images and OpenImageIO takes time.
    from scenes.images.exr import read_texels, texture_header

    _at(parameters, "encoding", lambda: checked_encoding(encoding))
    header = _at(parameters, "filename", lambda: texture_header(parameters.resolve(name)))
    if header.layer:
        layer = f'the image has no R, G and B but in its layer "{header.layer}", which is taken'
        parameters.note("filename", f"{layer}; pbrt refuses it")
    if header.png is None:
        encoding = "sRGB"  # pbrt takes the word for PNG files only
    if header.chromaticities is not None:
        _check_colours(parameters, header.chromaticities)
    size = header.height, header.width
    new = size if wrap is None else (rounded_up(header.height), rounded_up(header.width))
    if wrap == "octahedralsphere" and (new != size or header.width != header.height):
        raise parameters.fail(
            "wrap",
            f'wrap "{wrap}" takes a square image whose side is a power of two, not {size[1]} x {size[0]}',
        )
    wrap = None if new == size else wrap
    key = (str(header.path.resolve()), encoding, wrap or "", filter_)
    if key in builder.images:
        return builder.images[key]
    builder.texels += new[0] * new[1]
    if builder.texels > TEXELS:
        raise parameters.fail(
            "filename", f"the images of the scene, resized, have more than {TEXELS} texels in all"
        )
    texels = _at(parameters, "filename", lambda: read_texels(header, encoding))
    texels = _numbers(parameters, texels, filter_) if filter_ else texels[..., :3]
    if wrap is not None:
        texels = resized(texels, wrap, lambda rows: single(as_stored(rows, header.storage, encoding)))
    if filter_ and texels.shape[2] == 3:
        texels = single(texels.mean(axis=2, keepdims=True))
    if texels.shape[2] == 1:
        texels = np.repeat(texels, 3, axis=2)
    builder.images[key] = np.maximum(texels, 0.0, out=np.ascontiguousarray(texels))
    return builder.images[key]


def _at(parameters: Parameters, name: str, read: Callable[[], T]) -> T:
    """The result of `read`, whose PenumbraError becomes a SceneError at the parameter `name`."""
    try:
        return read()
    except PenumbraError as error:
        raise parameters.fail(name, str(error)) from None


def _numbers(parameters: Parameters, texels: Array, filter_: str) -> Array:
    """The channel of a texture of numbers, (h, w, 1), or the three of which it is the mean."""
    if texels.shape[2] == 1 or filter_ == "point":
        return texels[..., :1]
    opaque = texels.shape[2] == 3 or bool((texels[..., 3] == 1.0).all())
    gray = not any((texels[..., 0] != texels[..., i]).any() for i in (1, 2))
    if filter_ == "ewa" and not (opaque and gray):
        parameters.unsupported(
            "filter",
            'the filter "EWA" on a file of colours for a texture of numbers is not supported, since pbrt '
            f"takes red where it filters and {'the mean of red, green and blue' if opaque else 'alpha'} "
            'where it does not; supported: "bilinear", "trilinear", "point"',
        )
    return texels[..., :3] if opaque else texels[..., 3:]


def _check_colours(parameters: Parameters, chromaticities: tuple[float, ...]) -> None:
    """Report an image whose red, green, blue and white are not sRGB's."""
    if any(abs(found - known) > CLOSE * known for found, known in zip(chromaticities, SRGB, strict=True)):
        shown = " ".join(f"{number:.4g}" for number in chromaticities)
        parameters.unsupported(
            "filename",
            (
                f"the image's attribute chromaticities is {shown}; only sRGB's is supported: convert the "
                "image to sRGB"
            ),
        )

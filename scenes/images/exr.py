# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false, reportMissingTypeStubs=false
"""Images in and out: EXR by channel name, PNG to look at. The only import of OpenImageIO.

Two habits of OpenImageIO are handled here. It reorders channels, so that they are read by name. It returns
DOUBLE pixels as float32, so that files hold float32 and exact state belongs in an .npz.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from scenes.errors import PenumbraError
from scenes.files import check_fetched, replacing, utf8_name
from scenes.images.encodings import as_stored, colour_planes, decoded, encoded
from scenes.images.png import RGBA, PngHeader, Unsound, check_png_pixels, png_header

Array = NDArray[np.float64]
Channels = dict[str, Array]

_METADATA = (
    "penumbra"  # one attribute holding JSON: OpenImageIO drops empty strings and cannot hold every key
)
_RGB = ("R", "G", "B")
TEXELS = 2**26  # of a texture: 1.6 GB as it is held
ROWS = 256  # of a texture, decoded at a time: whole blocks of every compression of EXR
_WHOLE = {"uint8": 2**8, "uint16": 2**16}  # numbers that are decoded by a table
_STORAGE = {"uint8": "bytes", "half": "half"}  # what pbrt-v4 keeps such an image in, if it is not float


@dataclass(frozen=True, eq=False)
class ExrImage:
    """channels: name -> (h, w) float64. metadata: that given to `write_exr`, or a foreign file's text
    attributes.
    """

    channels: Channels
    metadata: dict[str, str]


@dataclass(frozen=True, eq=False)
class EstimateImage:
    """mean, variance (of the mean): (h, w, 3) float64. count: (h, w) float64, samples of each pixel."""

    mean: Array
    variance: Array
    count: Array
    metadata: dict[str, str]


@dataclass(frozen=True, eq=False)
class TextureHeader:
    """The header of a texture's file, read before its texels.

    planes: the numbers of its channels: gray, or R, G, B, and alpha if pbrt would see it. layer: the layer of
    an EXR that they belong to, "" for none. kind: OpenImageIO's name of the format. storage: pbrt's
    precision, "bytes", "half" or "float". chromaticities: x and y of R, G, B and white of an EXR.
    """

    path: Path
    height: int
    width: int
    planes: tuple[int, ...]
    layer: str
    kind: str
    storage: str
    chromaticities: tuple[float, ...] | None
    png: PngHeader | None


def write_exr(
    path: str | Path, channels: Mapping[str, NDArray[Any]], metadata: Mapping[str, str] | None = None
) -> None:
    """Write `channels`, (h, w) each, as float32 with lossless zip compression and any `metadata`, atomically.

    Values beyond float32 become infinite, which every metric counts as non-finite. PenumbraError, naming the
    path, if it cannot be written; ValueError if the channels differ in shape.
    """
    pixels = _interleave(channels)
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, "float")
    spec.channelnames = tuple(channels)
    spec.attribute("compression", "zip")
    spec.attribute(_METADATA, json.dumps(dict(metadata or {})))
    _write(Path(path), spec, pixels)


def read_exr(path: str | Path) -> ExrImage:
    """All channels of an EXR by name. PenumbraError, naming the path, if it is missing, broken or no EXR."""
    path = _image_file(path)
    source = oiio.ImageInput.open(utf8_name(path))
    if source is None:
        raise PenumbraError(f"{path}: not a readable EXR image: {_first_line(oiio.geterror())}")
    try:
        if source.format_name() != "openexr":
            raise PenumbraError(f"{path}: an EXR image is wanted, this is {source.format_name()}")
        spec, pixels = source.spec(), source.read_image("float")
        if pixels is None:
            raise PenumbraError(f"{path}: corrupt or truncated EXR image: {_first_line(source.geterror())}")
    finally:
        source.close()
    planes = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
    named = {name: np.ascontiguousarray(plane) for name, plane in zip(spec.channelnames, planes, strict=True)}
    return ExrImage(named, _metadata(path, spec))


def read_rgb(path: str | Path) -> Array:
    """The channels R, G, B of an EXR as (h, w, 3) float64. PenumbraError with the channels that are missing
    and those there are.
    """
    return _stack(Path(path), read_exr(path).channels, _RGB)


def write_estimate_exr(
    path: str | Path,
    mean: Array,
    variance: Array,
    count: NDArray[Any] | float | int,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write an estimate: mean (h, w, 3) as R G B, variance of the mean (h, w, 3) as variance.R ..., count (h,
    w) or one number as N.
    """
    channels = {name: mean[..., i] for i, name in enumerate(_RGB)}
    channels |= {f"variance.{name}": variance[..., i] for i, name in enumerate(_RGB)}
    channels["N"] = np.broadcast_to(np.asarray(count, dtype=np.float64), mean.shape[:2])
    write_exr(path, channels, metadata)


def read_estimate_exr(path: str | Path) -> EstimateImage:
    """Read a file of `write_estimate_exr`. PenumbraError, naming the path, if a channel is missing."""
    path, image = Path(path), read_exr(path)
    mean = _stack(path, image.channels, _RGB)
    variance = _stack(path, image.channels, tuple(f"variance.{name}" for name in _RGB))
    return EstimateImage(mean, variance, _stack(path, image.channels, ("N",))[..., 0], image.metadata)


def texture_header(path: str | Path) -> TextureHeader:
    """The header of an image file of any format. PenumbraError, naming the path, if it is no image or too
    large.
    """
    path = _image_file(path)
    try:
        png = png_header(path)
    except (Unsound, OSError) as error:
        raise PenumbraError(f"{path}: not a readable image: {error}") from None
    with _texture(path) as source:
        spec, kind, depth = source.spec(), str(source.format_name()), str(source.spec().format)
        if spec.width * spec.height * max(spec.nchannels, 4) > 4 * TEXELS:
            raise PenumbraError(
                f"{path}: {spec.width} x {spec.height} texels of {spec.nchannels} channels; at most "
                f"{TEXELS} of 4 are read"
            )
        found = spec.getattribute("chromaticities") if kind == "openexr" else None
        storage = "half" if (kind, depth) == ("png", "uint16") else _STORAGE.get(depth, "float")
    layer, planes = colour_planes(
        path, spec.channelnames, kind == "openexr" or (png is not None and png.colour == RGBA)
    )
    chromaticities = None if found is None else tuple(float(number) for number in found)
    return TextureHeader(path, spec.height, spec.width, planes, layer, kind, storage, chromaticities, png)


def read_texels(header: TextureHeader, encoding: str = "sRGB") -> Array:
    """The channels of an image, (h, w, c) float64, linear, rounded to float32: one if gray, three, or four
    where there is an alpha.

    As in pbrt-v4: whole numbers are decoded, alpha with them, by `encoding` ("sRGB", "linear" or "gamma 2.2")
    if the file is a PNG and as sRGB if not; EXR, HDR and PFM are linear as they stand; nothing is multiplied
    by alpha. PenumbraError naming the path.
    """
    path = header.path
    try:
        if header.png is not None:
            check_png_pixels(path, header.png)
    except (Unsound, OSError) as error:
        raise PenumbraError(f"{path}: corrupt or truncated image: {error}") from None
    texels = np.zeros((header.height, header.width, len(header.planes)))
    with _texture(path) as source:
        spec, table = source.spec(), None
        kind = str(spec.format) if str(spec.format) in _WHOLE else "float"
        if kind != "float":
            whole = np.arange(_WHOLE[kind]) / (_WHOLE[kind] - 1.0)
            table = decoded(whole, encoding if header.png is not None else "sRGB")
            table = as_stored(table, "half", encoding) if header.storage == "half" else table
        step = max(ROWS - ROWS % spec.tile_height, spec.tile_height) if spec.tile_height else ROWS
        for top in range(0, header.height, step):
            rows = slice(top, min(top + step, header.height))
            pixels = _read_rows(source, spec, rows, max(header.planes) + 1, kind)
            if pixels is None:
                raise PenumbraError(f"{path}: corrupt or truncated image: {_first_line(source.geterror())}")
            part = pixels.reshape(rows.stop - top, header.width, -1)[..., list(header.planes)]
            linear = part if table is None else table.take(part)
            if not np.isfinite(linear).all():
                raise PenumbraError(f"{path}: a texel is not finite")
            texels[rows] = linear.astype(np.float32)
    return texels


def read_texture(path: str | Path, encoding: str = "sRGB") -> Array:
    """Any image as (h, w, 3) float64, read as by `read_texels`: gray is tripled, and alpha is left out."""
    texels = read_texels(texture_header(path), encoding)
    return np.repeat(texels, 3, axis=2) if texels.shape[2] == 1 else np.ascontiguousarray(texels[..., :3])


@contextmanager
def _texture(path: Path) -> Generator[oiio.ImageInput]:
    """The file, opened to read its texels."""
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    config.attribute(
        "pnm:pfmflip", 1
    )  # PFM begins with the last row; left to itself the reader decides now so, now so
    source = oiio.ImageInput.open(utf8_name(path), config)
    if source is None:
        raise PenumbraError(f"{path}: not a readable image: {_first_line(oiio.geterror())}")
    try:
        yield source
    finally:
        source.close()


def _read_rows(
    source: oiio.ImageInput, spec: oiio.ImageSpec, rows: slice, end: int, kind: str
) -> NDArray[Any] | None:
    """The channels before `end` of some rows, as numbers of `kind`; None if they cannot be read."""
    top, bottom = spec.y + int(rows.start), spec.y + int(rows.stop)
    if not spec.tile_height:
        return source.read_scanlines(top, bottom, spec.z, 0, end, kind)
    return source.read_tiles(spec.x, spec.x + spec.width, top, bottom, spec.z, spec.z + 1, 0, end, kind)


def _image_file(path: str | Path) -> Path:
    """The path of an image file. PenumbraError with what is wrong if it is no file."""
    path = Path(path)
    if path.is_dir():
        raise PenumbraError(f"{path}: a folder, not an image file")
    if not path.is_file():
        raise PenumbraError(
            f"{path}: {'a pipe or a device, not an' if path.exists() else 'no such'} image file"
        )
    try:
        check_fetched(path)
    except OSError as error:
        raise PenumbraError(f"{path}: not a readable image: {error.strerror}") from None
    return path


def write_png(path: str | Path, rgb: Array, exposure: float = 0.0) -> None:
    """Write linear `rgb` (h, w, 3) as an 8-bit sRGB PNG, `exposure` stops brighter.

    It serves the eye only: values are clipped to [0, 1] after exposure, infinities too, and a pixel with a
    NaN is magenta.
    """
    linear = np.clip(rgb * 2.0**exposure, 0.0, 1.0)
    linear = np.where(np.isnan(linear).any(axis=-1, keepdims=True), (1.0, 0.0, 1.0), linear)
    codes = np.rint(encoded(linear, "sRGB") * 255.0).astype(np.uint8)
    spec = oiio.ImageSpec(codes.shape[1], codes.shape[0], 3, "uint8")
    _write(Path(path), spec, np.ascontiguousarray(codes))


def _interleave(channels: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """The channels as one (h, w, c) float32 array."""
    if not channels or len({np.shape(plane) for plane in channels.values()}) != 1:
        raise ValueError(
            f"channels must be (h, w) arrays of one shape, not {[np.shape(p) for p in channels.values()]}"
        )
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(np.stack(list(channels.values()), axis=-1).astype(np.float32))


def _write(path: Path, spec: oiio.ImageSpec, pixels: NDArray[Any]) -> None:
    if not path.parent.is_dir():
        raise PenumbraError(f"{path}: cannot be written: there is no folder {path.parent}")
    with replacing(path) as temporary:
        target = oiio.ImageOutput.create(utf8_name(temporary))
        if target is None:
            raise PenumbraError(f"{path}: cannot be written: {_first_line(oiio.geterror())}")
        if not (target.open(str(temporary), spec) and target.write_image(pixels) and target.close()):
            raise PenumbraError(
                f"{path}: cannot be written: "
                f"{_first_line(target.geterror()).replace(str(temporary), path.name)}"
            )


def _metadata(path: Path, spec: oiio.ImageSpec) -> dict[str, str]:
    attributes = {item.name: item.value for item in spec.extra_attribs}
    if _METADATA not in attributes:
        return {name: value for name, value in attributes.items() if isinstance(value, str)}
    try:
        return {str(name): str(value) for name, value in json.loads(str(attributes[_METADATA])).items()}
    except (ValueError, AttributeError) as error:
        raise PenumbraError(f"{path}: its {_METADATA!r} attribute is broken: {error}") from error


def _stack(path: Path, channels: Channels, names: tuple[str, ...]) -> Array:
    missing = [name for name in names if name not in channels]
    if missing:
        raise PenumbraError(f"{path}: no channel {', '.join(missing)}; there are: {', '.join(channels)}")
    return np.stack([channels[name] for name in names], axis=-1)


def _first_line(message: str) -> str:
    return message.strip().splitlines()[0] if message.strip() else "no reason given"

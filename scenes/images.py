# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false, reportMissingTypeStubs=false
"""Images in and out: EXR by channel name, PNG for the eye. The only import of OpenImageIO.

Two habits of OpenImageIO are handled here and nowhere else: it reorders channels, so that channels are read by
name; and it hands DOUBLE pixels back as float32, so that files hold float32 and exact state belongs in an .npz.
"""

from __future__ import annotations

import json
import os
import secrets
import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from scenes.errors import PenumbraError

Array = NDArray[np.float64]
Channels = dict[str, Array]

_METADATA = "penumbra"  # one attribute holding JSON: OpenImageIO drops empty strings and cannot hold every key
_RGB = ("R", "G", "B")
TEXELS = 2**26  # of a texture: 1.6 GB as it is held


@dataclass(frozen=True, eq=False)
class ExrImage:
    """channels: name -> (h, w) float64; metadata: what `write_exr` was given, or a foreign file's own string attributes."""

    channels: Channels
    metadata: dict[str, str]


@dataclass(frozen=True, eq=False)
class EstimateImage:
    """mean, variance (of the mean): (h, w, 3) float64; count: (h, w) float64, samples behind each pixel."""

    mean: Array
    variance: Array
    count: Array
    metadata: dict[str, str]


@contextmanager
def replacing(path: str | Path) -> Generator[Path]:
    """A temporary name beside `path`, same suffix, that replaces `path` when the block ends well and vanishes when it does not.

    Raises PenumbraError where the folder cannot be written. Readers see the old file or the new one, never a part.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise PenumbraError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        if path.parent.is_dir():
            temporary.unlink(missing_ok=True)


def write_exr(
    path: str | Path, channels: Mapping[str, NDArray[Any]], metadata: Mapping[str, str] | None = None
) -> None:
    """Write `channels`, each (h, w), as float32 with lossless zip compression, and `metadata` (any strings), atomically.

    What exceeds float32 becomes infinite, which every metric counts as non-finite. Raises PenumbraError naming the
    path where it cannot be written, ValueError where the channels differ in shape.
    """
    pixels = _interleave(channels)
    height, width, count = pixels.shape
    spec = oiio.ImageSpec(width, height, count, "float")
    spec.channelnames = tuple(channels)
    spec.attribute("compression", "zip")
    spec.attribute(_METADATA, json.dumps(dict(metadata or {})))
    _write(Path(path), spec, pixels)


def read_exr(path: str | Path) -> ExrImage:
    """Read every channel of an EXR by name; PenumbraError naming the path where it is missing, broken or no EXR."""
    path = Path(path)
    if not path.is_file():
        raise PenumbraError(f"{path}: no such image file")
    source = oiio.ImageInput.open(str(path))
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
    """The channels R, G, B of an EXR as (h, w, 3) float64; PenumbraError naming what is missing and what there is."""
    return _stack(Path(path), read_exr(path).channels, _RGB)


def write_estimate_exr(
    path: str | Path,
    mean: Array,
    variance: Array,
    count: NDArray[Any] | float | int,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write an estimate: mean (h, w, 3) as R G B, variance of the mean (h, w, 3) as variance.R ..., count (h, w) or one number as N."""
    channels = {name: mean[..., i] for i, name in enumerate(_RGB)}
    channels |= {f"variance.{name}": variance[..., i] for i, name in enumerate(_RGB)}
    channels["N"] = np.broadcast_to(np.asarray(count, dtype=np.float64), mean.shape[:2])
    write_exr(path, channels, metadata)


def read_estimate_exr(path: str | Path) -> EstimateImage:
    """Read what `write_estimate_exr` wrote; PenumbraError naming the path where a channel is missing."""
    path, image = Path(path), read_exr(path)
    mean = _stack(path, image.channels, _RGB)
    variance = _stack(path, image.channels, tuple(f"variance.{name}" for name in _RGB))
    return EstimateImage(mean, variance, _stack(path, image.channels, ("N",))[..., 0], image.metadata)


def read_texture(path: str | Path, encoding: str = "sRGB") -> Array:
    """Any image as (h, w, 3) float64, linear RGB, gray ones threefold; PenumbraError naming the path where it cannot be.

    As in pbrt-v4: whole numbers are decoded, EXR, HDR and PFM are linear as they stand. encoding: "sRGB", "linear" or
    "gamma 2.2" for what is decoded. Alpha is left out and not multiplied in. At most 2^26 texels.
    """
    path = Path(path)
    if not path.is_file():
        raise PenumbraError(f"{path}: no such image file")
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    config.attribute("pnm:pfmflip", 1)  # PFM begins with the last row; left to itself the reader decides now so, now so
    source = oiio.ImageInput.open(str(path), config)
    if source is None:
        raise PenumbraError(f"{path}: not a readable image: {_first_line(oiio.geterror())}")
    try:
        spec = source.spec()
        if spec.width * spec.height * max(spec.nchannels, 4) > 4 * TEXELS:
            raise PenumbraError(
                f"{path}: {spec.width} x {spec.height} texels of {spec.nchannels} channels; at most {TEXELS} of 4 are read"
            )
        pixels = source.read_image("float")
        if pixels is None:
            raise PenumbraError(f"{path}: corrupt or truncated image: {_first_line(source.geterror())}")
    finally:
        source.close()
    planes = np.asarray(pixels, dtype=np.float64).reshape(spec.height, spec.width, -1)
    rgb = _colour_planes(path, planes, spec.channelnames)
    if not np.isfinite(rgb).all():
        raise PenumbraError(f"{path}: a texel is not finite")
    return rgb if str(spec.format) in ("float", "half", "double") else _decoded(rgb, encoding)


def _colour_planes(path: Path, planes: Array, names: Sequence[str]) -> Array:
    """The channels R, G and B, or the only one (beside alpha) threefold: (h, w, 3)."""
    found = {name.upper(): i for i, name in enumerate(names)}
    if all(name in found for name in _RGB):
        return np.ascontiguousarray(planes[..., [found[name] for name in _RGB]])
    gray = [i for name, i in found.items() if name not in ("A", "ALPHA")]
    if len(gray) != 1:
        raise PenumbraError(f"{path}: neither R, G and B nor one channel; there are: {', '.join(names)}")
    return np.repeat(planes[..., gray], 3, axis=2)


def _decoded(encoded: Array, encoding: str) -> Array:
    words = encoding.split()
    if words == ["linear"]:
        return encoded
    if words == ["sRGB"]:
        low = encoded / 12.92
        return np.where(encoded <= 0.04045, low, ((encoded + 0.055) / 1.055) ** 2.4)
    try:
        gamma = float(words[1]) if len(words) == 2 and words[0] == "gamma" else 0.0
    except ValueError:
        gamma = 0.0
    if not 0 < gamma < np.inf:
        raise PenumbraError(f'unknown encoding "{encoding}"; there are: sRGB, linear, gamma with its exponent')
    return encoded**gamma


def write_png(path: str | Path, rgb: Array, exposure: float = 0.0) -> None:
    """Write linear `rgb` (h, w, 3) as an 8-bit sRGB PNG, `exposure` stops brighter.

    For the eye only: values are clipped to [0, 1] after exposure, infinities with them, and a pixel with a NaN is magenta.
    The sRGB transfer function is IEC 61966-2-1's, by way of colour-science.
    """
    linear = np.clip(rgb * 2.0**exposure, 0.0, 1.0)
    linear = np.where(np.isnan(linear).any(axis=-1, keepdims=True), (1.0, 0.0, 1.0), linear)
    encoded = np.rint(_srgb(linear) * 255.0).astype(np.uint8)
    spec = oiio.ImageSpec(encoded.shape[1], encoded.shape[0], 3, "uint8")
    _write(Path(path), spec, np.ascontiguousarray(encoded))


def _srgb(linear: Array) -> Array:
    # Imported here: it takes a second, and it warns of the plotting library that it could use and nothing here needs.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message='.*"Matplotlib" related API')
        import colour
    return np.asarray(colour.cctf_encoding(linear, function="sRGB"), dtype=np.float64)


def _interleave(channels: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """The channels as one (h, w, c) float32 array."""
    if not channels or len({np.shape(plane) for plane in channels.values()}) != 1:
        raise ValueError(f"channels must be (h, w) arrays of one shape, not {[np.shape(p) for p in channels.values()]}")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(np.stack(list(channels.values()), axis=-1).astype(np.float32))


def _write(path: Path, spec: oiio.ImageSpec, pixels: NDArray[Any]) -> None:
    if not path.parent.is_dir():
        raise PenumbraError(f"{path}: cannot be written: there is no folder {path.parent}")
    with replacing(path) as temporary:
        target = oiio.ImageOutput.create(str(temporary))
        if target is None:
            raise PenumbraError(f"{path}: cannot be written: {_first_line(oiio.geterror())}")
        if not (target.open(str(temporary), spec) and target.write_image(pixels) and target.close()):
            raise PenumbraError(
                f"{path}: cannot be written: {_first_line(target.geterror()).replace(str(temporary), path.name)}"
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

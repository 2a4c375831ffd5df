"""PNG files: what is broken is found before libpng, which would write to the standard error stream, stumbles
over it.
"""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest

from scenes.errors import PenumbraError
from scenes.images import exr as images


def chunk(kind: bytes, data: bytes) -> bytes:
    return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")


def png(
    header: bytes = b"\0\0\0\x02\0\0\0\x03\x08\0\0\0\0", pixels: bytes = bytes(9), between: bytes = b""
) -> bytes:
    """2 x 3 gray pixels of 8 bits, unless said otherwise."""
    body = chunk(b"IHDR", header) + between + chunk(b"IDAT", zlib.compress(pixels))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def unended(pixels: bytes) -> bytes:
    """Compressed without the last block and the checksum."""
    packer = zlib.compressobj()
    return packer.compress(pixels) + packer.flush(zlib.Z_SYNC_FLUSH)


BROKEN = {
    "no width": png(header=b"\0\0\0\0\0\0\0\x03\x08\0\0\0\0"),
    "too wide": png(header=b"\0\x20\0\0\0\0\0\x03\x08\0\0\0\0"),
    "depth 3": png(header=b"\0\0\0\x02\0\0\0\x03\x03\0\0\0\0"),
    "no palette": png(header=b"\0\0\0\x02\0\0\0\x03\x08\x03\0\0\0"),
    "header's checksum": png()[:30] + b"\0" + png()[31:],
    "pixels' checksum": png()[:-14] + b"\0" + png()[-13:],
    "too few pixels": png(pixels=bytes(6)),
    "pixels that do not end": png().replace(
        chunk(b"IDAT", zlib.compress(bytes(9))), chunk(b"IDAT", unended(bytes(9)))
    ),
    "unknown filter": png(pixels=bytes([0, 1, 2, 9, 1, 2, 0, 0, 0])),
    "unknown chunk": png(between=chunk(b"NEWS", b"")),
    "no pixels": png()[:33],
    "half of it": png()[:50],
    "no end": png()[:-12],
}


@pytest.mark.parametrize("content", BROKEN.values(), ids=BROKEN.keys())
def test_a_broken_png_is_said_so_in_one_line_and_libpng_says_nothing(
    tmp_path: Path, content: bytes, capfd: pytest.CaptureFixture[str]
):
    (tmp_path / "x.png").write_bytes(content)
    with pytest.raises(
        PenumbraError, match=r"x\.png: (not a readable|corrupt or truncated) image: "
    ) as caught:
        images.read_texture(tmp_path / "x.png")
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_any_byte_of_a_png_may_be_wrong_without_a_word_of_libpng(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    rng, whole, path = (
        np.random.default_rng(5),
        png(pixels=bytes([1, 2, 3, 0, 7, 8, 4, 250, 9])),
        tmp_path / "x.png",
    )
    outcomes: set[bool] = set()
    for place in range(8, len(whole)):
        path.write_bytes(whole[:place] + bytes([rng.integers(256)]) + whole[place + 1 :])
        try:
            outcomes.add(images.read_texture(path).shape == (3, 2, 3))
        except PenumbraError:
            outcomes.add(False)
    assert outcomes == {False}
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("depth", [1, 2, 4, 8, 16])
def test_sound_pngs_are_read_also_interlaced_and_of_many_pieces(tmp_path: Path, depth: int):
    """Rows of every filter, six passes of a 5 x 3 image (the other is empty), and up to 5 MB that compress to
    next to nothing.
    """
    path, header = tmp_path / "x.png", b"\0\0\0\x05\0\0\0\x03" + bytes([depth, 0, 0, 0, 1])
    columns_and_rows = [
        (1, 1),
        (1, 1),
        (1, 1),
        (3, 1),
        (2, 2),
        (5, 1),
    ]  # of the passes that have any, of 5 x 3
    rows = [(columns * depth + 7) // 8 for columns, count in columns_and_rows for _ in range(count)]
    path.write_bytes(png(header, b"".join(bytes([i % 5]) + bytes(size) for i, size in enumerate(rows))))
    assert images.read_texture(path).shape == (3, 5, 3)
    wide = b"\0\0\x06\0\0\0\x06\0" + bytes([depth, 0, 0, 0, 0])
    path.write_bytes(png(wide, (b"\x02" + bytes(1536 * depth // 8)) * 1536))
    assert images.read_texture(path).max() == 0.0

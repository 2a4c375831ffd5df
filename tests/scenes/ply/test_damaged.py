"""PLY files that are cut off, lie or ask for too much: one line that says so, at once and in little
memory.
"""

from __future__ import annotations

import gzip
import struct
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from scenes.errors import PenumbraError
from scenes.ply import mesh as meshes
from scenes.ply import rows as ply_rows
from scenes.ply.header import PlyError
from scenes.ply.mesh import read_ply
from scenes.ply.text import PIECE, read_numbers
from tests.kit.ply_files import CORNERS, FORMATS, POINTS, ply_bytes, written

FACES = ("face", [CORNERS, "uchar i"], [((0, 1, 2), 1), ((0, 1, 2, 3), 2), ((2, 3, 4), 3)])
BINARY = ply_bytes("binary_little_endian", POINTS, FACES)
TEXT = ply_bytes("ascii", POINTS, FACES)
HEAD = BINARY[: BINARY.index(b"end_header")]
INTERNALS = ("variable", "('", "index out", "Error", "None", "array", "object")


def refused(path: Path, word: str) -> str:
    with pytest.raises(PenumbraError, match=word) as caught:
        read_ply(path)
    message = str(caught.value)
    assert repr(str(path)) in message
    assert message.replace(str(path), "").isprintable()
    assert not any(inside in message.replace(str(path), "") for inside in INTERNALS)
    assert len(message) < 400
    return message


@pytest.mark.parametrize("data", [BINARY, TEXT, ply_bytes("binary_big_endian", POINTS, FACES)])
def test_a_file_cut_off_anywhere_is_refused(tmp_path: Path, data: bytes) -> None:
    """Each of its prefixes, but for a text without the end of its last number or line, which nothing tells
    from a whole one.
    """
    for size in range(len(data) - (2 if data is TEXT else 0)):
        message = refused(written(tmp_path, data[:size]), "no PLY file|as its header says|no 'end_header'")
        assert "triangulate" not in message


@pytest.mark.parametrize("encoding", FORMATS)
def test_what_goes_on_behind_the_last_row_is_refused(tmp_path: Path, encoding: str) -> None:
    data = ply_bytes(encoding, POINTS, FACES)
    refused(written(tmp_path, data + b" 7\n"), "does not end where its header says")


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("corners", [0, 2, 5, 64])
def test_faces_of_other_corners_are_left_out_and_counted(tmp_path: Path, encoding: str, corners: int) -> None:
    rows = [((0, 1, 2),)] * 40 + [((0, 1, 2, 3),), ((0,) * corners,), ((0,) * corners,)]
    mesh = read_ply(written(tmp_path, ply_bytes(encoding, POINTS, ("face", [CORNERS], rows))))
    assert (len(mesh.triangles), len(mesh.quads), mesh.left_out) == (40, 1, 2)


@pytest.mark.parametrize("encoding", FORMATS)
def test_faces_of_too_many_corners_are_refused(tmp_path: Path, encoding: str) -> None:
    rows = [((0, 1, 2),)] * 40 + [((0,) * 65,)]
    refused(written(tmp_path, ply_bytes(encoding, POINTS, ("face", [CORNERS], rows))), "a face of 65 corners")


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        (
            b"binary_little_endian",
            b"binary_middle_endian",
            "its format must be one of ascii, binary_little_endian",
        ),
        (b"1.0", b"2.0", "its format"),
        (b"format", b"fromat", "its format"),
        (b"float x", b"what x", "its header has the line 'property what x'"),
        (b"float x", b"float", "the line 'property float'"),
        (b"float x", b"list float x", "the line"),
        (b"list uchar int", b"list float int", "the line"),
        (b"float x", b"float x\x1b[31m\x00", "no vertices"),
        (b"float x", b"list uchar float x", "no vertices|as its header says|has the length"),
        (b"element vertex 5\n", b"", "the line 'property float x'"),
        (b"element vertex 5", b"element vertex five", "the line 'element vertex five'"),
        (b"element vertex 5", b"element vertex -5", "the line"),
        (b"element vertex 5", b"element vertex " + b"9" * 5000, "the line"),
        (b"element vertex 5", b"element vertex", "the line"),
        (b"element face", b"element vertex", "has no faces|twice"),
        (b"element face", b"element vertex 1\nelement face", "'vertex' twice"),
        (b"element vertex 5", b"element vertex 0", "has no vertices"),
        (b"element face 3", b"element face 0", "has no faces"),
        (b"list uchar int", b"list uchar float", "a list of whole numbers"),
        (b"vertex_indices", b"vortex_indices", "has no faces"),
        (b"list uchar int", b"uchar", "has no faces"),
        (b"property list uchar int vertex_indices\nproperty uchar i\n", b"", "has no faces"),
        (b"element vertex 5", b"TextureFile a.png\nelement vertex 5", "the line 'TextureFile a.png'"),
        (b"end_header", b"comment " + b"x" * 70000 + b"\nend_header", "no 'end_header' in its first 64 KiB"),
    ],
)
def test_headers_that_are_none(tmp_path: Path, old: bytes, new: bytes, word: str) -> None:
    assert old in BINARY
    refused(written(tmp_path, BINARY.replace(old, new, 1)), word)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        (b"3 0 1 2 1", b"3.5 0 1 2 1", "a list in row 0 of 'face' has the length 3.5"),
        (b"3 0 1 2 1", b"-3 0 1 2 1", "has the length -3"),
        (b"3 0 1 2 1", b"nan 0 1 2 1", "has the length nan"),
        (b"3 0 1 2 1", b"inf 0 1 2 1", "has the length inf"),
        (b"3 0 1 2 1", b"1e300 0 1 2 1", "has the length 1e.300"),
        (
            b"3 0 1 2 1",
            b"3 0 1 1.5 1",
            "1.5 of the property 'vertex_indices' is none of its type's whole numbers",
        ),
        (b"3 0 1 2 1", b"3 0 1 1e10 1", "e.10 of the property"),
        (b"3 0 1 2 1", b"3 0 1-2 1", "line 16: '1-2' is no number"),
        (b"3 0 1 2 1", b"3 0 0x1 2 1", "line 16: '0x1' is no number"),
        (b"3 0 1 2 1", b"3 0 1 \x00 2 1", r"line 16: '\\x00' is no number"),
        (b"3 0 1 2 1", b"3 0 1 \xe9 2 1", "line 16: '\xe9' is no number"),
        (b"3 0 1 2 1", b"3 0 1 " + b"7" * 2 * PIECE, "is no number|of the property"),
        (b"0.25", b"1e39", "a vertex that is not finite"),
    ],
)
def test_text_that_is_not_what_the_header_declares(tmp_path: Path, old: bytes, new: bytes, word: str) -> None:
    assert old in TEXT
    refused(written(tmp_path, TEXT.replace(old, new, 1)), word)


def test_negative_lengths(tmp_path: Path) -> None:
    data = BINARY.replace(b"list uchar int", b"list char int")
    at = data.index(b"end_header\n") + 11 + 60
    refused(
        written(tmp_path, data[:at] + b"\xff" + data[at + 1 :]), "a list in row 0 of 'face' has the length -1"
    )


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("name", ["vertex", "face", "other"])
@pytest.mark.parametrize("count", [10**6, 6 * 10**7, 10**9, 10**18 - 1])
def test_counts_that_the_file_does_not_hold_are_refused_at_once(
    tmp_path: Path, encoding: str, name: str, count: int
) -> None:
    """A million rows would show as 8 MB a column; half a second is a hundred times what it takes."""
    other = ("other", ["list uchar int a", "double b"], [((1,), 2.0)])
    data = ply_bytes(encoding, POINTS, FACES, other)
    at = data.index(f"element {name} ".encode()) + len(f"element {name} ")
    path = written(tmp_path, gzip.compress(data[:at] + str(count).encode() + data[at + 1 :]), "m.ply.gz")
    refused(path, "as its header says|are read")
    tracemalloc.start()
    start = time.process_time()
    refused(path, "as its header says|are read")
    assert time.process_time() - start < 0.5
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4e6


def test_the_rest_of_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = written(tmp_path, gzip.compress(BINARY + bytes(2**26)), "m.ply.gz")
    tracemalloc.start()
    refused(path, "does not end where its header says")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4e6


def test_text_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes, "TEXT_LIMIT", 2000)
    read_ply(written(tmp_path, TEXT))
    refused(
        written(tmp_path, TEXT + b"\n" * 2000),
        "larger than the 0 MiB that are read of an ASCII PLY file; a binary",
    )
    refused(written(tmp_path, TEXT.replace(b"vertex 5", b"vertex 500")), "declares more than the 0 MiB")


def test_text_takes_no_more_than_its_numbers() -> None:
    """Words take 2 bytes, at least, and numbers 8; besides these there are a piece, its marks and its own
    numbers, which grow as they are found.
    """
    text = b"0 " * (4 * PIECE)
    tracemalloc.start()
    numbers = read_numbers(text, 0)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert numbers.nbytes == 8 * 4 * PIECE
    assert peak < numbers.nbytes + 12 * PIECE


def test_rows_that_change_too_often_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ply_rows, "STEP_LIMIT", 100)
    triangle, quad = struct.pack("<B3iB", 3, 0, 1, 2, 9), struct.pack("<B4iB", 4, 0, 1, 2, 3, 9)
    points = np.zeros((5, 3), "<f4").tobytes()
    head = HEAD.replace(b"face 3", b"face 400") + b"end_header\n"
    refused(
        written(tmp_path, head + points + (triangle + quad) * 200),
        "changes the size of its 'face' rows too often",
    )
    mesh = read_ply(written(tmp_path, head + points + triangle * 200 + quad * 200))
    assert (len(mesh.triangles), len(mesh.quads)) == (200, 200)


def test_spaces_without_an_end_are_no_numbers() -> None:
    numbers = read_numbers(b"1 2" + b" " * (3 * PIECE) + b"3\n", 0)
    assert np.frombuffer(numbers).tolist() == [1, 2, 3]


def test_a_word_without_an_end_is_no_number() -> None:
    for text in (b"7" * (2 * PIECE), b"1 " + b"x" * (2 * PIECE), b"1" * PIECE + b" 1-1"):
        with pytest.raises(PlyError, match="is no number"):
            read_numbers(text, 0)

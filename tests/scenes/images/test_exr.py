"""EXR and PNG in and out: what goes in comes out, and what is broken is said so with its path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.errors import PenumbraError
from scenes.files import replacing
from scenes.images import exr as images

AWKWARD = {
    "": "",
    "empty": "",
    "a key, with = signs / and spaces": 'line\nline\ttab "quotes" <tag/> {json} \\',
    "unicode": "λ 中文 \U0001f600 \x00 \x01 \ud800",
    "number": "12",
    "compression": "none",
    "long": "x" * 50_000,
    "k" * 400: "v",
}


def planes(names: list[str], shape: tuple[int, int] = (5, 7), seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {name: rng.normal(size=shape).astype(np.float32).astype(np.float64) for name in names}


def test_channels_come_back_by_name_whatever_their_order(tmp_path: Path):
    # An order that OpenImageIO changes: it puts R G B A first.
    given_planes = planes(["variance.R", "N", "B", "A", "G", "R", "a.long.layer.name"])
    images.write_exr(tmp_path / "x.exr", given_planes, {})
    read = images.read_exr(tmp_path / "x.exr")
    assert set(read.channels) == set(given_planes)
    for name, plane in given_planes.items():
        assert read.channels[name].dtype == np.float64
        np.testing.assert_array_equal(read.channels[name], plane)


def test_float32_is_kept_exactly_and_non_finite_values_survive(tmp_path: Path):
    values = np.array([[0.0, -0.0, np.inf, -np.inf], [np.nan, 1e-42, 3.4e38, 1 / 3]])
    images.write_exr(tmp_path / "x.exr", {"Y": values})
    np.testing.assert_array_equal(
        images.read_exr(tmp_path / "x.exr").channels["Y"], values.astype(np.float32)
    )


def test_what_exceeds_float32_becomes_infinite(tmp_path: Path):
    images.write_exr(tmp_path / "x.exr", {"Y": np.array([[1e39, -1e39]])})
    np.testing.assert_array_equal(images.read_exr(tmp_path / "x.exr").channels["Y"], [[np.inf, -np.inf]])


def test_awkward_metadata_round_trips(tmp_path: Path):
    images.write_exr(tmp_path / "x.exr", planes(["Y"]), AWKWARD)
    assert images.read_exr(tmp_path / "x.exr").metadata == AWKWARD


@settings(max_examples=30, deadline=None)
@given(metadata=st.dictionaries(st.text(), st.text(), max_size=5))
def test_any_metadata_round_trips(tmp_path_factory: pytest.TempPathFactory, metadata: dict[str, str]):
    path = tmp_path_factory.mktemp("exr") / "x.exr"
    images.write_exr(path, planes(["Y"]), metadata)
    assert images.read_exr(path).metadata == metadata


def test_a_foreign_file_gives_its_own_string_attributes(tmp_path: Path):
    spec = oiio.ImageSpec(2, 2, 1, "half")
    spec.channelnames = ("Y",)
    spec.attribute("Software", "another renderer")
    output = oiio.ImageOutput.create(str(tmp_path / "x.exr"))
    assert output is not None and output.open(str(tmp_path / "x.exr"), spec)
    assert output.write_image(np.ones((2, 2, 1), np.float32)) and output.close()
    read = images.read_exr(tmp_path / "x.exr")
    assert read.metadata["Software"] == "another renderer"
    np.testing.assert_array_equal(read.channels["Y"], np.ones((2, 2)))


def test_an_estimate_round_trips(tmp_path: Path):
    rng = np.random.default_rng(1)
    mean, variance = rng.random((2, 4, 6, 3)).astype(np.float32).astype(np.float64)
    count = rng.integers(1, 2**24, (4, 6))
    images.write_estimate_exr(tmp_path / "x.exr", mean, variance, count, {"spp": "9"})
    read = images.read_estimate_exr(tmp_path / "x.exr")
    np.testing.assert_array_equal(read.mean, mean)
    np.testing.assert_array_equal(read.variance, variance)
    np.testing.assert_array_equal(read.count, count)
    assert read.metadata == {"spp": "9"}
    np.testing.assert_array_equal(images.read_rgb(tmp_path / "x.exr"), mean)
    assert set(images.read_exr(tmp_path / "x.exr").channels) == {
        *"RGBN",
        "variance.R",
        "variance.G",
        "variance.B",
    }


def test_one_count_for_all_pixels(tmp_path: Path):
    images.write_estimate_exr(tmp_path / "x.exr", np.zeros((2, 3, 3)), np.zeros((2, 3, 3)), 4096)
    np.testing.assert_array_equal(images.read_estimate_exr(tmp_path / "x.exr").count, np.full((2, 3), 4096.0))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "not a readable"),
        (b"not an image at all", "not a readable"),
        (b"\x76\x2f\x31\x01 but then nothing", "not a readable"),
    ],
)
def test_what_is_no_exr_is_said_so(tmp_path: Path, content: bytes, says: str):
    path = tmp_path / "x.exr"
    path.write_bytes(content)
    with pytest.raises(PenumbraError, match=says) as caught:
        images.read_exr(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("keep", [0.3, 0.6, 0.99])
def test_a_truncated_file_is_said_so(tmp_path: Path, keep: float):
    path = tmp_path / "x.exr"
    images.write_exr(path, planes(["R", "G", "B"], (64, 64)), {})
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(PenumbraError, match="corrupt or truncated"):
        images.read_exr(path)


def test_a_flipped_byte_in_compressed_pixels_is_said_so(tmp_path: Path):
    # Pixels that zip does not shrink are stored as they are, without a checksum: the reference cache has its
    # own.
    path = tmp_path / "x.exr"
    smooth = np.add.outer(np.arange(64.0), np.arange(64.0))
    images.write_exr(path, {"R": smooth, "G": 2 * smooth}, {})
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(PenumbraError, match="corrupt or truncated"):
        images.read_exr(path)


def test_a_missing_file_and_a_png_are_said_so(tmp_path: Path):
    with pytest.raises(PenumbraError, match="no such image file"):
        images.read_exr(tmp_path / "none.exr")
    images.write_png(tmp_path / "x.png", np.zeros((2, 2, 3)))
    with pytest.raises(PenumbraError, match="an EXR image is wanted, this is png"):
        images.read_exr(tmp_path / "x.png")


def test_missing_channels_are_named_with_those_there_are(tmp_path: Path):
    images.write_exr(tmp_path / "x.exr", planes(["R", "Z"]), {})
    with pytest.raises(PenumbraError, match="no channel G, B; there are: R, Z"):
        images.read_rgb(tmp_path / "x.exr")


def test_a_folder_that_is_missing_or_cannot_be_written(tmp_path: Path):
    with pytest.raises(PenumbraError, match="there is no folder"):
        images.write_exr(tmp_path / "none" / "x.exr", planes(["Y"]))
    (tmp_path / "file").write_text("")
    with pytest.raises(PenumbraError, match="there is no folder"):
        images.write_exr(tmp_path / "file" / "x.exr", planes(["Y"]))
    unwritable = Path("/proc/self/x.exr")  # also for root
    if unwritable.parent.is_dir():
        with pytest.raises(PenumbraError, match="cannot be written") as caught:
            images.write_exr(unwritable, planes(["Y"]))
        assert str(unwritable) in str(caught.value)


def test_writing_is_atomic(tmp_path: Path):
    path = tmp_path / "x.exr"
    images.write_exr(path, {"Y": np.ones((2, 2))})

    def interrupted() -> None:
        with replacing(path) as temporary:
            temporary.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.exr"]
    np.testing.assert_array_equal(images.read_exr(path).channels["Y"], np.ones((2, 2)))


def test_channels_of_different_shape_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match="one shape"):
        images.write_exr(tmp_path / "x.exr", {"R": np.zeros((2, 2)), "G": np.zeros((2, 3))})
    with pytest.raises(ValueError, match="one shape"):
        images.write_exr(tmp_path / "x.exr", {})


def read_png(path: Path) -> np.ndarray:
    source = oiio.ImageInput.open(str(path))
    assert source is not None
    return np.asarray(source.read_image("uint8"))


def test_png_is_srgb_clipped_with_exposure_and_marks_nan(tmp_path: Path):
    # IEC 61966-2-1 by hand: 12.92 x below 0.0031308, else 1.055 x^(1/2.4) - 0.055.
    rgb = np.array([[[0.002, 0.25, 1.0], [-1.0, 2.0, np.inf], [np.nan, 0.5, 0.5]]])
    images.write_png(tmp_path / "x.png", rgb)
    want = [round(255 * 12.92 * 0.002), round(255 * (1.055 * 0.25 ** (1 / 2.4) - 0.055)), 255]
    np.testing.assert_array_equal(read_png(tmp_path / "x.png"), [[want, [0, 255, 255], [255, 0, 255]]])
    images.write_png(tmp_path / "brighter.png", rgb[:, :1] / 8, exposure=3.0)
    np.testing.assert_array_equal(read_png(tmp_path / "brighter.png"), [[want]])

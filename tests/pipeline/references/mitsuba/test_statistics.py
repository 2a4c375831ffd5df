"""Is the variance of the mean what it says, are batches independent, and what happens when the worker
fails.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pipeline.references.accumulator import Accumulator
from pipeline.references.backends import mitsuba
from pipeline.references.backends.mitsuba import MitsubaBackend, Probe
from pipeline.references.mitsuba import process as mitsuba_process
from pipeline.references.mitsuba.seeds import seeds_for
from pipeline.references.protocol import BACKENDS, Continuation, ReferenceImage, ReferenceRequest
from scenes.description.scene import Film, SceneDescription
from scenes.errors import PenumbraError
from tests.kit.mitsuba_scenes import floor, look_at, rectangle, scene, shape, vector

WIDTH, HEIGHT = 72, 50  # not multiples of the blocks in which the scalar variant counts its seeds


def lit_floor(width: int = WIDTH, height: int = HEIGHT) -> SceneDescription:
    light = shape(rectangle(vector(0, 2, 0), vector(1, 0, 0), vector(0, 0, 1)), 0.0, (1, 1, 1))
    camera = look_at(vector(0, 1.5, -3), vector(0, 0, 0), vector(0, 1, 0))
    return scene([floor(half=20.0), light], camera, 40.0, width, height)


def work_with(monkeypatch: pytest.MonkeyPatch, variant: str) -> None:
    monkeypatch.setattr(mitsuba, "working_variant", lambda: variant)


@pytest.fixture(scope="module", params=mitsuba.VARIANTS)
def runs(request: pytest.FixtureRequest) -> list[ReferenceImage]:
    with pytest.MonkeyPatch.context() as patch:
        work_with(patch, request.param)
        return [MitsubaBackend().render(lit_floor(), ReferenceRequest(256, 64, seed)) for seed in (0, 1)]


@pytest.mark.usefixtures("mitsuba")
def test_the_variance_of_the_mean_is_right(runs: list[ReferenceImage]):
    """Chi-square of the difference of two runs. With 3,600 pixels its mean is known to 2.4 %: 10 % in the
    variance is caught.

    The expectation is that of Student's t with 126 degrees of freedom, 126 / 124, and not 1. This has found
    one: evenly spaced seeds in the scalar variant gave 0.84 to 0.90.
    """
    a, b = runs
    z2 = ((a.mean - b.mean) ** 2 / (a.variance + b.variance))[..., 0]
    assert np.all(a.variance > 0) and a.spp == 256 and a.batches == 64
    assert abs(z2.mean() - 126 / 124) < 4 * np.sqrt(2 * 1.05 / z2.size)


@pytest.mark.usefixtures("mitsuba")
def test_two_runs_share_nothing(runs: list[ReferenceImage]):
    """Repeated or shared batches would make the runs agree better than their variances allow, at the same
    pixel: caught above.
    Here the image mean, which streams shared between pixels would widen: one draw of a standard normal.
    """
    a, b = runs
    error = np.sqrt((a.variance + b.variance)[..., 0].sum()) / a.mean[..., 0].size
    assert 0 < abs((a.mean - b.mean)[..., 0].mean()) < 4 * error


@pytest.mark.parametrize("size", [(33, 33), (32, 32), (1, 100), (160, 120), (72, 50), (7, 5)])
def test_calls_share_no_stream(size: tuple[int, int]):
    """Measured in the scalar variant: at 33 x 33, the images of seeds s and s + 1 share 57 pixels' random
    numbers, s and s + 2 two.

    There pixel i of block k of a call takes stream seed * width * height + 1024 k + i, modulo 2^32.
    """
    width, height = size
    film = Film(width, height)
    scalar, llvm = (seeds_for(5, film, variant, 0, 128) for variant in ("scalar_rgb", "llvm_ad_rgb"))
    first = np.sort(np.array(scalar, dtype=object) * (width * height))
    apart = np.diff(np.append(first, first[0] + 2**32))
    assert len(first) == 128 and apart.min() >= 1024 * (-(-width // 32)) * (-(-height // 32))
    assert len(set(llvm)) == 128 and min(llvm) >= 0 and max(llvm) < 2**32
    assert set(llvm).isdisjoint(seeds_for(6, film, "llvm_ad_rgb", 0, 128))
    for variant, seeds in (("scalar_rgb", scalar), ("llvm_ad_rgb", llvm)):
        later = seeds_for(5, film, variant, 100, 28)
        assert later == seeds[100:], "what is added later is what would have come next"


def test_no_seed_of_a_long_series_comes_twice():
    """All 65,536 of 214,748 slots: drawn with replacement, thousands would."""
    assert len(set(seeds_for(5, Film(100, 100), "scalar_rgb", 0, 65_536))) == 65_536


def test_an_image_with_more_pixels_than_streams_is_an_error():
    with pytest.raises(PenumbraError, match="too many for 64 calls"):
        seeds_for(0, Film(10_000, 10_000), "scalar_rgb", 0, 64)
    with pytest.raises(PenumbraError, match="at most 65536"):
        seeds_for(0, Film(8, 8), "llvm_ad_rgb", 65_530, 7)


def test_no_call_is_too_large():
    assert mitsuba.most_spp(Film(8, 8), "llvm_ad_rgb") == mitsuba.most_spp(Film(8, 8), "scalar_rgb") == 10_000
    assert mitsuba.most_spp(Film(1024, 1024), "llvm_ad_rgb") == 16
    assert mitsuba.most_spp(Film(8192, 8192), "llvm_ad_rgb") == 1


@pytest.mark.usefixtures("mitsuba")
def test_interrupted_and_gone_on_with_it_comes_out_the_same():
    """To the last bit, and the worker of the interrupted call is gone."""
    request, kept = ReferenceRequest(64, 8), list[Accumulator]()

    def keep(accumulator: Accumulator) -> None:
        kept.append(accumulator)
        if accumulator.batches == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        MitsubaBackend().render(lit_floor(), request, None, Continuation(None, keep))
    again = MitsubaBackend().render(lit_floor(), request, None, Continuation(kept[-1]))
    whole = MitsubaBackend().render(lit_floor(), request)
    np.testing.assert_array_equal(again.mean, whole.mean)
    np.testing.assert_array_equal(again.variance, whole.variance)
    assert (again.spp, again.batches) == (64, 8)


@pytest.mark.usefixtures("mitsuba")
def test_an_interrupted_call_ends_its_worker(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """One that would go on for a minute."""
    script = (
        f"import time; open({str(tmp_path / 'began')!r}, 'w').close(); print('penumbra-lift 1', "
        "flush=True); time.sleep(60)"
    )
    monkeypatch.setattr(mitsuba_process, "command", lambda _folder: [sys.executable, "-c", script])
    work_with(monkeypatch, "llvm_ad_rgb")
    start = time.monotonic()
    with pytest.raises(PenumbraError, match="1 pixels off the surfaces in view"):
        MitsubaBackend().render(lit_floor(), ReferenceRequest(2, 2))
    assert (tmp_path / "began").exists() and time.monotonic() - start < 30


@pytest.mark.usefixtures("mitsuba")
def test_one_batch_is_refused():
    with pytest.raises(PenumbraError, match="at least 2 batches"):
        MitsubaBackend().render(lit_floor(), ReferenceRequest(16, 1))


@pytest.mark.usefixtures("mitsuba")
def test_progress_rises_to_one_and_the_version_names_what_ran():
    shares: list[float] = []
    image = MitsubaBackend().render(lit_floor(8, 8), ReferenceRequest(8, 4), shares.append)
    assert shares == [0.25, 0.5, 0.75, 1.0]
    assert BACKENDS["mitsuba"].name == "mitsuba"
    assert image.provenance["version"] == BACKENDS["mitsuba"].version()
    assert image.provenance["variant"] in mitsuba.VARIANTS
    assert image.seconds > 0


@pytest.mark.usefixtures("mitsuba")
def test_a_worker_that_dies_is_one_clear_error(monkeypatch: pytest.MonkeyPatch):
    script = "import os, sys; print('LLVM ERROR: Cannot select', file=sys.stderr, flush=True); os.abort()"
    monkeypatch.setattr(mitsuba_process, "command", lambda _folder: [sys.executable, "-c", script])
    work_with(monkeypatch, "llvm_ad_rgb")
    with pytest.raises(PenumbraError, match=r"failed with code -6: LLVM ERROR: Cannot select") as caught:
        MitsubaBackend().render(lit_floor(), ReferenceRequest(2, 2))
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("mitsuba")
def test_without_llvm_the_scalar_variant_is_taken(monkeypatch: pytest.MonkeyPatch):
    """A path where no LLVM is: found out by trying, in a process of its own."""
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    mitsuba._probe.cache_clear()  # pyright: ignore[reportPrivateUsage]
    try:
        llvm, scalar = mitsuba.probe_variants()
        assert (llvm.ok, scalar.ok) == (False, True) and llvm.detail
        assert mitsuba.working_variant() == "scalar_rgb"
    finally:
        mitsuba._probe.cache_clear()  # pyright: ignore[reportPrivateUsage]


@pytest.mark.usefixtures("mitsuba")
def test_here_the_wheels_llvm_works():
    """The dependency that brings LLVM does what it is there for; a silent fall to the slow variant is a
    failure here.
    """
    llvm = mitsuba_process.llvm_library()
    assert llvm is not None and "libLLVM" in llvm
    assert isinstance(mitsuba.probe_variants()[0], Probe) and mitsuba.working_variant() == "llvm_ad_rgb"


@pytest.mark.usefixtures("mitsuba")
def test_mitsuba_stays_out_of_this_process(runs: list[ReferenceImage]):
    """Its variant is global to a process and a wrong LLVM aborts it."""
    assert runs and "mitsuba" not in sys.modules

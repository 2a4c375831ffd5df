"""The verdict on a whole image: area sampling near contact is caught, bounded sampling is not, and neither is
a bright spot.

The scene is simulated here: a unit rectangle stands upright at height `gap` over a floor, seen pixel by
pixel. Area weights are z r / d^4: pooled over floor and light, P(W > w) ~ w^-1.5 up to 1 / gap^2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.schema.record import SampleStatistics
from pipeline.statistics.samples import image_noise, sample_statistics, spike_share

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Weights = Callable[[Array, Array, float, Array], Array]
GAPS = [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5]


def area(x: Array, y: Array, gap: float, u: Array) -> Array:
    """Contribution of a uniform point of the light: cos cos' / d^2, light of unit area."""
    across, up = u[0] - 0.5 - y, gap + u[1]
    return up * x / (x**2 + across**2 + up**2) ** 2


def solid_angle(x: Array, y: Array, gap: float, u: Array) -> Array:
    """Contribution of a uniform direction to the light: solid angle times cos, by the spherical rectangle
    [urena2013].
    """
    x0, x1, y0, y1, z0 = -0.5 - y, 0.5 - y, np.full_like(x, gap), np.full_like(x, gap + 1), -x
    corners = [np.stack(v) for v in ((x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0))]
    normals = [np.cross(a, b, axis=0) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    normals = [n / np.linalg.norm(n, axis=0) for n in normals]
    pairs = zip(normals, normals[1:] + normals[:1], strict=True)
    angles = [np.arccos(np.clip(-np.sum(a * b, axis=0), -1, 1)) for a, b in pairs]
    b0, b1, k = normals[0][2], normals[2][2], 2 * np.pi - angles[2] - angles[3]
    omega = angles[0] + angles[1] - k
    au = u[0] * omega + k
    fu = (np.cos(au) * b0 - b1) / np.sin(au)
    cu = np.clip(np.copysign(1.0, fu) / np.sqrt(fu**2 + b0**2), -1, 1)
    xu = np.clip(-cu * z0 / np.sqrt(np.maximum(1 - cu**2, 1e-300)), x0, x1)
    d2 = xu**2 + z0**2
    h0, h1 = y0 / np.sqrt(d2 + y0**2), y1 / np.sqrt(d2 + y1**2)
    hv = h0 + u[1] * (h1 - h0)
    return omega * hv  # hv = y / distance, the cosine at the floor


def render(weights: Weights, gap: float, spp: int, seed: int = 1, width: int = 64, height: int = 48) -> Array:
    """Samples (spp, height, width) over a floor of 2 x 2."""
    rng = np.random.default_rng(seed)
    i, j = np.meshgrid(np.arange(width), np.arange(height))
    x = ((i + rng.random((spp, height, width))) / width * 2).ravel()
    y = ((j + rng.random((spp, height, width))) / height * 2 - 1).ravel()
    return weights(x, y, gap, rng.random((2, x.size))).reshape(spp, height, width)


def summed_up(samples: Array, with_maximum: bool = True) -> SampleStatistics:
    """What the film and the result keep of gray samples (spp, h, w), and the statistics of that."""
    spp = samples.shape[0]
    mean = samples.mean(axis=0)
    color = [
        np.repeat(a[..., None], 3, axis=-1)
        for a in (mean, ((samples - mean) ** 2).sum(axis=0), samples.max(axis=0))
    ]
    return sample_statistics(
        mean=color[0],
        m2=color[1],
        count=np.full(mean.shape, spp, dtype=np.int64),
        tail=np.sort(samples.ravel())[::-1][:4096],
        reflected=samples.size,
        reflected_sum=float(samples.sum()),
        nonfinite=0,
        maximum=color[2] if with_maximum else None,
    )


@pytest.mark.parametrize("spp", [4, 16, 64])
@pytest.mark.parametrize("gap", GAPS)
def test_solid_angle_sampling_is_trusted_at_every_gap(gap: float, spp: int) -> None:
    """Bounded weights. Catches an index whose k reaches into the body of the distribution."""
    assert summed_up(render(solid_angle, gap, spp)).verdict == "ok"


@pytest.mark.parametrize("spp", [4, 16, 64])
@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-5])
def test_area_sampling_near_contact_is_not(gap: float, spp: int) -> None:
    """The largest of all samples carries 1 to 3 % here: catches a verdict from the share alone.

    The index is that of theory.
    """
    found = summed_up(render(area, gap, spp))
    assert found.verdict == "untrustworthy"
    assert found.max_share < 0.1
    assert found.hill == pytest.approx(1.5, abs=0.35)
    assert "the tail index of the" in found.reason and "below 2" in found.reason


@pytest.mark.parametrize("spp", [4, 16, 64])
def test_area_sampling_at_a_distance_is_trusted(spp: int) -> None:
    assert summed_up(render(area, 1.0, spp)).verdict == "ok"


def small_light_close_to_the_floor(spp: int) -> Array:
    """Perfectly sampled, 20 % noise: irradiance h^2 / (r^2 + h^2)^2 has the tail r^-4 over pixels, index
    1/2.
    """
    rng, h = np.random.default_rng(2), 0.02
    i, j = np.meshgrid(np.linspace(-1, 1, 96), np.linspace(-1, 1, 96))
    return h**2 / (i**2 + j**2 + h**2) ** 2 * rng.uniform(0.8, 1.2, (spp, 96, 96))


def test_the_image_s_own_range_is_not_taken_for_noise() -> None:
    """Catches the pooled index alone, which calls this image untrustworthy although every pixel knows its
    value to 3 %.
    """
    samples = small_light_close_to_the_floor(16)
    found = summed_up(samples)
    assert found.hill is not None and found.hill < 2
    assert found.verdict == "ok" and "the image's own range" in found.reason
    assert summed_up(samples, with_maximum=False).verdict == "untrustworthy"


def test_below_16_samples_a_pixel_the_doubt_stays() -> None:
    """A few samples cannot tell the image's range from noise."""
    assert summed_up(small_light_close_to_the_floor(4)).verdict == "untrustworthy"


def test_a_penumbra_is_no_heavy_tail() -> None:
    """One lit sample of 64 in a pixel is what a penumbra looks like.

    Catches the largest share taken pixel by pixel (1.0 here).
    """
    rng = np.random.default_rng(3)
    lit = np.clip(np.linspace(-0.2, 1.2, 128), 0, 1)
    samples = np.where(rng.random((64, 48, 128)) < lit, rng.uniform(0.5, 1.0, (64, 48, 128)), 0.0)
    found = summed_up(samples)
    assert found.verdict == "ok"
    assert found.max_share < 1e-4


def test_spike_share_of_known_cases() -> None:
    """3/n for uniform samples, 1 where one sample of each pixel is all its light; a light in view does not
    hide it.
    """
    rng = np.random.default_rng(4)
    uniform = rng.random((64, 40, 40, 3))
    ones = np.zeros((64, 40, 40, 3))
    ones[5] = 100.0
    for samples, expected in ((uniform, 3 / 64), (ones, 63 / 64)):
        mean, m2 = samples.mean(axis=0), ((samples - samples.mean(axis=0)) ** 2).sum(axis=0)
        share = spike_share(mean, m2, np.full((40, 40), 64), samples.max(axis=0))
        assert share == pytest.approx(expected, rel=0.08)
    mean[:5], m2[:5] = 1e4, 1e12  # pixels that see a light's edge: their mean exceeds any reflected sample
    assert spike_share(mean, m2, np.full((40, 40), 64), ones.max(axis=0)) == pytest.approx(63 / 64)
    assert spike_share(mean, m2, np.full((40, 40), 15), ones.max(axis=0)) is None


def test_noise_is_the_root_mean_square_of_the_standard_errors() -> None:
    m2 = np.full((4, 5, 3), 12.0)
    m2[0] = 0.0
    assert image_noise(m2, np.full((4, 5), 4)) == pytest.approx(np.sqrt(0.75))
    assert np.isnan(image_noise(m2, np.full((4, 5), 1)))


def test_non_finite_samples_make_it_untrustworthy_and_the_record_survives_json() -> None:
    samples = render(solid_angle, 0.1, 4)
    kept = summed_up(samples)
    bad = sample_statistics(
        mean=np.full((2, 2, 3), np.nan),
        m2=np.full((2, 2, 3), np.nan),
        count=np.full((2, 2), 16),
        tail=np.array([np.inf, 1.0]),
        reflected=64,
        reflected_sum=float("nan"),
        nonfinite=3,
        maximum=np.full((2, 2, 3), np.nan),
    )
    assert bad.verdict == "untrustworthy" and "3 samples are not finite" in bad.reason
    for one in (kept, bad):
        again = SampleStatistics.model_validate_json(one.model_dump_json())
        assert again.verdict == one.verdict and again.hill == one.hill

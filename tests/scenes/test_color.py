"""Spectra as linear sRGB, against integrals of our own, published colours, and the Fresnel equations in
complex numbers.
"""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest
from scipy import constants

from scenes import color as colours
from scenes.errors import PenumbraError

# IEC 61966-2-1, linear sRGB to XYZ, to the four digits of the standard.
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
NM = np.arange(360.0, 831.0)
ANGLES = np.radians(np.arange(0.0, 90.0, 5.0))


def observer() -> np.ndarray:
    """(471, 3): the CIE 1931 tables, which are all that these tests share with the module."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    return np.asarray(
        colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
        .align(colour.SpectralShape(360, 830, 1))
        .values
    )


def d65() -> np.ndarray:
    import colour

    spectrum = colour.SDS_ILLUMINANTS["D65"]
    return np.interp(NM, spectrum.wavelengths, spectrum.values)


def chromaticity(rgb: np.ndarray) -> np.ndarray:
    xyz = TO_XYZ @ rgb
    return xyz[:2] / xyz.sum()


def planck(kelvin: float) -> np.ndarray:
    metre = NM * 1e-9
    return metre**-5 / np.expm1(constants.h * constants.c / (metre * constants.k * kelvin))


def listed(wavelengths: list[float], values: list[float], role: colours.Role) -> np.ndarray:
    return colours.sampled(np.array(wavelengths, dtype=float), np.array(values, dtype=float), role)


def fresnel(cosine: np.ndarray, eta: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Unpolarised reflectance from Snell's law and the amplitude coefficients, in complex numbers
    throughout.
    """
    index = eta + 1j * k
    inner = np.sqrt(1 - (1 - cosine**2) / index**2)
    p = (index * cosine - inner) / (index * cosine + inner)
    s = (cosine - index * inner) / (cosine + index * inner)
    return (np.abs(p) ** 2 + np.abs(s) ** 2) / 2


@pytest.mark.parametrize("kelvin", [2000.0, 2856.0, 4000.0, 6500.0, 15000.0])
def test_a_black_body_has_its_chromaticity_and_luminance_one(kelvin):
    """Catches a wrong Planck constant, a wrong white point, a norm by the maximum: 2e-4 in x, y is a tenth of
    a step of sight.
    """
    rgb = colours.blackbody(kelvin)
    xyz = observer().T @ planck(kelvin)
    np.testing.assert_allclose(chromaticity(rgb), xyz[:2] / xyz.sum(), atol=2e-4)
    assert (TO_XYZ @ rgb)[1] == pytest.approx(1.0, abs=2e-4)


def test_black_bodies_stand_where_the_planckian_locus_is_published():
    """x, y of 6500 K and of illuminant A, to the digits of the tables; CIE defines A as 2848 K with c2 =
    1.435e-2, today's 2855.5 K.
    """
    np.testing.assert_allclose(chromaticity(colours.blackbody(6500.0)), [0.3135, 0.3237], atol=2e-4)
    np.testing.assert_allclose(
        chromaticity(colours.named("stdillum-A", "illuminant")), [0.44757, 0.40745], atol=2e-4
    )
    np.testing.assert_allclose(
        colours.blackbody(2855.5), colours.named("stdillum-A", "illuminant"), atol=1e-3
    )


def test_colours_outside_srgb_lose_their_negative_part_only():
    assert colours.blackbody(1500.0)[2] == 0.0
    assert (colours.blackbody(100.0) >= 0).all() and np.isfinite(colours.blackbody(1e9)).all()


@pytest.mark.parametrize("kelvin", [0.0, -5.0, 99.0, float("nan"), float("inf")])
def test_temperatures_that_planck_cannot_serve_are_errors(kelvin):
    with pytest.raises(PenumbraError, match="allowed: 100 to 1e"):
        colours.blackbody(kelvin)


def test_d65_is_white():
    np.testing.assert_allclose(colours.named("stdillum-D65", "illuminant"), 1.0, atol=1e-3)
    np.testing.assert_allclose(colours.sampled(NM, d65(), "illuminant"), 1.0, atol=1e-3)


@pytest.mark.parametrize("name", colours.ILLUMINANTS)
def test_every_illuminant_has_luminance_one(name):
    assert (TO_XYZ @ colours.named(name, "illuminant"))[1] == pytest.approx(1.0, abs=3e-4)


@pytest.mark.parametrize(
    ("name", "xy"),
    [("stdillum-D50", (0.34567, 0.35850)), ("stdillum-F2", (0.37208, 0.37529)), ("stdillum-F11", (0.38052, 0.37713)),  # noqa: E501
     ("illum-acesD60", (0.32168, 0.33767))],
)  # fmt: skip
def test_illuminants_have_their_published_chromaticities(name, xy):
    """CIE 15's and ACES's x, y. Catches names that are mixed up; sampling and end values are worth 2e-4."""
    np.testing.assert_allclose(chromaticity(colours.named(name, "illuminant")), xy, atol=3e-4)


def test_a_light_is_as_bright_whatever_the_norm_of_its_spectrum():
    values = planck(4000.0)
    light = colours.sampled(NM, values, "illuminant")
    np.testing.assert_allclose(colours.sampled(NM, 1e-30 * values, "illuminant"), light, rtol=1e-12)
    np.testing.assert_allclose(light, colours.blackbody(4000.0), rtol=1e-6)


def test_reflectances_are_seen_under_d65():
    """Catches a missing illuminant (an equal-energy white would be pink) and a bound that is not kept."""
    np.testing.assert_allclose(listed([300, 900], [0.5, 0.5], "reflectance"), 0.5, rtol=1e-12)
    np.testing.assert_allclose(listed([300, 900], [7.0, 7.0], "unbounded"), 7.0, rtol=1e-12)
    step = np.where(NM >= 580, 0.8, 0.1)
    xyz = observer().T @ (step * d65()) / (observer()[:, 1] @ d65())
    seen = np.linalg.inv(TO_XYZ) @ xyz
    assert (seen > 0).all()
    np.testing.assert_allclose(colours.sampled(NM, step, "reflectance"), seen, atol=1e-3)
    assert listed([600, 601, 700, 701], [0, 1, 1, 0], "reflectance").min() == 0.0
    assert listed([579, 580, 700, 701], [0, 1, 1, 0], "reflectance").max() == 1.0


def test_a_listed_spectrum_is_zero_outside_its_list_and_linear_inside():
    half = listed([400, 600], [1.0, 1.0], "unbounded")
    np.testing.assert_allclose(
        half, listed([300, 399.999, 400, 600, 600.001, 900], [0, 0, 1, 1, 0, 0], "unbounded")
    )
    np.testing.assert_allclose(
        listed([300, 900], [0.0, 6.0], "unbounded"), colours.sampled(NM, (NM - 300) / 100, "unbounded")
    )


@pytest.mark.parametrize(
    ("wavelengths", "values"),
    [([500], [1]), ([], []), ([500, 400], [1, 1]), ([400, 400], [1, 1]), ([400, 500], [1, -1]),
     ([400, 500], [1, float("nan")]), ([400, 500], [1, 1, 1])],
)  # fmt: skip
def test_wrong_lists_are_errors(wavelengths, values):
    with pytest.raises(PenumbraError, match="a spectrum"):
        listed(wavelengths, values, "unbounded")


def test_a_light_without_visible_light_is_an_error():
    for wavelengths, values in (([900, 1000], [1, 1]), ([400, 500], [0, 0])):
        with pytest.raises(PenumbraError, match="nothing between 360 and 830 nm"):
            listed(wavelengths, values, "illuminant")


def test_unknown_names_are_errors_that_list_what_there_is():
    with pytest.raises(
        PenumbraError, match=r"unknown spectrum 'glass-SF11'; there are stdillum-A, .*metal-TiO2-eta and -k"
    ):
        colours.named("glass-SF11", "unbounded")
    with pytest.raises(PenumbraError, match="unknown metal 'Cu'; there are metal-Ag, "):
        colours.metal("Cu")


@pytest.mark.parametrize(
    ("name", "published"),
    [("metal-Ag", (0.972, 0.960, 0.915)), ("metal-Al", (0.913, 0.922, 0.924)), ("metal-Au", (1.0, 0.782, 0.344)),  # noqa: E501
     ("metal-Cu", (0.955, 0.638, 0.538)), ("metal-CuZn", (0.910, 0.778, 0.423))],
)  # fmt: skip
def test_metals_have_their_published_colours(name, published):
    """F0 in linear sRGB as printed to three digits [akenine2018, table 9.2], gold's red of 1.022 cut to 1.

    0.001 is the printed digit; another illuminant or another table of Cu (Palik's) differs by 0.01.
    """
    eta, k = colours.metal(name)
    np.testing.assert_allclose(fresnel(np.ones(3), eta, k), published, atol=1e-3)


ERRORS = {"Ag": 4e-4, "Al": 1e-3, "Au": 0.0225, "Cu": 0.011, "CuZn": 0.005, "MgO": 1e-4, "TiO2": 1e-4}


@pytest.mark.parametrize("name", ERRORS)
def test_metals_keep_their_look_at_all_angles(name):
    """Against the spectral Fresnel reflectance under D65 at 0 to 85 degrees; the bounds are what `metal`
    states, rounded up.

    eta as a mean with positive weights, the obvious choice, fails for Al, Cu and CuZn (0.013, 0.035, 0.009).
    """
    table = colours._metals()[f"metal-{name}"]
    eta, k = (np.interp(NM, table[0], row) for row in table[1:])
    matching = observer().T * d65()
    spectral = np.stack([fresnel(np.cos(a), eta, k) for a in ANGLES])
    seen = np.linalg.inv(TO_XYZ) @ (matching @ spectral.T) / matching[1].sum()
    ours = np.stack([fresnel(np.cos(a), *colours.metal(f"metal-{name}")) for a in ANGLES], axis=1)
    # The standard's four digits of the matrix are worth up to 2e-4.
    assert np.abs(ours - seen).max() < ERRORS[name] + 2e-4
    if name == "Au":
        assert np.abs(ours - seen)[1:].max() < 2e-3


def test_the_table_has_the_metals_that_are_named():
    lines = [line for line in colours._TABLE.read_text().splitlines() if not line.startswith("#")]
    assert {f"metal-{line.split(',')[0]}" for line in lines[1:]} == set(colours.METALS)


def test_conductors_of_a_reflectance_have_it():
    r = np.array([0.0, 0.5, 0.9999])
    eta, k = colours.conductor_of_reflectance(r)
    np.testing.assert_allclose(fresnel(np.ones(3), eta, k), r, atol=1e-12)
    np.testing.assert_array_equal(
        colours.conductor_of_reflectance(np.full(3, 1.0))[1], 2 * np.sqrt(0.9999 / (1 - 0.9999))
    )


def test_plain_scenes_do_not_pay_for_colour_science(processes):
    """It takes 0.7 s to import: more than a small scene takes to render."""
    script = "import sys, scenes.color; print('colour' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

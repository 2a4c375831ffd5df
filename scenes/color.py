"""Spectra of a scene file as linear sRGB, and metals as three complex refractive indices: what pbrt-v4's own
image would show.

pbrt renders spectra, we render RGB. What follows is read off its source: `SpectrumToPhotometric`,
`SpectrumToXYZ` and `FromInterleaved` in util/spectrum.cpp, `Create` of every light in lights.cpp,
`PixelSensor` and `RGBFilm` in film.h/.cpp.

- A spectrum is summed at whole nanometres from 360 to 830. A named one continues with its end values to both
sides,
  one listed in the file (or read from a file of its own) is 0 outside its list.
- A light's `scale` is divided by the luminance integral of ybar(l) L(l) of its spectrum (of the D65 that pbrt
multiplies an
  `rgb` with; K_m, 683 lm/W, is left out in both places), so neither a black body's temperature nor the norm
  of a listed spectrum makes a light brighter. The default sensor, "cie1931", has the responses xbar, ybar,
  zbar and an imaging ratio of 1 (exposure 1 s, ISO 100) without white balance. So a camera that looks at the
  light reads

      Y = scale,   (X, Z) = scale (integral of xbar L, integral of zbar L) / (integral of ybar L),

  and the film's pixel is M^-1 (X, Y, Z): M^-1 takes XYZ to linear sRGB, its white point being that of D65's
  own integral. An `rgb` light reads its three numbers, D65 reads (1, 1, 1).
- A reflectance R reads, under a light of D65 that alone would read 1: M^-1 (integral of (xbar, ybar, zbar) R
D65) / (integral of ybar D65).

sRGB does not hold every colour: a component that comes out negative (blue below some 1,900 K) is 0 here.
pbrt's film would keep the negative number.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scenes.errors import PenumbraError

Array = NDArray[np.float64]
# absolute: a light's colour as pbrt makes RGB of a spectrum, its luminance the spectrum's mean under ybar.
Role = Literal["illuminant", "absolute", "reflectance", "unbounded"]

METALS = ("metal-Ag", "metal-Al", "metal-Au", "metal-Cu", "metal-CuZn", "metal-MgO", "metal-TiO2")
# pbrt's names and colour-science's. ACES's D60 is the daylight series at 6000 K, as CIE's D60 is.
ILLUMINANTS = {
    **{f"stdillum-{name}": name for name in ("A", "D50", "D65")},
    **{f"stdillum-F{i}": f"FL{i}" for i in range(1, 13)},
    "illum-acesD60": "D60",
}
# CIE xy of red, green and blue: IEC 61966-2-1, ITU-R BT.2020, pbrt's P3, whose white is D65 too, and SMPTE
# ST 2065-1.
PRIMARIES = {
    "srgb": ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06)),
    "rec2020": ((0.708, 0.292), (0.17, 0.797), (0.131, 0.046)),
    "dci-p3": ((0.68, 0.32), (0.265, 0.69), (0.15, 0.06)),
    "aces2065-1": ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.077)),
}
WHITES = {"aces2065-1": "D60"}  # of those whose white is not D65
# pbrt's glasses by their index at 587.6 nm, as Schott's catalogue has it; F5, F10 and F11 are Schott's SF5,
# SF10 and SF11.
GLASSES = {
    "glass-BK7": 1.5168, "glass-BAF10": 1.67003, "glass-FK51A": 1.48656, "glass-LASF9": 1.85025,
    "glass-F5": 1.67271, "glass-F10": 1.72825, "glass-F11": 1.78472,
}  # fmt: skip
PEAK = 2.8977721e-3  # Wien's constant in m K, as pbrt has it
OPAQUE = 0.9999  # pbrt's greatest reflectance of a conductor
SECOND_RADIATION = (
    1.438776877e-2  # h c / k in m K, CODATA 2018; colour-science's own is rounded to five digits
)
COLDEST, HOTTEST = 100.0, 1e9  # K; far beyond either, double precision does not hold Planck's law at 360 nm
_FIRST, _LAST = 360.0, 830.0
_TABLE = Path(__file__).parent / "data" / "metals.csv"


def blackbody(kelvin: float, role: Role = "illuminant") -> Array:
    """The colour of a `blackbody` of a temperature in kelvin in pbrt's image: (3,) linear sRGB.

    A light of it has luminance 1; in another role the spectrum is 1 at its peak, as pbrt's is. PenumbraError
    outside [100, 1e9] K.
    """
    if not COLDEST <= kelvin <= HOTTEST:
        raise PenumbraError(f"a black body of {kelvin:g} K; allowed: {COLDEST:g} to {HOTTEST:g} K")
    law = _colour().colorimetry.planck_law
    planck = np.asarray(law(_wavelengths() * 1e-9, kelvin, c2=SECOND_RADIATION), dtype=np.float64)
    if role != "illuminant":
        planck = planck / float(np.squeeze(law(np.array([PEAK / kelvin]), kelvin, c2=SECOND_RADIATION)))
    return _project(planck, role)


def named(name: str, role: Role) -> Array:
    """One of pbrt's named spectra as (3,) linear sRGB: an illuminant, one of METALS with "-eta" or "-k", or
    one of GLASSES, which has a single index.

    A metal's look needs both spectra together: see `metal`. PenumbraError for other names.
    """
    if role == "illuminant" and name in ILLUMINANTS:
        return _light(_illuminant(ILLUMINANTS[name]))
    return _project(spectrum(name), role)


def sampled(wavelengths: Sequence[float] | Array, values: Sequence[float] | Array, role: Role) -> Array:
    """A spectrum listed by its samples as (3,) linear sRGB: linear between them, 0 outside.

    wavelengths: nm, increasing. values: as many, none negative. role: "illuminant" (luminance 1, see above),
    "reflectance" (in [0, 1]), "unbounded" (as a reflectance, without the upper bound). PenumbraError for
    other input, and for a light without any visible.
    """
    nm, value = np.asarray(wavelengths, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if nm.ndim != 1 or nm.shape != value.shape or nm.size < 2:
        raise PenumbraError(
            f"a spectrum is at least two pairs of wavelength and value, not {nm.size} and "
            f"{value.size} numbers"
        )
    if not (
        np.isfinite(nm).all() and np.isfinite(value).all() and (np.diff(nm) > 0).all() and (value >= 0).all()
    ):
        raise PenumbraError(
            "a spectrum has increasing wavelengths in nm and finite values that are not negative"
        )
    return _project(np.interp(_wavelengths(), nm, value, left=0.0, right=0.0), role)


def metal(name: str) -> tuple[Array, Array]:
    """eta and k, (3,) each, that give one of METALS its look in linear sRGB; PenumbraError for another name.

    Per channel: r is the spectrum of the reflectance at normal incidence and eta that of the measured eta,
    both as seen under D65 (r in [0, 0.9999], eta within what was measured); k follows from them, so that r is
    met exactly. Where no real k does it, as in crystals that absorb nothing, k is 0 and eta follows from r.
    Both projections are linear, and so is the reflectance in small changes of eta and k: a mean with positive
    weights only would be ten times worse.

    Against the spectral Fresnel reflectance seen under D65, at 0, 5, ... 85 degrees, the largest error in any
    channel is 0.0003 for Ag, 0.0009 Al, 0.022 Au, 0.011 Cu, 0.005 CuZn, and below 0.0001 for MgO and TiO2.
    Gold's is sRGB's: its red is 1.022, which no r below 1 can be; its green and blue are within 0.0015.
    """
    if name not in METALS:
        raise PenumbraError(f"unknown metal {name!r}; there are {', '.join(METALS)}")
    return conductor(spectrum(f"{name}-eta"), spectrum(f"{name}-k"))


def conductor(eta: Array, k: Array) -> tuple[Array, Array]:
    """As `metal`, for any measured metal. eta, k: (471,) at 360, 361 ... 830 nm. Returns (3,), (3,)."""
    standard = _standard()
    reflectance = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    r = np.clip(standard.response @ reflectance, 0.0, OPAQUE)
    mean = np.clip(standard.response @ eta, eta.min(), eta.max())
    square = (r * (mean + 1) ** 2 - (mean - 1) ** 2) / (1 - r)
    root = np.sqrt(r)
    bare = np.where(mean >= 1, (1 + root) / (1 - root), (1 - root) / (1 + root))
    return np.where(square >= 0, mean, bare), np.sqrt(np.maximum(square, 0.0))


def conductor_of_reflectance(r: Array) -> tuple[Array, Array]:
    """eta and k, (3,) each, of a metal given by its reflectance r (3,) at normal incidence, pbrt's way: eta =
    1, k = 2 sqrt(r / (1 - r)).

    r is clamped to [0, 0.9999].
    """
    r = np.clip(r, 0.0, OPAQUE)
    return np.ones(3), 2 * np.sqrt(r / (1 - r))


def from_space(name: str, rgb: Array, most: float, role: Role) -> Array:
    """(3,) linear RGB of one of SPACES as linear sRGB, what sRGB does not hold cut off below 0 and above
    `most`.

    A white surface is white, whatever the space: where its white is not sRGB's, what is no light is adapted
    by Bradford's method. What pbrt's film shows of a saturated reflectance also hangs on the spectrum that
    pbrt makes of it, and agrees as little as any saturated one's does.
    """
    here, white = _to_xyz(np.array(PRIMARIES["srgb"])), WHITES.get(name, "D65")
    xyz = _to_xyz(np.array(PRIMARIES[name]), white) @ rgb
    if white != "D65" and role not in ("illuminant", "absolute"):
        whites = (_observer() @ _illuminant(one) for one in (white, "D65"))
        one, other = (xyz_of_white / xyz_of_white[1] for xyz_of_white in whites)
        xyz = _colour().adaptation.matrix_chromatic_adaptation_VonKries(one, other, "Bradford") @ xyz
    return np.clip(np.asarray(np.linalg.solve(here, xyz), dtype=np.float64), 0.0, most)


@dataclass(frozen=True, eq=False)
class _Standard:
    """xyz: (3, 471), the CIE 1931 colour matching functions. from_xyz: (3, 3), to linear sRGB.

    response: (3, 471); its product with a reflectance is the reflectance's colour under D65; each row sums to
    1.
    """

    xyz: Array
    from_xyz: Array
    response: Array


def _project(spectrum: Array, role: Role) -> Array:
    if role == "illuminant":
        return _light(spectrum)
    if role == "absolute":
        xyz = _standard().xyz
        return np.maximum(_standard().from_xyz @ (xyz @ spectrum) / xyz[1].sum(), 0.0)
    if role == "reflectance":
        spectrum = np.minimum(spectrum, 1.0)  # as pbrt's materials do, at each wavelength
    seen = _standard().response @ spectrum
    return np.clip(seen, 0.0, 1.0) if role == "reflectance" else np.maximum(seen, 0.0)


def _light(spectrum: Array) -> Array:
    standard = _standard()
    # A sum of tiny numbers is still a ratio of sums: scaled first, so that none underflows.
    xyz = standard.xyz @ (spectrum / max(float(spectrum.max()), np.finfo(np.float64).tiny))
    if not xyz[1] > 0:
        raise PenumbraError("the spectrum of a light has nothing between 360 and 830 nm")
    return np.maximum(standard.from_xyz @ (xyz / xyz[1]), 0.0)


def _wavelengths() -> Array:
    return np.linspace(_FIRST, _LAST, 471)


def spectrum(name: str) -> Array:
    """A named spectrum at 360, 361 ... 830 nm, (471,), an illuminant's mean under ybar being 1 as in pbrt.

    PenumbraError for other names.
    """
    if name in ILLUMINANTS:
        light, bright = _illuminant(ILLUMINANTS[name]), _standard().xyz[1]
        return light * (bright.sum() / (bright @ light))
    if name in GLASSES:
        return np.full(471, GLASSES[name])
    material, _, quantity = name.rpartition("-")
    if material not in METALS or quantity not in ("eta", "k"):
        allowed = [*ILLUMINANTS, *GLASSES, *(f"{metal}-eta and -k" for metal in METALS)]
        raise PenumbraError(f"unknown spectrum {name!r}; there are {', '.join(allowed)}")
    table = _metals()[material]
    values: Array = table[1] if quantity == "eta" else table[2]
    return np.interp(_wavelengths(), np.asarray(table[0]), values)


@cache
def _metals() -> dict[str, Array]:
    """(3, m) wavelengths in nm, eta and k of each of METALS."""
    with _TABLE.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    columns = ("wavelength_nm", "eta", "k")
    return {
        name: np.array([[float(row[c]) for row in rows if f"metal-{row['name']}" == name] for c in columns])
        for name in METALS
    }


@cache
def _standard() -> _Standard:
    xyz = _observer()
    d65 = _illuminant("D65")
    white = xyz @ d65
    from_xyz = np.asarray(np.linalg.inv(_to_xyz(np.array(PRIMARIES["srgb"]))), dtype=np.float64)
    return _Standard(xyz, from_xyz, from_xyz @ (xyz * d65) / white[1])


def _observer() -> Array:
    """(3, 471) the CIE 1931 colour matching functions."""
    observer = _colour().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    return np.ascontiguousarray(np.asarray(observer.values, dtype=np.float64).T)


def _to_xyz(primaries: Array, illuminant: str = "D65") -> Array:
    """(3, 3) from linear RGB of these primaries (3, 2), their white the illuminant's own integral, to XYZ."""
    white = _observer() @ _illuminant(illuminant)
    return np.asarray(
        _colour().normalised_primary_matrix(primaries, white[:2] / white.sum()), dtype=np.float64
    )


def _illuminant(name: str) -> Array:
    """One of colour-science's illuminants at the 471 wavelengths, linear between its samples as pbrt has it.

    Its tables of A, D50 and D65 end at 780 nm, pbrt's at 830: 1e-6 of the luminance lies there, and the end
    values stand in for it.
    """
    spectrum = _colour().SDS_ILLUMINANTS[name]
    nm, value = (np.asarray(part, dtype=np.float64) for part in (spectrum.wavelengths, spectrum.values))
    return np.interp(_wavelengths(), nm, value)


def _colour() -> Any:
    # Imported here: it takes a second, and it warns of the plotting library that it could use and nothing
    # here needs.
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message='.*"Matplotlib" related API')
        import colour
    module: Any = colour
    return module

"""Numbers and lists as text, the same in sentences, tables and plots: three digits, Unicode powers of ten."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.schema.record import Job
from pipeline.statistics.intervals import Interval
from pipeline.statistics.slopes import Slope
from reports.series import Measure

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
DASH = "–"
LEAST_ERROR = 1e-6  # a smaller standard error of a slope is rounding


def sig(x: float | None, digits: int = 3) -> str:
    """`x` to so many significant digits, with a power of ten below 0.001 and from 100,000 on; else a dash."""
    if x is None or math.isnan(x):
        return DASH
    if math.isinf(x) or x == 0:
        return "0" if x == 0 else "∞" if x > 0 else "−∞"
    mantissa, exponent = f"{abs(x):.{digits - 1}e}".split("e")
    power, sign = int(exponent), "−" if x < 0 else ""
    if -3 <= power < 5:
        return sign + f"{float(f'{mantissa}e{power}'):,.{max(digits - 1 - power, 0)}f}"
    return f"{sign}{mantissa}×10{str(power).translate(SUPERSCRIPT)}"


def power_of_ten(exponent: int) -> str:
    """10 to a whole power; 1 for none."""
    return f"10{str(exponent).translate(SUPERSCRIPT)}" if exponent else "1"


def plain(x: float) -> str:
    """A chosen number in its shortest form: 0.01, 10⁻⁵ or 2.5×10⁻⁷."""
    mantissa, _, exponent = f"{abs(x):g}".partition("e")
    sign = "−" if x < 0 else ""
    if not exponent:
        return sign + mantissa
    power = power_of_ten(int(exponent))
    return sign + (power if mantissa == "1" else f"{mantissa}×{power}")


def ends(found: Interval | Measure, digits: int = 3) -> str:
    """The 95 % interval of a value as `a to b`, empty where there is none."""
    if found.low is None or found.high is None or math.isnan(found.low) or math.isnan(found.high):
        return ""
    return f"{sig(found.low, digits)} to {sig(found.high, digits)}"


def interval(found: Interval | Measure, digits: int = 3) -> str:
    """A value with its 95 % interval in brackets."""
    inside = ends(found, digits)
    return f"{sig(found.value, digits)} ({inside})" if inside else sig(found.value, digits)


def spread(values: Sequence[float], digits: int = 3) -> str:
    """The range of the values as `a to b`; one number if both ends round to the same `digits` digits."""
    low, high = sig(min(values), digits), sig(max(values), digits)
    return low if low == high else f"{low} to {high}"


def slope_text(slope: Slope) -> str:
    """A slope with its standard error, to three decimals or to the error's first digit."""
    if math.isnan(slope.se):
        return f"{slope.value:.3f}".replace("-", "−")
    places = max(3, math.ceil(-math.log10(slope.se))) if slope.se > LEAST_ERROR else 3
    return f"{slope.value:.{places}f} ± {slope.se:.{places}f}".replace("-", "−")


def millions(count: float) -> str:
    """A count of rays, in thousands or millions where it is that large."""
    for unit, name in ((1e6, " M"), (1e3, " k")):
        if count >= unit:
            return sig(count / unit) + name
    return f"{count:.0f}"


def capital(text: str) -> str:
    """The text with its first letter in upper case."""
    return text[:1].upper() + text[1:]


def listing(items: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def count(number: int, singular: str, plural: str = "") -> str:
    """`1 image`, `2 images`, `no image`."""
    if number == 1:
        return f"1 {singular}"
    return f"{number:,} {plural or singular + 's'}" if number else f"no {singular}"


def settings(values: Sequence[tuple[str, float]]) -> str:
    """Scene parameters as `gap = 0.01, size = 1`."""
    return ", ".join(f"{name} = {plain(value)}" for name, value in values)


def scene_title(scene: str, values: Sequence[tuple[str, float]] = ()) -> str:
    """A scene by the name of its file, with the given parameters."""
    name = scene.rsplit("/", 1)[-1].removesuffix(".pbrt")
    return f"{name} ({settings(values)})" if values else name


def job_line(job: Job) -> str:
    """One cell as a line of text."""
    where = scene_title(job.scene, tuple(job.parameters.items()))
    return f"{where}: {job.estimator}, {job.sampler}, {job.spp} spp, seed {job.seed}"

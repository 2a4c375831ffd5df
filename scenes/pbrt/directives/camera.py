"""`Camera`, `Film` and `PixelFilter`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scenes.description.scene import Film, PerspectiveCamera, PixelFilter
from scenes.errors import Location, Unsupported
from scenes.pbrt.state import FILTERS, Builder, must_be, refuse_kind
from scenes.pbrt.text.parameters import SRGB, Parameters
from scenes.pbrt.transforms import rigid

FILM_LIMIT = 65_535
SAME_WINDOW = 1e-4  # relative; files write 1.7778 for 16 / 9
RADIUS_LIMIT = 16.0  # pixels
SENSOR_LIMIT = 1e6  # pbrt's own, on what a pixel's sample may be

Array = NDArray[np.float64]


def camera(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Camera "perspective"`, a pinhole; the transformation may mirror but not stretch."""
    builder.systems["camera"] = builder.state.transform.inverted()
    builder.camera = PerspectiveCamera(np.eye(4), 90.0)  # holds while the rest of a refused scene is read
    refuse_kind(kind, "perspective", parameters)
    fov = parameters.number("fov", 90.0)
    if not 0 < fov < 180:
        raise parameters.fail("fov", f"fov is an angle between 0 and 180 degrees, not {fov:g}")
    must_be(parameters, "lensradius", parameters.number("lensradius", 0.0), 0.0, "the camera is a pinhole")
    parameters.number("focaldistance", 1e6)  # of no effect without a lens
    shutter = parameters.number("shutterclose", 1.0) - parameters.number("shutteropen", 0.0)
    must_be(
        parameters,
        "shutterclose",
        shutter,
        1.0,
        "pbrt exposes by it, and only from 0 to 1 is the image linear radiance",
    )
    builder.screen_window = _window(parameters)
    to_world = rigid(builder.state.transform)
    if to_world is None:
        raise Unsupported(
            "the camera's transformation stretches or shears space; that is not supported", parameters.where
        )
    builder.camera = PerspectiveCamera(to_world, fov)


def _window(parameters: Parameters) -> tuple[Array, Location] | None:
    """The part of the screen that the film shows, as `screenwindow` gives it or else `frameaspectratio`; None
    if neither does.
    """
    frame, window = parameters.number("frameaspectratio", 1.0), parameters.numbers("screenwindow")
    if not frame > 0:
        raise parameters.fail("frameaspectratio", f"frameaspectratio must be positive, not {frame:g}")
    if window is None:
        x, y = max(frame, 1.0), max(1 / frame, 1.0)
        given = parameters.given("frameaspectratio")
        return (np.array([-x, x, -y, y]), parameters.located("frameaspectratio")) if given else None
    if len(window) != 4:
        raise parameters.fail("screenwindow", f"screenwindow is four numbers, not {len(window)}")
    return window, parameters.located("screenwindow")


def check_window(builder: Builder) -> None:
    """Report a window of the screen that is not what the film's shape gives: the shorter side from -1 to
    1.
    """
    if builder.screen_window is None:
        return
    window, where = builder.screen_window
    short = min(builder.film.width, builder.film.height)
    x, y = builder.film.width / short, builder.film.height / short
    if np.abs(window - np.array([-x, x, -y, y])).max() > SAME_WINDOW * max(x, y):
        builder.report.add(
            (
                f"frameaspectratio and screenwindow are not supported but for the film's own, {x / y:g} and "
                f"{-x:g} {x:g} {-y:g} {y:g}"
            ),
            where,
        )


def film(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Film "rgb"` with the sensor at pbrt's defaults, where an image is linear radiance."""
    refuse_kind(kind, "rgb", parameters)
    if builder.state.space != SRGB:
        problem = f'Film in ColorSpace "{builder.state.space}" is not supported: images are linear sRGB'
        builder.report.add(f"{problem}; put ColorSpace behind Film", parameters.where)
    size = [
        parameters.integer(name, default) for name, default in (("xresolution", 1280), ("yresolution", 720))
    ]
    for name, value in zip(("xresolution", "yresolution"), size, strict=True):
        if not 1 <= value <= FILM_LIMIT:
            raise parameters.fail(name, f"{name} must be between 1 and {FILM_LIMIT} pixels, not {value}")
    radiance = "only there is the image linear radiance"
    must_be(parameters, "sensor", parameters.text("sensor", "cie1931"), "cie1931", radiance)
    must_be(parameters, "iso", parameters.number("iso", 100.0), 100.0, radiance)
    must_be(parameters, "exposuretime", parameters.number("exposuretime", 1.0), 1.0, radiance)
    must_be(parameters, "whitebalance", parameters.number("whitebalance", 0.0), 0.0, radiance)
    if parameters.number("maxcomponentvalue", SENSOR_LIMIT) < SENSOR_LIMIT:
        parameters.unsupported(
            "maxcomponentvalue",
            f"maxcomponentvalue below {SENSOR_LIMIT:g} is not supported: no sample is clamped",
        )
    _whole_film(parameters, size)
    parameters.flag("savefp16", True)  # how pbrt stores its file; images here are float32
    parameters.number("diagonal", 35.0)  # of no effect on a pinhole
    builder.film = Film(size[0], size[1], parameters.text("filename", ""), builder.film.pixel_filter)


def _whole_film(parameters: Parameters, size: list[int]) -> None:
    """Report a crop; pbrt's two ways of writing one are the part of the film in [0, 1] and in pixels."""
    window, bounds = parameters.numbers("cropwindow"), parameters.integers("pixelbounds")
    for name, values in (("cropwindow", window), ("pixelbounds", None if bounds is None else bounds[0])):
        if values is not None and len(values) != 4:
            raise parameters.fail(name, f"{name} is four numbers, not {len(values)}")
    if window is not None and np.sort(window.reshape(2, 2)).tolist() != [[0, 1], [0, 1]]:
        parameters.unsupported("cropwindow", "cropwindow is not supported: the whole film is rendered")
    if bounds is not None and bounds[0].tolist() != [0, size[0], 0, size[1]]:
        parameters.unsupported("pixelbounds", "pixelbounds is not supported: the whole film is rendered")


def pixel_filter(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`PixelFilter`: box, triangle or gaussian."""
    if kind not in FILTERS:
        parameters.ignore()
        raise Unsupported(
            (
                f'PixelFilter "{kind}" is not supported; supported: '
                f"{', '.join(f'{name!r}' for name in FILTERS)}"
            ).replace("'", '"'),
            parameters.where,
        )
    radii: list[float] = []
    for name in ("xradius", "yradius"):
        radius = parameters.number(name, FILTERS[kind])
        if not 0 < radius <= RADIUS_LIMIT:
            raise parameters.fail(
                name, f"{name} must be above 0 and at most {RADIUS_LIMIT:g} pixels, not {radius:g}"
            )
        radii.append(radius)
    sigma = parameters.number("sigma", 0.5) if kind == "gaussian" else 0.5
    if sigma <= 0:
        raise parameters.fail("sigma", f"sigma must be positive, not {sigma:g}")
    chosen = PixelFilter(kind, radii[0], radii[1], sigma)
    builder.film = Film(builder.film.width, builder.film.height, builder.film.filename, chosen)

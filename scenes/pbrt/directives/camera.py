"""`Camera`, `Film` and `PixelFilter`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.scene import (
    Camera,
    Film,
    Lens,
    OrthographicCamera,
    PerspectiveCamera,
    PixelFilter,
    SphericalCamera,
)
from scenes.errors import SceneError
from scenes.pbrt.directives.realistic import thin_lens
from scenes.pbrt.state import DEFAULT_FILTER, FILTERS, Builder, MediumUse, refuse_kind, require_value
from scenes.pbrt.text.parameters import SRGB, Parameters
from scenes.pbrt.transforms import FLAT, rigid

FILM_LIMIT = 65_535
SAME_WINDOW = 1e-4  # relative; files write 1.7778 for 16 / 9
FILMS = ("rgb", "gbuffer", "spectral")
SHARPENING = ("mitchell", "sinc")  # filters that are negative somewhere
RADIUS_LIMIT = 16.0  # pixels
SENSOR_LIMIT = 1e6  # pbrt's own, on what a pixel's sample may be
# pbrt's measured sensors; "cie1931" integrates against the observer's matching functions.
SENSORS = (
    "cie1931", "canon_eos_100d", "canon_eos_1dx_mkii", "canon_eos_200d", "canon_eos_200d_mkii",
    "canon_eos_5d", "canon_eos_5d_mkii", "canon_eos_5d_mkiii", "canon_eos_5d_mkiv", "canon_eos_5ds",
    "canon_eos_m", "hasselblad_l1d_20c", "nikon_d810", "nikon_d850", "sony_ilce_6400", "sony_ilce_7m3",
    "sony_ilce_7rm3",
    "sony_ilce_9",
)  # fmt: skip

Array = NDArray[np.float64]


def camera(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Camera`: a projection, with or without a lens, under any invertible transformation."""
    if builder.state.transform.flattens:
        raise SceneError(FLAT, parameters.where)
    builder.check_placed("a camera", parameters.where)
    if builder.state.media is not None:
        builder.media_used.append(MediumUse(replace(builder.state.media, inside="")))
    builder.camera = PerspectiveCamera(np.eye(4), 90.0)  # holds while the rest of a refused scene is read
    refuse_kind(kind, " ".join(KINDS), parameters)
    lens = _lens(parameters)
    builder.exposure = parameters.number("shutterclose", 1.0) - parameters.number("shutteropen", 0.0)
    if not builder.exposure > 0:
        raise parameters.fail("shutterclose", f"the shutter is open for {builder.exposure:g}, not above 0")
    builder.screen_window = _window(parameters)
    builder.camera = KINDS[kind](builder, parameters, lens)


def _perspective(builder: Builder, parameters: Parameters, lens: Lens | None) -> Camera:
    fov = parameters.number("fov", 90.0)
    if not 0 < fov < 180:
        raise parameters.fail("fov", f"fov is an angle between 0 and 180 degrees, not {fov:g}")
    # Only a pinhole's rays are those of its camera scaled.
    to_world = None if lens is not None else rigid(builder.state.transform)
    inverse = builder.state.transform.inverse
    return PerspectiveCamera(inverse if to_world is None else to_world, fov, lens=lens)


def _orthographic(builder: Builder, _: Parameters, lens: Lens | None) -> Camera:
    return OrthographicCamera(builder.state.transform.inverse, lens=lens)


def _spherical(builder: Builder, parameters: Parameters, _: Lens | None) -> Camera:
    mapping = parameters.text("mapping", MAPPINGS[0])
    if mapping not in MAPPINGS:
        raise parameters.fail("mapping", f'unknown mapping "{mapping}"; there are: {", ".join(MAPPINGS)}')
    builder.screen_window = None  # pbrt reads one, and a lens, and uses neither
    to_world = rigid(builder.state.transform)
    return SphericalCamera(builder.state.transform.inverse if to_world is None else to_world, mapping)


def _realistic(builder: Builder, parameters: Parameters, _: Lens | None) -> Camera:
    parameters.substitute("", 'Camera "realistic"', "as a thin lens of its focal length")
    parameters.ignore()
    if not builder.report.substitutes:
        return builder.camera
    found = thin_lens(parameters, builder.diagonal, builder.full_size)
    builder.exposure *= found.share
    return PerspectiveCamera(builder.state.transform.inverse, found.fov, lens=found.lens)


KINDS = {
    "perspective": _perspective,
    "orthographic": _orthographic,
    "spherical": _spherical,
    "realistic": _realistic,
}
STAND_INS = ("realistic",)  # the kinds that --substitute renders as something else
MAPPINGS = ("equalarea", "equirectangular")


def _lens(parameters: Parameters) -> Lens | None:
    """The lens, None if its radius is not above 0, as in pbrt."""
    radius, distance = parameters.number("lensradius", 0.0), parameters.number("focaldistance", 1e6)
    if radius > 0 and not distance > 0:
        raise parameters.fail("focaldistance", f"focaldistance must be positive, not {distance:g}")
    return Lens(radius, distance) if radius > 0 else None


def _window(parameters: Parameters) -> Array | None:
    """The part of the screen that the film shows, (4,) left, right, bottom and top, by `screenwindow` or else
    by `frameaspectratio`; None without both. Its ends are sorted, as by pbrt.
    """
    frame, window = parameters.number("frameaspectratio", 1.0), parameters.numbers("screenwindow")
    if not frame > 0:
        raise parameters.fail("frameaspectratio", f"frameaspectratio must be positive, not {frame:g}")
    if window is None:
        x, y = max(frame, 1.0), max(1 / frame, 1.0)
        return np.array([-x, x, -y, y]) if parameters.given("frameaspectratio") else None
    if len(window) != 4:
        raise parameters.fail("screenwindow", f"screenwindow is four numbers, not {len(window)}")
    if window[0] == window[1] or window[2] == window[3]:
        raise parameters.fail(
            "screenwindow", "screenwindow has no area: its ends are left, right, bottom, top"
        )
    return np.sort(window.reshape(2, 2), axis=1).ravel()


def framed(builder: Builder) -> Camera:
    """The camera with the window of the film's crop. The window is None for a film without one, see
    `whole`.
    """
    film, crop, window = builder.film, builder.crop, builder.screen_window
    width, height = (film.width, film.height) if crop is None else builder.full_size
    own = builder.camera.whole(width, height)
    if window is not None and np.abs(window - own).max() <= SAME_WINDOW * np.abs(own).max():
        window = None
    if crop is None:
        return replace(builder.camera, window=window)
    left, right, bottom, top = own if window is None else window
    dx, dy = (right - left) / width, (top - bottom) / height
    x0, x1, y0, y1 = crop
    return replace(
        builder.camera,
        window=np.array([left + x0 * dx, left + x1 * dx, top - y1 * dy, top - y0 * dy]),
    )


def film(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Film`: size, crop, and the imaging ratio of its sensor. The image is linear sRGB."""
    refuse_kind(kind, " ".join(FILMS), parameters)
    if builder.state.space != SRGB:
        problem = (
            f'the film is in ColorSpace "{builder.state.space}": the image shows its colours in linear sRGB'
        )
        builder.report.note(problem, parameters.where)
    size = [
        parameters.integer(name, default) for name, default in (("xresolution", 1280), ("yresolution", 720))
    ]
    for name, value in zip(("xresolution", "yresolution"), size, strict=True):
        if not 1 <= value <= FILM_LIMIT:
            raise parameters.fail(name, f"{name} must be between 1 and {FILM_LIMIT} pixels, not {value}")
    _sensor(builder, parameters)
    builder.full_size = (size[0], size[1])
    builder.crop = _crop(parameters, size)
    x0, x1, y0, y1 = builder.crop or (0, size[0], 0, size[1])
    parameters.flag("savefp16", True)  # how pbrt stores its file; images here are float32
    builder.diagonal = parameters.number("diagonal", 35.0)  # mm, of effect on a realistic camera alone
    if kind != "rgb":
        parameters.ignore()  # what pbrt stores beside the image
    builder.film = Film(x1 - x0, y1 - y0, parameters.text("filename", ""), builder.film.pixel_filter)


def _sensor(builder: Builder, parameters: Parameters) -> None:
    """The ISO value, with a note on a sensor, white balance or limit that would change or clamp colours."""
    require_value(
        parameters, "exposuretime", parameters.number("exposuretime", 1.0), 1.0, "the shutter's times expose"
    )
    builder.iso = parameters.number("iso", 100.0)
    if not builder.iso > 0:
        raise parameters.fail("iso", f"iso must be positive, not {builder.iso:g}")
    sensor = parameters.text("sensor", "cie1931")
    if sensor not in SENSORS:
        allowed = ", ".join(f'"{name}"' for name in SENSORS)
        raise parameters.fail("sensor", f"no sensor is called {sensor!r}; there are: {allowed}")
    if sensor != "cie1931":
        builder.report.note(
            f'the sensor "{sensor}" is taken for "cie1931": its colours differ, its imaging ratio holds',
            parameters.located("sensor"),
        )
    if parameters.number("whitebalance", 0.0) != 0:
        builder.report.note(
            "whitebalance is left out: colours are those of the scene", parameters.located("whitebalance")
        )
    limit = parameters.number("maxcomponentvalue", SENSOR_LIMIT)
    if limit < SENSOR_LIMIT:
        builder.report.note(
            f"no sample is clamped to maxcomponentvalue, {limit:g}: clamping would bias the image",
            parameters.located("maxcomponentvalue"),
        )


def _crop(parameters: Parameters, size: list[int]) -> tuple[int, int, int, int] | None:
    """The pixels x0, x1, y0, y1 to render, ends excluded; None for all of them.

    `cropwindow` overrules `pixelbounds`. pbrt rounds its share of the film upwards, in float32.
    """
    window, bounds = parameters.numbers("cropwindow"), parameters.integers("pixelbounds")
    for name, values in (("cropwindow", window), ("pixelbounds", None if bounds is None else bounds[0])):
        if values is not None and len(values) != 4:
            raise parameters.fail(name, f"{name} is four numbers, not {len(values)}")
    name, ends = "pixelbounds", np.array([[0, size[0]], [0, size[1]]], dtype=np.int64)
    if bounds is not None:
        given = np.sort(bounds[0].reshape(2, 2), axis=1)
        ends = np.stack([np.maximum(given[:, 0], 0), np.minimum(given[:, 1], size)], axis=1)
    if window is not None:
        name = "cropwindow"
        share = np.sort(np.clip(window, 0.0, 1.0).astype(np.float32).reshape(2, 2), axis=1)
        ends = np.ceil(share * np.array(size, dtype=np.float32)[:, None]).astype(np.int64)
    if np.any(ends[:, 0] >= ends[:, 1]):
        raise parameters.fail(name, f"{name} leaves no pixel of {size[0]} x {size[1]}")
    (x0, x1), (y0, y1) = ends.tolist()
    return None if (x0, x1, y0, y1) == (0, size[0], 0, size[1]) else (x0, x1, y0, y1)


def pixel_filter(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`PixelFilter`: box, triangle or gaussian."""
    if kind not in FILTERS:
        parameters.ignore()
        if kind not in SHARPENING:
            allowed = ", ".join(f'"{name}"' for name in (*FILTERS, *SHARPENING))
            raise parameters.fail("", f'unknown PixelFilter "{kind}"; there are: {allowed}')
        builder.report.substitute(f'PixelFilter "{kind}"', "with pbrt's default filter", parameters.where)
        builder.film = replace(builder.film, pixel_filter=DEFAULT_FILTER)
        return
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

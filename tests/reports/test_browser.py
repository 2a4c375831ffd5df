"""The report in a real browser: Debian's chromium, headless, the page opened from disk with the network off.

Runs on the report of the small run, and on that of the demo: the one that PENUMBRA_REPORT names (`.ci/run`
does), or runs/demo/report where it lies. Screenshots are kept in runs/screenshots.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Playwright, Route, TimeoutError, sync_playwright

from tests.system_parts import chromium

ROOT = Path(__file__).parents[2]
SCREENSHOTS = ROOT / "runs" / "screenshots"
DEMO = Path(os.environ.get("PENUMBRA_REPORT", ROOT / "runs" / "demo" / "report" / "index.html"))
REPORTS = ["small", "demo"] if "PENUMBRA_REPORT" in os.environ or DEMO.exists() else ["small"]
WIDE, NARROW, PHONE = 1280, 800, 400
DRAWN = 10_000  # milliseconds for a plot or a picture to appear, with both cores busy elsewhere

# Points that a figure is given and points that it shows; legends are not in `.scatterlayer`.
POINTS = """figure => {
  const marked = figure.data.filter(trace => (trace.mode || "").includes("markers"));
  return {
    given: marked.flatMap(trace => Array.from(trace.x)).filter(x => x !== null).length,
    drawn: figure.querySelectorAll("svg .scatterlayer .points path.point").length,
    traces: marked.length,
  };
}"""
# Sum and number of different values of the canvas that a flip book shows: black or blank has one value.
PIXELS = """canvas => {
  const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return { sum: data.reduce((a, b) => a + b, 0), values: new Set(data).size };
}"""
# What sticks out of the window, but for what scrolls inside its own box.
OVERHANG = """() => Array.from(document.querySelectorAll("main *"))
  .filter(e => e.getBoundingClientRect().right > window.innerWidth + 1)
  .filter(e => !e.closest(".scroll *, .plot svg, .flip *"))
  .map(e => e.tagName + "." + e.className)"""


@dataclass
class Opened:
    """A page and all that it said and asked for."""

    page: Page
    name: str
    errors: list[str] = field(default_factory=list)
    foreign: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def playwright(browser: None) -> Iterator[Playwright]:
    with sync_playwright() as driver:
        yield driver


@pytest.fixture(scope="module", params=REPORTS)
def opened(playwright: Playwright, request: pytest.FixtureRequest) -> Iterator[Opened]:
    report = DEMO if request.param == "demo" else request.getfixturevalue("small_page")
    assert report.is_file(), f"{report} is missing: run `make demo`"
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
    browser = playwright.chromium.launch(executable_path=chromium(), args=sandbox)
    context = browser.new_context(viewport={"width": WIDE, "height": 900}, offline=True)
    context.set_default_timeout(DRAWN)
    found = Opened(context.new_page(), request.param)
    found.page.on(
        "console", lambda message: found.errors.append(message.text) if message.type == "error" else None
    )
    found.page.on("pageerror", lambda error: found.errors.append(str(error)))
    found.page.route("**/*", lambda route: _only_files(route, found))
    found.page.goto(report.resolve().as_uri())
    yield found
    browser.close()


def _only_files(route: Route, found: Opened) -> None:
    """Let through what lies on disk or in the page itself; note and stop everything else."""
    url = route.request.url
    if url.startswith(("file:", "data:", "blob:")):
        found.files.append(url)
        route.continue_()
    else:
        found.foreign.append(url)
        route.abort()


def _book(opened: Opened) -> Locator:
    """The first flip book, brought into view, with its first picture drawn."""
    place = opened.page.locator(".flip").first
    place.scroll_into_view_if_needed()
    _shown(place).wait_for(state="visible")
    opened.page.wait_for_function(
        f"canvas => ({PIXELS})(canvas).values > 8", arg=_shown(place).element_handle()
    )
    return place


def _shown(place: Locator) -> Locator:
    return place.locator("canvas >> visible=true")


def _pixels(place: Locator) -> Any:
    return _shown(place).evaluate(PIXELS)


def _tab(place: Locator) -> str:
    """The name of the picture that the flip book says it shows: the one button of another colour than its
    neighbours.
    """
    buttons = place.locator("[tabindex='1'] button")
    colors = buttons.evaluate_all("all => all.map(b => getComputedStyle(b).backgroundColor)")
    odd = [i for i, color in enumerate(colors) if colors.count(color) == 1]
    assert len(odd) == 1, colors
    return buttons.nth(odd[0]).inner_text()


def test_every_plot_is_drawn_with_every_point(opened: Opened) -> None:
    """Catches a figure that stays empty, and points that fall outside its axes or are dropped by the
    logarithm.
    """
    figures = opened.page.locator(".plotly-graph-div")
    assert figures.count() >= 2
    for number in range(figures.count()):
        figure = figures.nth(number)
        figure.scroll_into_view_if_needed()
        figure.locator("svg.main-svg").first.wait_for()
        points = figure.evaluate(POINTS)
        assert points["drawn"] == points["given"] > 2, points
        assert points["traces"] >= 2
        titles = [figure.locator(f".{axis}title").text_content() or "" for axis in ("x", "y")]
        assert "RMSE" in titles[1] and "(" in titles[0], titles
        assert figure.locator(".legend .legendtext").count() >= 2


def test_markers_lie_inside_their_axes(opened: Opened) -> None:
    """Catches a cross or a bound that is drawn beyond the frame, where no one sees it."""
    for figure in opened.page.locator(".plotly-graph-div").all():
        outside = figure.evaluate(
            """figure => {
              const area = figure._fullLayout, left = figure.getBoundingClientRect();
              const box = { l: left.left + area._size.l, t: left.top + area._size.t };
              const right = box.l + area._size.w, bottom = box.t + area._size.h;
              return Array.from(figure.querySelectorAll(".scatterlayer .points path.point")).filter(point => {
                const at = point.getBoundingClientRect();
                const x = at.left + at.width / 2, y = at.top + at.height / 2;
                return x < box.l - 1 || x > right + 1 || y < box.t - 1 || y > bottom + 1;
              }).length;
            }"""
        )
        assert outside == 0


def test_stills_are_loaded(opened: Opened) -> None:
    widths = opened.page.locator(".stills img").evaluate_all(
        "all => all.map(i => i.complete && i.naturalWidth)"
    )
    assert len(widths) >= 6 and all(width > 0 for width in widths)


def test_the_viewer_flips_on_a_key(opened: Opened) -> None:
    place = _book(opened)
    _shown(place).click()
    first, name = _pixels(place), _tab(place)
    opened.page.keyboard.press("2")
    opened.page.wait_for_function(
        f"canvas => ({PIXELS})(canvas).values > 8", arg=_shown(place).element_handle()
    )
    assert _tab(place) != name and "reference" in name
    assert _pixels(place) != first
    opened.page.keyboard.press("ArrowLeft")
    assert _tab(place) == name and _pixels(place) == first


def test_the_viewer_changes_exposure(opened: Opened) -> None:
    """Two presses are one stop: the picture gets brighter, and `E` takes it back."""
    place = _book(opened)
    _shown(place).click()
    before = _pixels(place)
    opened.page.keyboard.press("e")
    opened.page.keyboard.press("e")
    grown = f"([canvas, sum]) => ({PIXELS})(canvas).sum > sum"
    opened.page.wait_for_function(grown, arg=[_shown(place).element_handle(), before["sum"]])
    opened.page.keyboard.press("Shift+E")
    opened.page.keyboard.press("Shift+E")
    same = f"([canvas, sum]) => ({PIXELS})(canvas).sum === sum"
    opened.page.wait_for_function(same, arg=[_shown(place).element_handle(), before["sum"]])


def test_error_maps_are_in_false_colours(opened: Opened) -> None:
    """The last picture of a sample-count study is an error map: coloured, not gray, and not one colour."""
    place = _book(opened)
    _shown(place).click()
    place.locator("[tabindex='1'] button").last.click()
    assert "error" in _tab(place)
    opened.page.wait_for_function(
        f"canvas => ({PIXELS})(canvas).values > 8", arg=_shown(place).element_handle()
    )
    colored = _shown(place).evaluate(
        """canvas => {
          const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
          let colored = 0;
          for (let i = 0; i < data.length; i += 4) colored += data[i] !== data[i + 2];
          return colored / (data.length / 4);
        }"""
    )
    assert colored > 0.3


@pytest.fixture(params=[WIDE, NARROW, PHONE])
def width(opened: Opened, request: pytest.FixtureRequest) -> Iterator[int]:
    """The width that the window has for one test."""
    opened.page.set_viewport_size({"width": request.param, "height": 900})
    yield request.param
    opened.page.set_viewport_size({"width": WIDE, "height": 900})


def _settled(page: Page, query: str) -> Any:
    """The answer of a query for what is wrong; plots follow the width of a window a moment later."""
    with suppress(TimeoutError):
        page.wait_for_function(f"({query})().length === 0")
    return page.evaluate(query)


def test_nothing_is_cut_off(opened: Opened, width: int) -> None:
    """And a picture of the whole page is kept, to be looked at."""
    for place in opened.page.locator(".flip").all():
        place.scroll_into_view_if_needed()
        _shown(place).wait_for(state="visible")
    assert _settled(opened.page, OVERHANG) == []
    # Plots take a new width a moment after the window does.
    opened.page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=width)
    frames = opened.page.locator(".plotly-graph-div").evaluate_all(
        "all => all.map(figure => [figure._fullLayout._size.w, figure._fullLayout._size.h])"
    )
    assert all(across > 220 and up > 150 for across, up in frames), frames  # of 400 and 460 pixels
    opened.page.evaluate("scrollTo(0, 0)")
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    path = SCREENSHOTS / f"report-{opened.name}-{width}.png"
    opened.page.screenshot(path=path, full_page=True)
    assert path.stat().st_size > 50_000


def test_tables_fit_at_the_usual_width(opened: Opened) -> None:
    boxes = opened.page.locator(".scroll").evaluate_all(
        "all => all.map(box => [box.scrollWidth, box.clientWidth])"
    )
    assert len(boxes) >= 4 and all(inner <= outer for inner, outer in boxes), boxes


def test_at_the_end_there_were_no_errors_and_no_request_left_the_disk(opened: Opened) -> None:
    """Last in the file: it judges all that the tests before it did."""
    assert opened.errors == []
    assert opened.foreign == []
    assert len([url for url in opened.files if url.endswith(".js")]) >= 3

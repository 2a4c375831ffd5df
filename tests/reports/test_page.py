"""The page and its folder: whole, self-contained, honest about what is missing."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from reports import write_report
from reports.formats import sig
from reports.viewer import Picture, flip_script
from scenes.errors import PenumbraError
from tests.kit.small_run import FORBIDDEN, HEIGHT, WIDTH, truth


class Links(HTMLParser):
    """Every `src` and `href` of a page, and every id."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.ids: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href") and value:
                self.targets.append(value)
            if name == "id" and value:
                self.ids.add(value)


def links(page: Path) -> Links:
    parser = Links()
    parser.feed(page.read_text(encoding="utf-8"))
    return parser


def book(script: str) -> dict[str, list[str]]:
    """The data of a flip book's script."""
    found = re.search(r"const book = (\{.*\});", script)
    assert found
    return json.loads(found.group(1))


def test_everything_that_the_page_names_lies_beside_it(small_page: Path) -> None:
    """Catches an address in the net, a missing file and a dead entry of the contents."""
    parser = links(small_page)
    assert len(parser.targets) > 20
    for target in parser.targets:
        if target.startswith("#"):
            assert target[1:] in parser.ids
        elif not target.startswith("data:"):
            assert not re.match(r"[a-z]+:|//", target), target
            assert (small_page.parent / target).is_file(), target


def test_the_folder_is_small_and_has_plotly_once(small_page: Path) -> None:
    assert small_page.stat().st_size < 1e6
    assert sum(path.stat().st_size for path in small_page.parent.rglob("*") if path.is_file()) < 15e6
    assert len(list(small_page.parent.rglob("plotly*.js"))) == 1


def test_the_report_can_be_carried_elsewhere(small_page: Path, tmp_path: Path) -> None:
    """Catches a path of this machine in a place where the browser would follow it."""
    text = small_page.read_text(encoding="utf-8")
    assert not [target for target in links(small_page).targets if str(small_page.parent) in target]
    again = write_report(small_page.parents[1], tmp_path / "elsewhere")
    assert again == tmp_path / "elsewhere" / "index.html"
    assert again.read_text(encoding="utf-8") == text


def test_no_number_of_an_untrustworthy_image_is_on_the_page(small_page: Path) -> None:
    """The scores on disk say an RMSE of FORBIDDEN: neither that nor its square may be read anywhere, hover
    texts included.
    """
    text = small_page.read_text(encoding="utf-8")
    for value in (FORBIDDEN, FORBIDDEN**2, 2 * FORBIDDEN**2):
        assert sig(value) not in text and f"{value:.3g}" not in text
    assert "0.00765" not in text and "0.007654" not in text
    assert text.count("untrustworthy") > 6


def test_what_must_be_said_is_said(small_page: Path) -> None:
    text = re.sub(r"\s+", " ", small_page.read_text(encoding="utf-8"))
    for expected in (
        "Show what accuracy costs in time.",
        "Test that hard cases stay numerically stable.",
        "Simulate only the effects that a scene calls for.",
        "solid-angle on disk-light (samples): its method is still to come",
        "every light lies outside the view frustum",
        "render time of one image, one thread (s)",
        "0123abcd",
        "a machine, 2 cores",
        "penumbra run small --out",
        "closed-form",
        "What does it cost?",
    ):
        assert expected in text, expected
    assert "is not finished" not in text and "Not scored yet" not in text


def test_a_run_that_is_not_finished_names_what_is_missing(small_run: Path, tmp_path: Path) -> None:
    run = shutil.copytree(small_run, tmp_path / "run", ignore=shutil.ignore_patterns("report"))
    shutil.rmtree(run / "cells" / "samples-005")
    (run / "cells" / "samples-007" / "record.json").write_text("{")
    shutil.rmtree(run / "scores" / "score-overflow-002")
    text = write_report(run).read_text(encoding="utf-8")
    assert "2 of 66 images missing" in text
    assert "soft-shadow: solid-angle, independent, 4 spp, seed 0" in text
    assert "soft-shadow: solid-angle, sobol, 4 spp, seed 0" in text
    assert "Not scored yet: 1 of 66 images." in text
    assert "touching-light (gap = 0.01, width = 2): area, independent, 64 spp, seed 0" in text


def test_a_run_without_a_single_image_still_has_a_report(small_run: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    shutil.copy(small_run / "manifest.json", tmp_path / "run")
    text = write_report(tmp_path / "run").read_text(encoding="utf-8")
    assert "66 of 66 images missing" in text and "and 26 more" in text
    assert "No image was rendered." in text


def test_no_run_no_report(tmp_path: Path) -> None:
    with pytest.raises(PenumbraError, match="no run here"):
        write_report(tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written(small_run: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(PenumbraError, match="cannot write the report"):
        write_report(small_run, tmp_path / "file" / "report")


@pytest.mark.usefixtures("processes")
def test_a_report_renders_nothing_and_needs_no_renderer(small_run: Path, tmp_path: Path) -> None:
    """Runs where renderer, mitsuba and embreex cannot be imported at all."""
    code = (
        "import sys; sys.modules.update(dict.fromkeys(['renderer', 'mitsuba', 'embreex', "
        "'pipeline.references']));"
        "from pathlib import Path; from reports import write_report; print(write_report(Path(sys.argv[1]), "
        "Path(sys.argv[2])))"
    )
    command = [sys.executable, "-c", code, str(small_run), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(tmp_path / "index.html")


def test_the_viewer_holds_the_pictures_bit_for_bit(small_page: Path) -> None:
    data = book((small_page.parent / "assets" / "panel-1.js").read_text(encoding="utf-8"))
    assert data["names"] == [
        "reference",
        "area, independent",
        "area, sobol",
        "solid-angle, independent",
        "solid-angle, sobol",
        *(f"error of {n}" for n in range(2, 6)),
    ]
    raw = base64.b64decode(data["dataUrls"][0].removeprefix("data:;base64,"))
    shown = np.frombuffer(raw, dtype="<f2").reshape(HEIGHT, WIDTH, 3)
    assert np.array_equal(shown, truth().astype(np.float32).astype(np.float16))


def test_the_viewer_shows_both_ends_and_the_middle_of_a_parameter(small_page: Path) -> None:
    data = book((small_page.parent / "assets" / "panel-2.js").read_text(encoding="utf-8"))
    kinds = ("reference", "area", "solid-angle")
    assert data["names"] == [f"{kind}, gap {gap}" for gap in ("1", "0.01", "0.0001") for kind in kinds]


def test_the_viewer_keeps_what_is_no_number_and_what_halves_cannot_hold() -> None:
    """NaN and infinity have to be seen; a scene of radiance 1e-7 or 1e6 is not to turn black or white for
    want of bits.
    """
    image = np.full((2, 2, 3), 0.5)
    image[0, 0], image[0, 1] = np.nan, np.inf
    for scale, kind, code in ((1.0, "half", "<f2"), (1e-7, "single", "<f4"), (1e6, "single", "<f4")):
        data = book(flip_script("x", [Picture("a", image * scale)]))
        raw = base64.b64decode(data["dataUrls"][0].removeprefix("data:;base64,"))
        shown = np.frombuffer(raw, dtype=code).reshape(2, 2, 3)
        assert data["types"] == [kind]
        assert np.isnan(shown[0, 0]).all() and np.isposinf(shown[0, 1]).all()
        assert shown[1, 1] == pytest.approx(0.5 * scale, rel=1e-3)


def test_the_viewer_refuses_what_its_keys_do_not_reach() -> None:
    picture = Picture("a", np.ones((2, 2, 3)))
    with pytest.raises(ValueError, match="1 to 10 pictures"):
        flip_script("x", [])
    with pytest.raises(ValueError, match="1 to 10 pictures"):
        flip_script("x", [picture] * 11)
    with pytest.raises(ValueError, match="one size"):
        flip_script("x", [picture, Picture("b", np.ones((3, 2, 3)))])


@pytest.fixture
def copied(small_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(small_run, tmp_path / "run", ignore=shutil.ignore_patterns("report")))


def _scaled(path: Path) -> None:
    """Every value of a card times 100, in valid JSON."""
    card = json.loads(path.read_text())
    for score in card["scores"].values():
        score["value"] = None if score["value"] is None else 100 * score["value"]
    path.write_text(json.dumps(card))


def _flipped(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("part", "harm", "told"),
    [
        ("scores/score-samples-000/card.json", _scaled, "Not scored yet: 1 of 66 images"),
        ("scores/score-samples-000/error.exr", _flipped, "Not scored yet: 1 of 66 images"),
        ("cells/samples-000/image.exr", _flipped, "1 of 66 images missing"),
        ("cells/samples-000/image.exr", lambda path: path.write_bytes(b""), "1 of 66 images missing"),
        ("references/ref-soft/reference.exr", Path.unlink, "Not scored yet: 48 of 66 images"),
    ],
)
def test_damage_costs_its_own_cell_and_is_told(
    copied: Path, part: str, harm: Callable[[Path], object], told: str
) -> None:
    """Catches altered numbers that are printed, and one lost file that denies the whole report."""
    harm(copied / part)
    text = write_report(copied).read_text(encoding="utf-8")
    assert told in text
    assert "Damaged since they were written: 1 part of this run" in text
    assert (
        str(Path(part).parent) in text
        and ("is missing" if harm is Path.unlink else "not what was written") in text
    )
    assert "A small run" in text and "overflow" in text

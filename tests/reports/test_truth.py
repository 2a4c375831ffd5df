# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""The page against a checked-in store, recomputed from its images and records by code of its own.

`Truth` shares no code with the project: JSON, EXR by OpenImageIO, and plain NumPy. Every number must agree to
the three digits that the page shows. tests/kit/truth_store.py makes the store.
"""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from numpy.typing import NDArray

from pipeline.scoring.metric import METRICS, Estimate, Reference
from reports import write_report

Array = NDArray[np.float64]
STORE = Path(__file__).parent / "truth" / "store"
DIGITS = 0.0051  # relative: half a unit of the third digit of 1.00
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
T3 = 4.302652729749464  # Student's factor at 95 % for three replicates


def read_channels(path: Path, prefix: str = "") -> Array:
    """R, G and B of a file, (h, w, 3)."""
    pixels = oiio.ImageBuf(str(path))
    names = list(pixels.spec().channelnames)
    every = np.asarray(pixels.get_pixels(oiio.FLOAT), dtype=np.float64)
    return np.stack([every[..., names.index(prefix + c)] for c in "RGB"], axis=-1)


def student(values: list[float]) -> tuple[float, float, float]:
    """Mean of three replicates with the ends of its 95 % interval."""
    mean, half = float(np.mean(values)), T3 * float(np.std(values, ddof=1)) / math.sqrt(3)
    return mean, mean - half, mean + half


def fit(rows: list[Truth]) -> tuple[float, float]:
    """The slope of log RMSE over log wall seconds, all points alike, and its standard error."""
    x, y = np.log([r.seconds[0] for r in rows]), np.log([r.rmse[0] for r in rows])
    x, y = x - x.mean(), y - y.mean()
    slope = float(x @ y / (x @ x))
    return slope, math.sqrt(float(np.sum((y - slope * x) ** 2)) / (len(rows) - 2) / float(x @ x))


@dataclass
class Truth:
    """The replicates of one row: value, low, high of each number. trusted: none of them is doubted."""

    estimator: str
    place: float
    trusted: bool
    doubted: int
    records: list[dict[str, Any]]
    mse: tuple[float, float, float]
    relmse: tuple[float, float, float]
    bias: tuple[float, float, float]
    seconds: tuple[float, float, float]

    @property
    def rmse(self) -> tuple[float, float, float]:
        value, low, high = (math.sqrt(max(x, 0.0)) for x in self.mse)
        return value, low, high

    @property
    def efficiency(self) -> tuple[float, float, float]:
        """1 / (MSE x wall seconds); the ends add up in quadrature on the log scale, each side for itself."""
        value = 1.0 / (self.mse[0] * self.seconds[0])
        tops = [math.log(x[2] / x[0]) for x in (self.mse, self.seconds)]
        feet = [math.log(x[0] / x[1]) if x[1] > 0 else math.inf for x in (self.mse, self.seconds)]
        return value, value * math.exp(-math.hypot(*tops)), value * np.exp(math.hypot(*feet))


def read_store() -> dict[str, list[Truth]]:
    """Every row of the two studies, in the order of the sweep."""
    manifest = json.loads((STORE / "manifest.json").read_text(encoding="utf-8"))
    found: dict[str, list[Truth]] = {}
    for study in manifest["studies"]:
        rows: dict[tuple[str, float], list[tuple[dict[str, Any], Array, Array, Array]]] = {}
        for entry in study["cells"]:
            record = json.loads((STORE / "cells" / entry["key"] / "record.json").read_text(encoding="utf-8"))
            card = json.loads((STORE / "scores" / entry["score"] / "card.json").read_text(encoding="utf-8"))
            job, path = record["job"], STORE / card["reference"]["image"]
            place = float(job["spp"] if study["name"] == "samples" else job["parameters"]["gap"])
            assert card["reference"]["batches"] == 0  # deterministic: nothing is subtracted
            image, truth = read_channels(STORE / record["image"]), read_channels(path)
            rows.setdefault((job["estimator"], place), []).append((record, image, truth, image - truth))
        order = ("area", "solid-angle")
        found[study["name"]] = [
            _row(name, place, rows[name, place])
            for name in order
            for place in dict.fromkeys(p for n, p in rows if n == name)
        ]
    return found


def _row(estimator: str, place: float, cells: list[tuple[dict[str, Any], Array, Array, Array]]) -> Truth:
    records = [record for record, *_ in cells]
    doubted = sum(record["statistics"]["verdict"] != "ok" for record in records)
    return Truth(
        estimator,
        place,
        doubted == 0,
        doubted,
        records,
        _clip(student([float(np.mean(d**2)) for *_, d in cells])),
        _clip(student([float(np.mean(d**2 / (r**2 + 0.01))) for _, _, r, d in cells])),
        student([float(np.mean(d)) for *_, d in cells]),
        student([record["seconds"]["render"] for record in records]),
    )


def _clip(found: tuple[float, float, float]) -> tuple[float, float, float]:
    return found[0], max(found[1], 0.0), found[2]


def number(text: str) -> float:
    """A number as the page writes it: 1.23×10⁻⁴, −0.5, 1,234, 1.54 k, ∞."""
    text = text.strip().replace(",", "").translate(SUPERSCRIPTS)
    unit = {"k": 1e3, "M": 1e6}.get(text[-1], 1.0)
    text = text.rstrip("kM").strip()
    if text == "∞":
        return math.inf
    mantissa, _, exponent = text.partition("×10")
    return float(mantissa) * 10.0 ** int(exponent or 0) * unit


def tables(text: str) -> list[list[dict[str, tuple[str, str, str]]]]:
    """Every table: rows of {heading: (text, range, title)}."""
    found: list[list[dict[str, tuple[str, str, str]]]] = []
    for table in re.findall(r"<table[^>]*>(.*?)</table>", text, re.S):
        heads = [re.sub(r"<[^>]*>", " ", h).strip() for h in re.findall(r"<th[^>]*>(.*?)</th>", table, re.S)]
        rows = [
            re.findall(r"<td([^>]*)>(.*?)</td>", row, re.S) for row in re.findall(r"<tr.*?</tr>", table, re.S)
        ]
        found.append([dict(zip(heads, map(_cell, row), strict=True)) for row in rows if row])
    return found


def _cell(found: tuple[str, str]) -> tuple[str, str, str]:
    title = re.search(r'title="([^"]*)"', found[0])
    shown, _, small = found[1].partition('<div class="range">')
    plain = [unescape(re.sub(r"<[^>]*>", "", part)).strip() for part in (shown, small)]
    return plain[0], plain[1], unescape(title.group(1)) if title else ""


def plot(text: str, anchor: str) -> list[dict[str, Any]]:
    """The traces that a figure is given."""
    start = re.search(rf'Plotly\.newPlot\(\s*"{anchor}",\s*', text)
    assert start
    return json.JSONDecoder().raw_decode(text, start.end())[0]


def agrees(shown: str, small: str, truth: tuple[float, float, float], scale: float = 1.0) -> None:
    """Value and interval of one cell of a table."""
    assert number(shown) == pytest.approx(truth[0] / scale, rel=DIGITS)
    ends = [number(end) for end in small.split(" to ")]
    for end, expected in zip(ends, truth[1:], strict=True):
        assert end == pytest.approx(expected / scale, rel=DIGITS, abs=1e-12)


@pytest.fixture(scope="module")
def truth() -> dict[str, list[Truth]]:
    return read_store()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(STORE, tmp_path_factory.mktemp("truth"))


@pytest.fixture(scope="module")
def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def error_rows(text: str, study: str) -> list[dict[str, tuple[str, str, str]]]:
    """The table of errors of a study."""
    return [t for t in tables(text) if t and "RMSE W/(m² sr)" in t[0]][("samples", "gap").index(study)]


def heading(row: dict[str, tuple[str, str, str]], start: str) -> str:
    return next(name for name in row if name.startswith(start))


@pytest.mark.parametrize("study", ["samples", "gap"])
def test_every_number_of_the_table_of_errors(truth: dict[str, list[Truth]], text: str, study: str) -> None:
    """Catches CPU seconds for wall (they differ 5 times), a unit of efficiency off by a power of ten, and a
    verdict of the best replicate (one row has one good and two bad ones).
    """
    rows = error_rows(text, study)
    assert len(rows) == len(truth[study]) >= 4
    for row, true in zip(rows, truth[study], strict=True):
        assert row["estimator"][0] == true.estimator
        assert number(row["spp" if study == "samples" else "gap"][0]) == true.place
        assert abs(true.seconds[0] / np.mean([r["seconds"]["cpu"] for r in true.records]) - 5.25) < 0.5
        assert number(row["time s"][0]) == pytest.approx(true.seconds[0], rel=DIGITS)
        ends = [number(x) for x in row["time s"][2].removeprefix("95 %: ").removesuffix(" s").split(" to ")]
        assert ends == pytest.approx(list(true.seconds[1:]), rel=DIGITS)
        primary, shadow = (np.mean([r["rays"][kind] for r in true.records]) for kind in ("primary", "shadow"))
        rays = row[heading(row, "rays")]
        assert number(rays[0]) == pytest.approx(primary, rel=DIGITS)
        assert number(rays[1].removeprefix("+ ")) == pytest.approx(shadow, rel=DIGITS, abs=1)
        verdict = row["verdict"]
        if not true.trusted:
            assert (verdict[0], verdict[1]) == ("untrustworthy", f"{true.doubted} of 3 images")
            assert all(row[heading(row, name)][0] == "–" for name in ("RMSE", "relMSE", "efficiency"))
            continue
        assert verdict[0] == "ok"
        agrees(*row[heading(row, "RMSE")][:2], true.rmse)
        agrees(*row[heading(row, "relMSE")][:2], true.relmse)
        if study == "samples":
            agrees(*row[heading(row, "Bias")][:2], true.bias)
        head = heading(row, "efficiency")
        power = re.search(r"10([⁰¹²³⁴⁵⁶⁷⁸⁹⁻]*)/\(MSE", head)
        unit = 10.0 ** int(power.group(1).translate(SUPERSCRIPTS)) if power else 1.0
        agrees(*row[head][:2], true.efficiency, unit)


def test_what_the_samples_say_is_the_worst_replicates(truth: dict[str, list[Truth]], text: str) -> None:
    rows = next(t for t in tables(text) if t and any(head.startswith("tail index") for head in t[0]))
    for row, true in zip(rows, truth["gap"], strict=True):
        said = [record["statistics"] for record in true.records]
        worst = min(said, key=lambda s: (s["verdict"] == "ok", s["hill"]))
        assert row["verdict"][0] == worst["verdict"]
        assert number(row[heading(row, "tail")][0]) == pytest.approx(worst["hill"], rel=DIGITS)
        assert number(row[heading(row, "largest")][0]) == pytest.approx(worst["max_share"], rel=DIGITS)
        assert row[heading(row, "because")][0] == worst["reason"]


@pytest.mark.parametrize(("study", "anchor"), [("samples", "panel-1-plot"), ("gap", "panel-2-plot")])
def test_every_plotted_point(truth: dict[str, list[Truth]], text: str, study: str, anchor: str) -> None:
    """Catches CPU seconds on the axis, error bars that are half as long, and a number for refused points."""
    traces = [t for t in plot(text, anchor) if t["mode"] == "lines+markers"]
    assert len(traces) == 2
    for trace, estimator in zip(traces, ("area", "solid-angle"), strict=True):
        assert trace["name"].startswith(estimator)
        rows = [row for row in truth[study] if row.estimator == estimator and row.trusted]
        rows.sort(key=lambda row: row.place)
        x = [row.seconds[0] if study == "samples" else row.place for row in rows]
        assert trace["x"] == pytest.approx(x)
        assert trace["y"] == pytest.approx([row.rmse[0] for row in rows], rel=1e-5)
        bars = trace["error_y"]
        assert bars["array"] == pytest.approx([row.rmse[2] - row.rmse[0] for row in rows], rel=1e-4)
        for bar, row in zip(bars["arrayminus"], rows, strict=True):
            if row.rmse[1] > 0:  # an end at 0 stops at the axis
                assert bar == pytest.approx(row.rmse[0] - row.rmse[1], rel=1e-4)


def test_halving_costs_and_ratios_in_sentences(truth: dict[str, list[Truth]], text: str) -> None:
    for estimator in ("area", "solid-angle"):
        rows = [row for row in truth["samples"] if row.estimator == estimator]
        slope, error = fit(rows)
        said = re.search(
            rf"{estimator} with independent samples: halving the error costs ([^ ]+) "
            r"\(.*?slope ([^ ]+) ± ([^ ,]+)",
            text,
            re.IGNORECASE,
        )
        assert said
        assert number(said.group(1)) == pytest.approx(2 ** (-1 / slope), rel=DIGITS)
        assert number(said.group(2)) == pytest.approx(slope, abs=6e-4)
        assert number(said.group(3)) == pytest.approx(error, abs=6e-4)
    last = {row.estimator: row for row in truth["samples"] if row.place == 32}
    ratio = last["solid-angle"].efficiency[0] / last["area"].efficiency[0]
    told = re.search(r"solid-angle was ([^ ]+) \([^)]*\) times as efficient as area", text)
    assert told and number(told.group(1)) == pytest.approx(ratio, rel=DIGITS)


def test_the_share_of_shadow_rays_in_sentences(truth: dict[str, list[Truth]], text: str) -> None:
    """Catches a share that is turned round: shadow rays are a third of the primary ones here."""
    records = [record for rows in truth.values() for row in rows for record in row.records]
    primary, shadow = (sum(r["rays"][kind] for r in records) for kind in ("primary", "shadow"))
    told = re.search(r"([^ >]+ [kM]) primary rays needed ([^ ]+ [kM]) shadow rays, (\d+) % fewer", text)
    assert told and shadow < 0.4 * primary
    assert number(told.group(1)) == pytest.approx(primary, rel=DIGITS)
    assert number(told.group(2)) == pytest.approx(shadow, rel=DIGITS)
    assert int(told.group(3)) == round(100 * (1 - shadow / primary))


def test_scores_on_record_are_those_of_the_images() -> None:
    """Catches a relMSE whose denominator is the mean over channels; the images' channels differ."""
    cards = sorted(STORE.glob("scores/*/card.json"))
    assert len(cards) == 30
    for path in cards:
        card = json.loads(path.read_text(encoding="utf-8"))
        r = read_channels(STORE / card["reference"]["image"])
        noise = read_channels(STORE / card["reference"]["image"], "variance.")
        image = read_channels(STORE / "cells" / card["cell"] / "image.exr")
        squared = (image - r) ** 2
        expected = {"mse": np.mean(squared), "relmse": np.mean(squared / (r**2 + 0.01))}
        for name, value in expected.items():
            assert card["scores"][name]["value"] == pytest.approx(value, rel=1e-5)
            found = METRICS[name](Estimate(image), Reference(r, noise, 0)).score.value
            assert found == pytest.approx(value, rel=1e-9)


def test_the_first_screen(truth: dict[str, list[Truth]], text: str) -> None:
    """Catches a headline or a card with another number, and a doubt that counts no single image."""
    rows = truth["samples"]
    last = {row.estimator: row for row in rows if row.place == 32}
    ratio = last["solid-angle"].efficiency[0] / last["area"].efficiency[0]
    told = re.search(r'class="answer">[^<]*?solid-angle is ([^ ]+) \([^)]*\) times', text)
    assert told and number(told.group(1)) == pytest.approx(ratio, rel=DIGITS)
    area = [row for row in rows if row.estimator == "area"]
    slope, _ = fit(area)
    records = [record for study in truth.values() for row in study for record in row.records]
    primary, shadow = (sum(r["rays"][kind] for r in records) for kind in ("primary", "shadow"))
    doubted = sum(r["statistics"]["verdict"] != "ok" for r in records)
    cards = [shown.strip() for shown in re.findall(r'class="figure">([^<]*)<', text)]
    assert number(cards[0].removesuffix("×")) == pytest.approx(2 ** (-1 / slope), rel=DIGITS)
    assert cards[1:] == [f"{doubted} of {len(records)}", f"{100 * (1 - shadow / primary):.0f} %"]
    assert doubted == 2


def test_the_pictures_of_the_first_screen(truth: dict[str, list[Truth]], text: str) -> None:
    """Catches best and worst that are swapped, and an error that is another image's."""
    at = sorted((row for row in truth["samples"] if row.place == 8), key=lambda row: row.rmse[0])
    names = re.findall(r'hero-\d.png"[^>]*alt="([^"]*)"', text)
    assert [name.split(",")[0] for name in names] == [
        "reference",
        f"best: {at[0].estimator}",
        f"worst: {at[-1].estimator}",
        "its error",
    ]
    for name, row in ((names[1], at[0]), (names[2], at[-1])):
        assert number(name.split("RMSE ")[1]) == pytest.approx(row.rmse[0], rel=DIGITS)


def test_every_number_of_the_csv(truth: dict[str, list[Truth]], page: Path) -> None:
    """Catches a number given for a refused point, CPU seconds, and rays that are turned round."""
    rows = list(csv.DictReader((page.parent / "data.csv").read_text(encoding="utf-8").splitlines()))
    expected = [(study, row) for study, found in truth.items() for row in found]
    assert len(rows) == len(expected) == 10
    for row, (study, true) in zip(rows, expected, strict=True):
        assert (row["study"], row["estimator"], float(row["x"])) == (study, true.estimator, true.place)
        assert row["verdict"] == ("ok" if true.trusted else "untrustworthy")
        for name, triple in (("rmse", true.rmse), ("seconds", true.seconds), ("efficiency", true.efficiency)):
            shown = [row[name], row[f"{name}_low"], row[f"{name}_high"]]
            if not true.trusted and name != "seconds":
                assert shown == ["", "", ""]
            else:
                assert [float(x) for x in shown] == pytest.approx(list(triple), rel=1e-4)
        for kind in ("primary", "shadow"):
            mean = np.mean([record["rays"][kind] for record in true.records])
            assert float(row[f"{kind}_rays"]) == pytest.approx(mean, abs=1)

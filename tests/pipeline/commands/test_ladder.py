"""`penumbra ladder` on the command line: rows of JSON that say what the issue of each rung is, and wrong
use.
"""

from __future__ import annotations

import json
import math

import pytest

from pipeline.cli import main

KEYS = {
    "light",
    "geometry",
    "estimator",
    "h",
    "truth",
    "mean",
    "se",
    "max_share",
    "hill",
    "nonfinite",
    "verdict",
}


def test_json_is_a_list_of_rows_and_nothing_else(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["ladder", "--light", "rectangle", "--samples", "200", "--json", "--quiet"])
    assert stop.value.code in (0, None)
    rows = json.loads(capsys.readouterr().out, parse_constant=lambda text: pytest.fail(f"{text} is no JSON"))
    assert {row["light"] for row in rows} == {"rectangle"} and {row["geometry"] for row in rows} == {
        "parallel",
        "upright",
    }
    assert all(row.keys() >= KEYS and row["verdict"] in ("ok", "untrustworthy", "refused") for row in rows)
    for row in rows:
        numbers = [row[key] for key in ("mean", "se", "max_share")]
        refused = row["verdict"] == "refused"
        assert all(x is None if refused else isinstance(x, float) and math.isfinite(x) for x in numbers), row
        assert row["hill"] is None or math.isfinite(row["hill"])
    assert {row["verdict"] for row in rows if row["estimator"] == "area" and row["h"] < 1e-3} == {
        "untrustworthy"
    }


def test_an_unknown_light_is_told(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["ladder", "--light", "cube"])
    assert stop.value.code == 2
    assert (
        "no ladder for light 'cube'; there are: rectangle, disk, sphere, triangle" in capsys.readouterr().err
    )


def test_a_ladder_fits_a_screen_and_tells_where_area_sampling_fails(capsys):
    with pytest.raises(SystemExit):
        main(["ladder", "--samples", "500", "--quiet", "--estimator", "area", "--estimator", "solid-angle"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 12
    area, solid = (
        next(line for line in lines if f"│ {name} " in line).split("│") for name in ("area", "solid-angle")
    )
    assert [cell.strip() for cell in solid[2:6]] == ["1e-08 / 1e-08"] * 4
    assert all(float(end) >= 1e-3 for cell in area[2:6] for end in cell.split("/"))
    assert 0 < float(solid[6].split()[0]) < 4.5  # 72 rungs: a false alarm in 1 of 2,000 runs


def test_estimators_of_another_quantity_have_no_ladder(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["ladder", "--estimator", "ambient-occlusion"])
    assert stop.value.code == 2
    assert "no ladder for estimator 'ambient-occlusion'" in capsys.readouterr().err

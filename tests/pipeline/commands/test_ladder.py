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

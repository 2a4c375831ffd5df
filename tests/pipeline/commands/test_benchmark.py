"""The benchmark of reading scene text: what it prints is a size, a time and their quotient."""

from __future__ import annotations

import json

import pytest

from benchmarks.scene_text import benchmark
from pipeline.console.command import script


def test_a_small_scene_is_read_and_timed(capsys):
    with pytest.raises(SystemExit) as stop:
        script(benchmark, ["--megabytes", "1", "--rounds", "2", "--json", "--quiet"])
    assert stop.value.code in (0, None)
    found = json.loads(capsys.readouterr().out)
    assert 0.8 < found["megabytes"] < 1.2 and found["seconds"] > 0
    assert found["megabytes_per_second"] == pytest.approx(found["megabytes"] / found["seconds"])

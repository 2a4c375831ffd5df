"""`render` names the argument that is wrong, and what it may be."""

from __future__ import annotations

import pytest

from renderer import render
from scenes.errors import PenumbraError
from tests.kit.scenes import floor, patch, scene

SCENE = scene([floor(), patch((-1, 2, -1), (2, 0, 0), (0, 0, 2), (1, 1, 1), reverse=True)], width=4, height=3)


@pytest.mark.parametrize(("name", "least"), [("spp", 1), ("seed", 0), ("threads", 1), ("rows", 1)])
def test_numbers_have_a_least_value(name: str, least: int) -> None:
    with pytest.raises(PenumbraError, match=f"^{name} is {least - 1}: .* at least {least}"):
        render(SCENE, **{name: least - 1})
    render(SCENE, **{"spp": 1, name: least})


@pytest.mark.parametrize(("name", "registered"), [("estimator", "mis"), ("sampler", "sobol")])
def test_names_that_nobody_has_are_answered_with_those_that_there_are(name: str, registered: str) -> None:
    with pytest.raises(PenumbraError, match=f"unknown {name} 'nobody'; there are: .*{registered}"):
        render(SCENE, **{name: "nobody"})

"""`render` names the argument that is wrong, and what it may be."""

from __future__ import annotations

import pytest

from renderer import render
from renderer.render import _check_prunings, _check_types
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


def test_an_unknown_pruning_is_answered_with_those_that_there_are() -> None:
    with pytest.raises(PenumbraError, match=r"unknown pruning 'horizons' in keep; there are: .*horizon"):
        render(SCENE, spp=1, keep=frozenset({"horizon", "horizons"}))
    render(SCENE, spp=1, keep=frozenset({"horizon"}))


# The checks themselves: beartype, which the tests run under, answers a wrong type before `render` could.
RIGHT = {"scene": SCENE, "estimator": "mis", "sampler": "sobol", "prune": True, "progress": None}


@pytest.mark.parametrize(
    ("name", "wrong"),
    [("scene", "soft-shadow"), ("estimator", 3), ("sampler", None), ("prune", 1), ("progress", 0.5)],
)
def test_an_argument_of_a_wrong_type_is_named(name: str, wrong: object) -> None:
    _check_types(**RIGHT)
    with pytest.raises(PenumbraError, match=f"^{name} is {wrong!r}: it must be "):
        _check_types(**{**RIGHT, name: wrong})


def test_prunings_come_as_a_set() -> None:
    for wrong in ("horizon", ["horizon"], None):
        with pytest.raises(PenumbraError, match=r"^keep is .*: it must be a set of prunings, of emission, "):
            _check_prunings(wrong)

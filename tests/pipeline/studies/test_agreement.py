"""The agreement matrix: on every library scene all unbiased estimators agree, with each other and with
Mitsuba.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import scenes
from pipeline.cli import main
from pipeline.references.cache import reference_for
from pipeline.references.protocol import BACKENDS, ReferenceRequest
from pipeline.studies.agreement import agreement
from renderer.interfaces.estimator import ESTIMATORS
from scenes.errors import PenumbraError

SMALL = {"xresolution": 32.0, "yresolution": 24.0}
LARGE = {"xresolution": 80.0, "yresolution": 60.0}
# Lamps in view: their outlines hold nearly all of the noise at so few pixels, and no claim is made of what
# would have been seen.
IN_VIEW = {"cornell-direct", "many-lights", "veach-mis"}
# Nothing is lit in it, by design: every image is exactly 0.
DARK = {"sealed-box"}


def found(name: str, size: dict[str, float], spp: int, root) -> tuple[dict[tuple[str, str], float], float]:
    """The smallest bias that each pair would have shown, once all pairs agree; and how the least noisy pair
    did.
    """
    scene = scenes.load(name, size)
    reference = None
    if BACKENDS["mitsuba"].refuses(scene) is None:
        reference = (
            "mitsuba",
            reference_for(scene, "mitsuba", ReferenceRequest(spp=16 * spp, batches=64), root).image,
        )
    matrix = agreement(scene, spp=spp, seed=5, threads=2, alpha=1e-3, reference=reference)
    for pair in matrix.pairs:
        assert pair.agree, f"{name}: {pair}"
    ok = {m.name for m in matrix.members if m.verdict == "ok"}
    assert "mis" in ok, [m for m in matrix.members if m.verdict == "untrustworthy"]
    power = {(p.a, p.b): p.smallest_detectable for p in matrix.pairs}
    best = min(power.values())
    print(
        f"{name}: {len(power)} pairs of {sorted(ok)} with {reference and reference[0]}; smallest bias seen "
        f"{best:.2%}"
    )
    return power, best


@pytest.mark.parametrize("name", [entry.name for entry in scenes.library()])
@pytest.mark.usefixtures("statistical")
def test_all_estimators_agree_on_every_scene(name, shared_references):
    """0.1 % of false alarms a scene. The least noisy pair of each scene would have shown a bias of the image
    mean of 3 %,
    lamps in view excepted."""
    _, best = found(name, SMALL, 64, shared_references)
    assert name in DARK | IN_VIEW or best < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("name", [entry.name for entry in scenes.library()])
@pytest.mark.usefixtures("statistical")
def test_all_estimators_agree_closely(name, shared_references):
    """As above with 6 times the pixels and 8 times the samples."""
    _, best = found(name, LARGE, 512, shared_references)
    assert name in DARK | IN_VIEW or best < 0.006


@pytest.mark.usefixtures("statistical")
def test_a_wrong_estimator_is_told_from_all_others(monkeypatch):
    """A solid-angle pdf that is 2 % too large: every pair of `solid-angle` with a quiet one differs, no other
    does.
    """
    from renderer.estimators import light_sampling

    right = light_sampling.by_light

    def wrong(scene, plan, hit, u, *preferred):
        result = right(scene, plan, hit, u, *preferred)
        return (
            type(result)(result.radiance / 1.02, result.shadow_rays)
            if preferred == ("solid-angle",)
            else result
        )

    monkeypatch.setattr(light_sampling, "by_light", wrong)
    names = ["solid-angle", "projected-solid-angle", "mis", "area"]
    matrix = agreement(scenes.load("soft-shadow", LARGE), estimators=names, spp=256, seed=5, threads=2)
    assert not matrix.agree
    assert {frozenset((p.a, p.b)) for p in matrix.pairs if not p.agree} == {
        frozenset(("solid-angle", other)) for other in names[1:]
    }


@pytest.mark.usefixtures("statistical")
def test_seeds_and_intervals_are_what_they_say():
    """95 % intervals of pairs of equals hold 0 in 90 to 99 % of 10 seeds x 6 pairs."""
    scene = scenes.load("sphere-light", SMALL)
    names = ["solid-angle", "mis", "mis-balance", "analytic-visibility-unbiased"]
    inside = [
        p.low <= 0 <= p.high
        for seed in range(10)
        for p in agreement(scene, estimators=names, spp=32, seed=100 * seed).pairs
    ]
    assert np.mean(inside) > 0.85


def test_what_cannot_be_compared_is_told():
    scene = scenes.load("soft-shadow", SMALL)
    with pytest.raises(PenumbraError, match="a ratio of means"):
        agreement(scene, estimators=["mis", "analytic-visibility"])
    with pytest.raises(PenumbraError, match="at least 16"):
        agreement(scene, spp=4)
    with pytest.raises(PenumbraError, match="'mis' is given more than once"):
        agreement(scene, estimators=["mis", "area", "mis"], spp=16)
    with pytest.raises(PenumbraError, match="fewer than two"):
        agreement(scene, estimators=["mis", "environment"], spp=16)


def test_regions_are_tested_against_a_closed_form_and_the_one_that_differs_is_named(monkeypatch):
    """Sampling the light's area near the floor, parts of which see no light: no difference.

    A light twice as bright on the right is one.
    """
    scene = scenes.load("touching-light", SMALL | {"gap": 0.01})
    exact = ("closed-form", BACKENDS["closed-form"].render(scene, ReferenceRequest()))
    for seed in range(6):
        matrix = agreement(
            scene, estimators=["area", "solid-angle"], spp=32, seed=10 * seed, alpha=1e-3, reference=exact
        )
        assert matrix.agree, matrix.pairs
    right = changeable(exact[1])
    right.mean[18:, 24:] *= 1.05
    matrix = agreement(
        scene, estimators=["solid-angle"], spp=256, alpha=1e-3, reference=("closed-form", right)
    )
    (pair,) = matrix.pairs
    assert not pair.agree and pair.where == "row 4 of 4, column 4 of 4"


def changeable(image):
    """A copy that may be changed."""
    return replace(image, mean=image.mean.copy())


def test_one_pair_is_spoken_of_as_one_and_what_is_not_finite_is_null(capsys):
    """Nothing is lit in a sealed box: both images are black, and there is no relative difference."""
    command = ["agreement", "sealed-box", "-D", "xresolution=16", "-D", "yresolution=12", "--spp", "16"]
    chosen = ["--estimator", "mis", "--estimator", "bsdf", "--reference", "none", "--quiet"]
    for more in ([], ["--json"]):
        with pytest.raises(SystemExit) as stop:
            main([*command, *chosen, *more])
        assert stop.value.code in (0, None)
    text, data = capsys.readouterr().out.split("{", 1)
    assert "the pair agrees" in text
    (pair,) = json.loads("{" + data, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))["pairs"]
    assert pair["difference"] is None and pair["agree"] is True


def test_the_command_prints_the_matrix_and_tells_by_its_exit_code(capsys):
    size = ["-D", "xresolution=16", "-D", "yresolution=12"]
    chosen = ["--estimator", "mis", "--estimator", "solid-angle", "--reference", "none", "--spp", "32"]
    with pytest.raises(SystemExit) as stop:
        main(["agreement", "soft-shadow", *size, *chosen, "--json", "--quiet"])
    assert stop.value.code in (0, None)
    data = json.loads(capsys.readouterr().out)
    assert data["agree"] is True and [m["name"] for m in data["members"]] == ["mis", "solid-angle"]
    (pair,) = data["pairs"]
    assert pair["low"] <= pair["difference"] <= pair["high"] and 0 <= pair["p"] <= 1
    assert set(ESTIMATORS.names()) > {"mis", "solid-angle"}


def test_the_summary_tells_what_was_left_out_and_how_much_it_could_see(capsys):
    """`area` near a floor cannot be trusted, and 16 samples a pixel show no small bias."""
    line = (
        "agreement touching-light -D gap=0.01 -D xresolution=32 -D yresolution=24 --reference none --spp 16 "
        "--estimator area --estimator mis --estimator bsdf --estimator environment"
    )
    with pytest.raises(SystemExit) as stop:
        main(line.split())
    out, err = capsys.readouterr()
    assert stop.value.code == 0
    lines = out.splitlines()
    assert "left out, since their own samples cannot tell their error: area" in lines
    assert "left out, since they do not apply to the scene: environment" in lines
    (row,) = (line.split("│") for line in lines if "│ agree" in line)
    seen = row[6].strip()
    assert lines[-1].startswith(
        f"the pair agrees; they would have shown a bias of {seen} at best, {seen} at worst"
    )
    assert ("could not see 5%" in lines[-1]) == (float(seen[:-1]) > 5)
    assert "4/4" in err

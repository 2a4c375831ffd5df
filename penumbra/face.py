"""The functions of the public face, each put together from the packages below."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penumbra.shown import Render, Scores
from pipeline.backends import BACKENDS
from pipeline.progress import Silence
from pipeline.references import default_cache
from pipeline.references.cache import StoredReference, reference_for
from pipeline.references.protocol import ReferenceRequest
from pipeline.run.driver import Summary, run_sweep
from pipeline.run.executors.local import LocalExecutor
from pipeline.schema.sweep import load_sweep
from pipeline.scoring.metric import Estimate, Reference
from pipeline.scoring.scores import score
from pipeline.self_reference import judges_itself
from pipeline.studies.images import Judgement, judge_images
from pipeline.studies.verify import Trial, Verification, region_masks
from pipeline.studies.verify import verify as verify_estimator
from renderer import build
from renderer import render as render_scene
from renderer.interfaces.estimator import ESTIMATORS
from reports import write_report
from scenes import SceneDescription
from scenes import load as load
from scenes.errors import PenumbraError

Image = NDArray[np.float64]

AT_LEAST, TIMES = 1024, 16  # samples a pixel of the reference that judges a render, and times the render's


def render(
    scene: str | SceneDescription,
    *,
    estimator: str | None = None,
    sampler: str | None = None,
    spp: int | None = None,
    seed: int | None = None,
    threads: int = 1,
) -> Render:
    """Render the direct light of a scene, which may be given by library name or path.

    An option that is None takes the scene's own value; the estimator is else `mis`. PenumbraError if the
    estimator does not apply to the scene.

        image = pn.render("soft-shadow", estimator="solid-angle", spp=64)
        plt.imshow(image.image.clip(0, 1))
    """
    described = _described(scene)
    own = described.defaults
    chosen, drawn = estimator or own.estimator or "mis", sampler or own.sampler
    samples = own.spp if spp is None else spp
    result = render_scene(
        described,
        estimator=chosen,
        sampler=drawn,
        spp=samples,
        seed=own.seed if seed is None else seed,
        threads=threads,
    )
    return Render(described.name, chosen, drawn, samples, result)


def reference(
    scene: str | SceneDescription,
    *,
    backend: str = "mitsuba",
    spp: int = 1024,
    target: float | None = None,
    cache: Path | None = None,
) -> StoredReference:
    """A reference image with the variance of its mean, from the cache or made now.

    target: the relative standard error to reach. `image.mean` and `image.variance` of the result are (h, w,
    3).

        truth = pn.reference("touching-light", backend="closed-form")
        plt.imshow(truth.image.mean.clip(0, 1))
    """
    described = _described(scene)
    ambient = described.defaults.estimator == "ambient-occlusion"
    request = ReferenceRequest(
        spp=spp, quantity="ambient-occlusion" if ambient else "radiance", target=target
    )
    return reference_for(described, BACKENDS[backend].name, request, cache or default_cache())


def compare(
    image: Render | Image, truth: StoredReference | Image, metrics: Iterable[str] | None = None
) -> Scores:
    """Score an image against a reference; metrics: every one if None.

    A bare array (h, w, 3) as the truth counts as exact.

        scores = pn.compare(image, truth, ["rmse", "relmse"])
        plt.errorbar(image.seconds, scores["rmse"].value, fmt="o")
    """
    found = score(_estimate(image), _truth(truth), metrics)
    return Scores({name: one.score for name, one in found.items()})


def judge(
    images: Image | Render | Sequence[Image | Render],
    truth: StoredReference | Image,
    *,
    alpha: float = 1e-3,
    bias: float = 0.01,
) -> Judgement:
    """Whether images, by any renderer, show a reference's picture; `verdict` and `reason` say how it went.

    images: replicates of other seeds, (h, w, 3) each, or one render. alpha: chance of a false alarm. bias:
    the relative bias that must have been caught for a verdict of "agrees".

        found = pn.judge([imread(f"seed{i}.exr") for i in range(8)], truth)
        assert found.verdict == "agrees", found.reason
    """
    several = list(images) if isinstance(images, Sequence) else [images]
    return judge_images([_estimate(image) for image in several], _truth(truth), alpha, bias)


def verify(
    scene: str | SceneDescription,
    estimator: str = "mis",
    *,
    sampler: str = "independent",
    spp: int = 64,
    seed: int = 1,
    truth: StoredReference | None = None,
    backend: str = "mitsuba",
) -> Verification:
    """Test whether an estimator is unbiased on a scene; `verdict` and `reason` say how it went.

    truth: a reference of the same scene; one of 16 times the samples is made by the backend if None.

        found = pn.verify("sphere-light", "solid-angle")
        plt.imshow(found.tests[-1].p_map)
    """
    described = _described(scene)
    why = judges_itself(truth.backend if truth else BACKENDS[backend].name, estimator)
    if why:
        raise PenumbraError(why)
    if why := ESTIMATORS[estimator].refuses(described):
        raise PenumbraError(f"estimator {estimator!r} does not apply to scene {described.name!r}: {why}")
    if truth is None:
        quantity: Any = ESTIMATORS[estimator].quantity
        request = ReferenceRequest(max(AT_LEAST, TIMES * spp), quantity=quantity)
        truth = reference_for(described, backend, request, default_cache())
    built, threads = build(described), os.cpu_count() or 1
    trial = Trial(estimator, sampler, spp, seed)
    return verify_estimator(built, trial, truth.image, region_masks(built, threads), threads)


def check(scene: str | SceneDescription, estimator: str = "mis", **options: Any) -> Verification:
    """`verify` for a test suite: AssertionError with the reason unless the verdict is "unbiased".

    def test_my_estimator():
        pn.check("sphere-light", "solid-angle", spp=64)
    """
    found = verify(scene, estimator, **options)
    if found.verdict != "unbiased":
        raise AssertionError(f"{estimator}: {found.verdict}: {found.reason}")
    return found


def run(sweep: str, out: str | Path, *, workers: int | None = None) -> Summary:
    """Run a sweep, given by built-in name or path of a .toml file; results already in `out` are kept.

    A script that calls it starts processes, so that it needs `if __name__ == "__main__":`.

        summary = pn.run("soft-shadow-samples", "runs/first")
    """
    with LocalExecutor(workers or os.cpu_count() or 1) as executor:
        return run_sweep(sweep, load_sweep(sweep), Path(out), executor, Silence())


def report(folder: str | Path, out: str | Path | None = None) -> Path:
    """Write the report of a run; returns the path of its page.

    webbrowser.open(pn.report("runs/first").as_uri())
    """
    return write_report(Path(folder), Path(out) if out else Path(folder) / "report").resolve()


def _described(scene: str | SceneDescription) -> SceneDescription:
    return load(scene) if isinstance(scene, str) else scene


def _estimate(image: Render | Image) -> Estimate:
    if not isinstance(image, Render):
        return Estimate(image)
    film = image.result.film
    return Estimate(film.mean, image.variance, film.count.astype(np.float64), film.maximum)


def _truth(truth: StoredReference | Image) -> Reference:
    if isinstance(truth, StoredReference):
        return Reference(truth.image.mean, truth.image.variance, truth.image.batches)
    return Reference(truth, np.zeros_like(truth), 0)

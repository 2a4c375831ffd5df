"""A run folder whose truths are known: written through the store, as a real run is, from figures chosen here.

Study "samples" on soft-shadow: RMSE is SIGMA[estimator] / sqrt(spp) with independent samples and SIGMA / spp
with sobol, render time SECONDS x spp, so that slopes, costs and ratios are known exactly; the last sobol
point is an upper bound. Study "overflow" on touching-light: area is untrustworthy at all gaps but the first,
and its scores there are wrong on purpose (FORBIDDEN), as a score of an image that missed its light would be;
solid-angle holds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.manifest import CellEntry, LeftOut, Manifest, StudyEntry
from pipeline.schema.record import (
    Job,
    PlanDecision,
    Provenance,
    RayCounts,
    Record,
    ReferenceInfo,
    RegionScores,
    SampleStatistics,
    Score,
    ScoreCard,
    Seconds,
)
from pipeline.schema.sweep import Axes, ReferenceDeclaration, Study, Sweep
from pipeline.store.run_folder import Store
from pipeline.store.sealed_folder import write_entry
from scenes.images.exr import write_estimate_exr, write_exr

Array = NDArray[np.float64]

HEIGHT, WIDTH = 24, 32
SEEDS = 3
SPP = [1, 4, 16, 64]
GAPS = [1.0, 0.01, 0.0001]
SIGMA = {"area": 0.4, "solid-angle": 0.2}
SECONDS = {"area": 0.01, "solid-angle": 0.01}  # a sample of the whole image
SPREAD = 0.01  # relative, of MSE and time over the seeds, up and down: their means are exact
FORBIDDEN = 7.654321e-3  # the RMSE of an untrustworthy image; no page may show it
METRICS = ["mse", "relmse", "flip", "ssim", "umbra-leak"]
PIXELS = {"lit": 700, "umbra": 68}  # of each region; all error is in the lit one
LEAK = 3e-5
PLAN = [
    PlanDecision(
        effect="shadow rays to rectangle 0", needed=True, reason="3 shapes may lie between it and 5 receivers"
    ),
    PlanDecision(
        effect="lights seen by the camera", needed=False, reason="every light lies outside the view frustum"
    ),
]
LEFT_OUT = LeftOut(
    study="samples", scene="disk-light", what="solid-angle", reason="its method is still to come"
)


def truth(gap: float = 1.0) -> Array:
    """The reference picture: a ramp, (HEIGHT, WIDTH, 3), darker with the gap."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([x / WIDTH, y / HEIGHT, 0.5 * np.ones_like(x, dtype=np.float64)], axis=-1) + 0.1 * gap


def sweep() -> Sweep:
    """What the run was asked for."""
    axes = Axes(
        estimator=["area", "solid-angle"], sampler=["independent", "sobol"], spp=SPP, seeds=list(range(SEEDS))
    )
    gaps = Axes(
        estimator=["area", "solid-angle"],
        spp=[64],
        seeds=list(range(SEEDS)),
        parameters={"gap": GAPS, "width": [2.0]},
    )
    exact = ReferenceDeclaration(backend="closed-form")
    studies = [
        Study(
            name="samples", question="What does it cost?", scenes=["soft-shadow"], metrics=METRICS, axes=axes
        ),
        Study(
            name="overflow",
            scenes=["touching-light"],
            metrics=METRICS,
            over="gap",
            reference=exact,
            axes=gaps,
        ),
    ]
    return Sweep(title="A small run", description="Figures chosen, not measured.", study=studies)


def write_run(root: Path) -> Path:
    """Write the whole run into `root` and return it."""
    store, asked = Store(root), sweep()
    samples, overflow = (_entries(study) for study in asked.study)
    studies = [
        StudyEntry(name="samples", cells=samples, left_out=[LEFT_OUT]),
        StudyEntry(name="overflow", cells=overflow),
    ]
    root.mkdir(parents=True, exist_ok=True)
    store.write_manifest(Manifest(name="small", sweep=asked, studies=studies, provenance=provenance()))
    for entry in samples:
        _write(
            store,
            entry,
            _samples_rmse(entry.job),
            bound=entry.job.sampler == "sobol" and entry.job.spp == SPP[-1],
        )
    for entry in overflow:
        _write(store, entry, FORBIDDEN if doubtful(entry.job) else 0.02, bound=False)
    return root


def doubtful(job: Job) -> bool:
    """Whether the image of this job is untrustworthy."""
    return job.estimator == "area" and job.parameters.get("gap", 1.0) < 1.0


def provenance() -> Provenance:
    """What made it, said to be."""
    versions = {"numpy": "2.4.6", "mitsuba": "3.9.1"}
    return Provenance(
        penumbra="0.1.0",
        renderer="f" * 64,
        commit="0123abcd",
        versions=versions,
        python="3.11.0",
        machine="a machine",
        cores=2,
        created="2026-01-02T03:04:05+00:00",
    )


def _entries(study: Study) -> list[CellEntry]:
    axes = study.axes
    gaps = axes.parameters.get("gap", [None])
    jobs = [
        Job(
            scene=study.scenes[0],
            parameters={} if gap is None else {"gap": gap, "width": 2.0},
            estimator=estimator,
            sampler=sampler,
            spp=spp,
            seed=seed,
        )
        for seed in axes.seeds
        for gap in gaps
        for spp in axes.spp
        for sampler in axes.sampler
        for estimator in axes.estimator
    ]
    keys = [f"{study.name}-{number:03d}" for number in range(len(jobs))]
    return [CellEntry(key=key, job=job, score=f"score-{key}") for key, job in zip(keys, jobs, strict=True)]


def _samples_rmse(job: Job) -> float:
    return SIGMA[job.estimator] / (job.spp if job.sampler == "sobol" else job.spp**0.5)


def _write(store: Store, entry: CellEntry, rmse: float, bound: bool) -> None:
    """Record, image, reference and scores of one cell, its MSE and time off by SPREAD according to its
    seed.
    """
    job = entry.job
    off = 1.0 + SPREAD * (job.seed - (SEEDS - 1) / 2)
    reference = truth(job.parameters.get("gap", 1.0))
    noise = np.random.default_rng([job.seed, job.spp, len(job.estimator)]).normal(size=reference.shape)
    image = reference + rmse * noise
    record = _record(entry, SECONDS[job.estimator] * job.spp * off)
    variance = np.full_like(image, rmse**2)
    store.write_cell(record, lambda path: write_estimate_exr(path, image, variance, job.spp), {"mean": image})
    info = _write_reference(store, job, reference)
    error = np.sqrt(np.mean((image - reference) ** 2, axis=-1))
    card = ScoreCard(
        cell=entry.key,
        reference=info,
        scores=_scores(rmse**2 * off, bound),
        error_map=f"scores/{entry.score}/error.exr",
        regions=_regions(rmse**2 * off, bound),
    )
    store.write_score(entry.score, card, lambda path: write_exr(path, {"rmse": error}))


def _record(entry: CellEntry, seconds: float) -> Record:
    rays = WIDTH * HEIGHT * entry.job.spp
    return Record(
        key=entry.key,
        job=entry.job,
        scene_hash=f"{entry.job.scene}{entry.job.parameters}",
        width=WIDTH,
        height=HEIGHT,
        seconds=Seconds(load=0.1, build=0.05, plan=0.001, render=seconds, cpu=seconds),
        rays=RayCounts(primary=rays, shadow=0 if entry.job.parameters else rays // 2),
        statistics=_statistics(doubtful(entry.job)),
        plan=PLAN,
        image=f"cells/{entry.key}/image.exr",
        provenance=provenance(),
    )


def _statistics(heavy: bool) -> SampleStatistics:
    return SampleStatistics(
        noise=0.01,
        max_share=0.3 if heavy else 0.001,
        hill=1.1 if heavy else 5.0,
        nonfinite=0,
        verdict="untrustworthy" if heavy else "ok",
        reason="one sample of 1,000 carries 30% of the light"
        if heavy
        else "the largest sample carries 0.001 of the light",
    )


def _write_reference(store: Store, job: Job, image: Array) -> ReferenceInfo:
    key = f"ref-{job.parameters.get('gap', 'soft')}"
    path = store.root / "references" / key / "reference.exr"
    if not path.exists():
        variance = np.full_like(image, 1e-8)
        files = {path.name: lambda draft: write_estimate_exr(draft, image, variance, 4096)}
        write_entry(path.parent, store.scratch, files)
    return ReferenceInfo(
        backend="closed-form" if job.parameters else "mitsuba",
        key=key,
        spp=0 if job.parameters else 4096,
        batches=0 if job.parameters else 64,
        rms_standard_error=1e-4,
        seconds=12.5,
        image=path.relative_to(store.root).as_posix(),
    )


def _regions(mse: float, bound: bool) -> dict[str, RegionScores]:
    lit = mse * WIDTH * HEIGHT / PIXELS["lit"]
    black = {"mse": Score(metric="mse", value=0.0, low=0.0, high=0.0)}
    return {
        "lit": RegionScores(pixels=PIXELS["lit"], scores=_scores(lit, bound)),
        "umbra": RegionScores(pixels=PIXELS["umbra"], scores=black),
    }


def _scores(mse: float, bound: bool) -> dict[str, Score]:
    return {
        "mse": Score(metric="mse", value=mse, low=0.0 if bound else mse * 0.9, high=mse * 1.1, bound=bound),
        "relmse": Score(metric="relmse", value=2 * mse, low=1.8 * mse, high=2.2 * mse, bound=bound),
        "flip": Score(metric="flip", value=0.1),
        "umbra-leak": Score(metric="umbra-leak", value=LEAK, low=LEAK, high=LEAK),
        "ssim": Score(metric="ssim", value=None, note="the picture is smaller than the window"),
    }

"""The cell of a baseline: the scene rasterised by pyrender, stored and scored as any other."""

from __future__ import annotations

import numpy as np

from pipeline.baseline.entry import BIAS, fingerprint
from pipeline.baseline.process import Raster, rasterise
from pipeline.run.job import PreparedScene
from pipeline.schema.record import Job, RayCounts, Record, SampleStatistics, Seconds
from pipeline.store.keys import cell_key
from pipeline.store.provenance import provenance
from renderer.film import Film


def run_baseline(job: Job, scene: PreparedScene) -> tuple[Record, Film]:
    """Rasterise the scene of a baseline's job; PenumbraError if OpenGL does not work here.

    The film counts one sample a pixel, which is not random and has no variance. The seconds of building are
    those of making triangles; the start of a process for OpenGL is left out, as a render's warm-up is.
    """
    (drawn,) = rasterise([scene.built.description])
    image = drawn.image
    count = np.ones(image.shape[:2], dtype=np.int64)
    return _record(job, scene, drawn), Film(count, image, np.zeros_like(image), np.zeros_like(image))


def _record(job: Job, scene: PreparedScene, drawn: Raster) -> Record:
    key = cell_key(scene.hash, job, fingerprint())
    height, width = drawn.depth.shape
    made = provenance()
    times = {"load": scene.seconds_load, "build": drawn.seconds_convert, "plan": 0.0}
    nonfinite = int((~np.isfinite(drawn.image).all(axis=-1)).sum())
    return Record(
        key=key,
        job=job,
        scene_hash=scene.hash,
        width=width,
        height=height,
        seconds=Seconds(**times, render=drawn.seconds, cpu=drawn.cpu),
        rays=RayCounts(primary=0, shadow=0),
        statistics=SampleStatistics(
            noise=0.0, max_share=0.0, hill=None, nonfinite=nonfinite, verdict="ok", reason=BIAS
        ),
        plan=[],
        image=f"cells/{key}/image.exr",
        provenance=made.model_copy(update={"versions": made.versions | drawn.provenance}),
    )

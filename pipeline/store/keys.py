"""Content keys: the addresses of cells, scores, references and region maps.

A key covers all that its entry depends on: the content of the scene, the request, the code and the versions
of its libraries. This module imports neither renderer nor references; callers pass their versions. The code
of a reference is found by following its imports, so that none is forgotten.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path

from pipeline.schema.record import SCHEMA_VERSION, Job
from scenes.hashing import hash_code, hash_values
from scenes.imports import imported_files

ROOT = Path(__file__).parents[2]
FOLLOWED = ("pipeline.references", "scenes")
REFERENCE_LIBRARIES = ("numpy", "scipy", "trimesh")
METRIC_LIBRARIES = ("numpy", "scipy", "scikit-image", "flip-evaluator", "simpleimageio", "colour-science")
DIGITS = 32  # of a SHA-256, in the names of folders
REFERENCE_FORMAT = 2  # entries of another layout are other entries


def cell_key(scene_hash: str, job: Job, renderer: str) -> str:
    """The address of a cell, which does not depend on the names of its scene and parameters.

    renderer: `image_fingerprint` of the job, or the baseline's own.
    """
    parts = (scene_hash, job.estimator, job.sampler, job.spp, job.seed, renderer, SCHEMA_VERSION)
    return hash_values(*parts)[:DIGITS]


def reference_key(scene_hash: str, backend: str, version: str, quantity: str, seed: int) -> str:
    """The address of a reference, which does not depend on the number of its samples.

    version: of the backend, with the hash of its code.
    """
    return hash_values(REFERENCE_FORMAT, scene_hash, backend, version, quantity, seed)[:DIGITS]


def score_key(cell: str, reference: str, request: object, metrics: Sequence[str], code: str) -> str:
    """The address of a cell's scores. cell, reference: their keys. code: `metrics_fingerprint()`."""
    return hash_values(cell, reference, request, metrics, code, SCHEMA_VERSION)[:DIGITS]


def region_key(scene_hash: str, renderer: str) -> str:
    """The address of a scene's label image, which depends on the code of the study of regions."""
    study = hash_code(ROOT, [ROOT / "pipeline/studies/regions.py"], ())
    return hash_values(scene_hash, renderer, study)[:DIGITS]


@functools.cache
def metrics_fingerprint() -> str:
    """SHA-256 over the sources of metrics, statistics and regions, and the versions of METRIC_LIBRARIES.

    If one of them changes, cells are scored again and not rendered. Metrics of plug-ins are not included.
    """
    own = [ROOT / "pipeline" / name for name in ("studies/regions.py", "run/worker.py")]
    folders = [ROOT / "pipeline" / name for name in ("metrics", "scoring", "statistics")]
    return hash_code(ROOT, [*own, *(path for one in folders for path in one.glob("*.py"))], METRIC_LIBRARIES)


@functools.cache
def imported_code(*files: Path) -> str:
    """16 digits of a SHA-256 over these files, those that they import, and REFERENCE_LIBRARIES."""
    return hash_code(ROOT, imported_files(files, ROOT, FOLLOWED), REFERENCE_LIBRARIES)[:16]

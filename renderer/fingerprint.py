"""Keys of the code that makes images: a cached image is used only while its code is unchanged."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from renderer.interfaces.estimator import ESTIMATORS
from renderer.interfaces.sampler import SAMPLERS
from scenes.hashing import hash_code, hash_values
from scenes.imports import imported_files

ROOT = Path(__file__).resolve().parent.parent
LIBRARIES = ("numpy", "scipy", "embreex", "trimesh")  # an image's bits depend on them as on our sources
# No other code of ours imports a module of these (an import contract): one of them counts for its own images.
PLUGGED = ("renderer.estimators", "renderer.samplers")


@cache
def fingerprint() -> str:
    """SHA-256 over the Python sources of `renderer` and `scenes`, and the versions of LIBRARIES."""
    return fingerprint_of(ROOT)


def fingerprint_of(root: Path) -> str:
    """The fingerprint of the sources in folder `root`."""
    return hash_code(root, _sources(root), LIBRARIES)


def image_fingerprint(estimator: str, sampler: str) -> str:
    """SHA-256 over the code that an image by this estimator and sampler depends on: the shared sources, their
    own modules and plug-ins, but no other estimator or sampler.

    PenumbraError where one of the two comes from no file.
    """
    files = ESTIMATORS.file(estimator), SAMPLERS.file(sampler)
    return hash_values(_shared(), _plugged(*files), ESTIMATORS.code(estimator), SAMPLERS.code(sampler))


@cache
def _shared() -> str:
    folders = _folders()
    return hash_code(ROOT, [one for one in _sources(ROOT) if one.parent not in folders], LIBRARIES)


@cache
def _plugged(*files: Path) -> str:
    """Hash of those modules of PLUGGED that the files are or import."""
    folders = _folders()
    return hash_code(ROOT, [one for one in imported_files(files, ROOT, PLUGGED) if one.parent in folders], ())


def _folders() -> set[Path]:
    return {ROOT.joinpath(*name.split(".")) for name in PLUGGED}


def _sources(root: Path) -> list[Path]:
    return [*(root / "renderer").rglob("*.py"), *(root / "scenes").rglob("*.py")]

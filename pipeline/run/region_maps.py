"""The label images of a run: regions/<key>/{map.json,regions.exr}, one for each scene, made once and read by
every scorer.

The key is of the scene's content, the renderer's sources and this pass's own. Of two workers that want the
same map one waits.
"""

from __future__ import annotations

import fcntl
import functools
import hashlib
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from pipeline.run.job import PreparedScene
from pipeline.schema.record import RegionMap
from pipeline.store.sealed_folder import damage, write_entry
from pipeline.studies.regions import CONTACT, SPP, Regions, find_regions, from_channels, to_channels
from renderer import fingerprint
from scenes.images.exr import read_exr, write_exr

FOLDER, MAP, LABELS_EXR = "regions", "map.json", "regions.exr"


def region_map(root: Path, scene: PreparedScene) -> tuple[RegionMap, Regions] | None:
    """The regions of a scene and where their label image lies in the run folder `root`; made if need be.

    None without lights.
    """
    key = region_key(scene.hash)
    entry = root / FOLDER / key
    found = _read(entry)
    if found is None:
        with _locked(root / FOLDER, key):
            found = _read(entry) or _make(root, key, scene)
    return found


def region_key(scene_hash: str) -> str:
    """The content address of a scene's label image."""
    return hashlib.sha256(repr((scene_hash, fingerprint(), _source())).encode()).hexdigest()[:32]


@functools.cache
def _source() -> str:
    return hashlib.sha256((Path(__file__).parents[1] / "studies" / "regions.py").read_bytes()).hexdigest()


def _read(entry: Path) -> tuple[RegionMap, Regions] | None:
    """What is there and whole."""
    if not entry.is_dir() or damage(entry):
        return None
    described = RegionMap.model_validate_json((entry / MAP).read_text(encoding="utf-8"))
    return described, from_channels(read_exr(entry / LABELS_EXR).channels)


def _make(root: Path, key: str, scene: PreparedScene) -> tuple[RegionMap, Regions] | None:
    regions = find_regions(scene.built)
    if regions is None:
        return None
    pixels = {name: int(mask.sum()) for name, mask in regions.masks().items()}
    image = f"{FOLDER}/{key}/{LABELS_EXR}"
    described = RegionMap(scene_hash=scene.hash, spp=SPP, contact=CONTACT, pixels=pixels, image=image)
    text = described.model_dump_json(indent=1)

    def write_map(path: Path) -> None:
        path.write_text(text, encoding="utf-8")

    write_entry(
        root / FOLDER / key,
        root / ".scratch",
        {LABELS_EXR: lambda path: write_exr(path, to_channels(regions)), MAP: write_map},
    )
    return described, regions


@contextmanager
def _locked(folder: Path, key: str) -> Generator[None]:
    """Keep other workers from making the same map; ends with the process at the latest."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f".{key}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield

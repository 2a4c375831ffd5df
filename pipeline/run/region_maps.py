"""The label images of a run: regions/<key>/{map.json,regions.exr}, one for each scene, made once and read by
every scorer.

The key is of the scene's content, the renderer's sources and this pass's own. Of two workers that want the
same map one waits.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.run.job import PreparedScene
from pipeline.schema.record import RegionMap
from pipeline.store.keys import region_key
from pipeline.store.lock import locked
from pipeline.store.sealed_folder import damage, write_entry
from pipeline.studies.regions import CONTACT, SPP, Regions, find_regions, from_channels, to_channels
from renderer import fingerprint
from scenes.images.exr import read_exr, write_exr

FOLDER, MAP, LABELS_EXR = "regions", "map.json", "regions.exr"


def region_map(root: Path, scene: PreparedScene) -> tuple[RegionMap, Regions] | None:
    """The regions of a scene and where their label image lies in the run folder `root`; made if need be.

    None without lights.
    """
    key = region_key(scene.hash, fingerprint())
    entry = root / FOLDER / key
    found = _read(entry)
    if found is None:
        entry.parent.mkdir(parents=True, exist_ok=True)
        with locked(entry.with_name(f".{key}.lock")):
            found = _read(entry) or _make(root, key, scene)
    return found


def _read(entry: Path) -> tuple[RegionMap, Regions] | None:
    """The region map that is there and whole."""
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

"""Label images in a run folder, regions/<key>/{map.json,regions.exr}: made once a scene, read by every
scorer.

The key covers the scene's content, the renderer's sources and those of the visibility pass. Of two workers
that want the same map one waits.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.run.job import PreparedScene
from pipeline.schema.record import RegionMap
from pipeline.store.keys import region_key
from pipeline.store.lock import locked
from pipeline.store.sealed_folder import Writer, damage, write_entry
from pipeline.studies.regions import CONTACT, SPP, Regions, find_regions, from_channels, to_channels
from renderer import fingerprint
from scenes.images.exr import read_exr, write_exr

FOLDER, MAP, LABELS_EXR = "regions", "map.json", "regions.exr"


def region_map(root: Path, scene: PreparedScene) -> tuple[RegionMap, Regions] | None:
    """Find the regions of a scene in the run folder `root`, or make and store them.

    None for a scene without lights.
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
    """The stored region map, or None if it is missing or damaged."""
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
    files: dict[str, Writer | bytes] = {
        LABELS_EXR: lambda path: write_exr(path, to_channels(regions)),
        MAP: described.model_dump_json(indent=1).encode(),
    }
    write_entry(root / FOLDER / key, root / ".scratch", files)
    return described, regions

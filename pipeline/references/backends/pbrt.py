"""pbrt-v4 as a reference: the user's own binary, run on the exported scene once for every batch.

pbrt multiplies spectra where we multiply RGB: gray reflectances under coloured light agree to 0.1 %,
saturated ones do not (albedo .8 .3 .1 under light 20 15 10 reads .955, .995, .806 of the product). Gray
scenes agree exactly: a coloured scene is rendered once for each channel, with that channel's value for every
colour.

pbrt silently ignores `--seed` where the file names a seed: the exported file names none.
"""

from __future__ import annotations

import functools
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Generator
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.references.ambient import bare_scene
from pipeline.references.batches import Batches, accumulate, to_image
from pipeline.references.pbrt.channels import gray_scenes
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Image,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
    require,
    unlit,
)
from pipeline.references.subprocesses import last_words
from pipeline.store.keys import imported_code
from scenes.description.coincidence import ambiguous
from scenes.description.lights import environments
from scenes.description.scene import RenderDefaults, SceneDescription
from scenes.description.shapes import pbrt_samples
from scenes.errors import PenumbraError
from scenes.hashing import hash_file
from scenes.images.exr import read_rgb, write_exr
from scenes.pbrt.write.scene import ExportedScene, export

VARIABLE = "PENUMBRA_PBRT"
SPP_A_BATCH = 4096
SCENE, IMAGE, SAID = "scene.pbrt", "image.exr", "said.txt"
HOUR = 3600.0


class PbrtBackend:
    """pbrt-v4's `path` with maxdepth 1, or its `ambientocclusion`.

    The binary is PENUMBRA_PBRT's, else `pbrt` on PATH.
    """

    name = "pbrt"

    def __init__(self, timeout: float = HOUR) -> None:
        self.timeout = timeout  # seconds, after which one run of pbrt is given up

    def version(self) -> str:
        """A hash of the binary, and one of the code that exports scenes to it and reads its images.

        PenumbraError if there is no binary.
        """
        binary = _binary()
        stat = binary.stat()
        content = _fingerprint(binary, stat.st_mtime_ns, stat.st_size)
        return f"pbrt-v4 {content} {imported_code(Path(__file__))}"

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        if quantity == "radiance" and (why := unlit(scene)):
            return why
        try:
            _binary()
            for one in passes(scene, quantity):
                exported(one, quantity)
        except PenumbraError as error:
            return str(error)
        return None

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        require(self, scene, request.quantity)
        binary = _binary()
        grays = passes(scene, request.quantity)

        def draw(wanted: Batches) -> Generator[Image]:
            with tempfile.TemporaryDirectory(prefix="penumbra-pbrt-") as name:
                folders = [
                    _prepare(Path(name) / str(c), gray, request.quantity) for c, gray in enumerate(grays)
                ]
                for number in range(wanted.first, wanted.first + wanted.count):
                    planes = [
                        _run(self, binary, folder, batch_seed(request.seed, number, c), wanted.spp, scene)
                        for c, folder in enumerate(folders)
                    ]
                    yield np.stack(planes * (3 // len(planes)), axis=-1)

        accumulator = accumulate(draw, scene.film, request, SPP_A_BATCH, continuation, progress)
        provenance = {
            "backend": self.name,
            "version": self.version(),
            "binary": str(binary),
            "integrator": "path, maxdepth 1" if request.quantity == "radiance" else "ambientocclusion",
            "colour": "gray scene, one pass" if len(grays) == 1 else "one pass in gray for each channel",
            "seeds": f"batch k, pass c: SeedSequence([{request.seed}, k, c]), 31 bits",
        }
        return to_image(accumulator, provenance)


def batch_seed(seed: int, number: int, channel: int) -> int:
    """pbrt's seed, a positive int32, for pass `channel` of batch `number` of the series `seed`."""
    return int(np.random.SeedSequence([seed, number, channel]).generate_state(1)[0] >> 1)


def passes(scene: SceneDescription, quantity: Quantity) -> list[SceneDescription]:
    """The gray scenes whose images are the channels of this scene's image; one if all channels are equal."""
    if quantity == "ambient-occlusion":
        return [bare_scene(scene)]
    return gray_scenes(scene)


def exported(scene: SceneDescription, quantity: Quantity) -> ExportedScene:
    """The scene as pbrt text, with an integrator for the quantity and without a seed.

    PenumbraError for a scene that pbrt cannot have, or renders otherwise.
    """
    if not all(light.in_pbrt for light in environments(scene.lights)):
        raise PenumbraError(
            "its sky ends at a horizon or is laid out by latitude, and pbrt has no such light"
        )
    if quantity == "radiance" and (why := ambiguous(scene.shapes)):
        raise PenumbraError(why)
    if quantity == "radiance" and not all(pbrt_samples(s.geometry) for s in scene.shapes if s.emission):
        raise PenumbraError(
            "it has a light on part of a sphere or a disk, or on a stretched one, and pbrt samples the whole "
            "one as it is before the transformation: its image is biased"
        )
    defaults = RenderDefaults(estimator=None if quantity == "radiance" else quantity)
    made = export(replace(scene, defaults=defaults, film=replace(scene.film, filename="")), "scene")
    return replace(made, text=_with(made.text, "Sampler", 'Sampler "independent"'))


def _with(text: str, directive: str, line: str) -> str:
    """Replace the one line of the text that begins with `directive`."""
    replaced, count = re.subn(rf"^{directive} .*$", lambda _: line, text, flags=re.MULTILINE)
    if count != 1:
        raise PenumbraError(f"the exported scene has {count} lines `{directive}` where one was expected")
    return replaced


def _binary() -> Path:
    """The path of pbrt; PenumbraError if it is missing or not executable."""
    named = os.environ.get(VARIABLE)
    if not named:
        found = shutil.which("pbrt")
        if found is None:
            raise PenumbraError(
                f"there is no pbrt on PATH; put pbrt-v4 there or name its binary in {VARIABLE}"
            )
        return Path(found).resolve()
    path = Path(named)
    if not path.is_file():
        raise PenumbraError(f"{VARIABLE} names {named}, and there is no such file")
    if not os.access(path, os.X_OK):
        raise PenumbraError(f"{VARIABLE} names {named}, which is not executable")
    return path.resolve()


@functools.lru_cache(maxsize=4)
def _fingerprint(binary: Path, _modified: int, _size: int) -> str:
    return hash_file(binary)[:16]


def _prepare(folder: Path, scene: SceneDescription, quantity: Quantity) -> Path:
    folder.mkdir()
    made = exported(scene, quantity)
    (folder / SCENE).write_text(made.text, encoding="utf-8")
    for name, image in made.images.items():
        channels = ("R", "G", "B") if image.shape[2] == 3 else ("Y",)
        write_exr(folder / name, {channel: image[..., i] for i, channel in enumerate(channels)})
    return folder


def _run(
    backend: PbrtBackend, binary: Path, folder: Path, seed: int, spp: int, scene: SceneDescription
) -> Image:
    """One gray image (h, w) by pbrt.

    Its output goes to a file: a pipe would wait for pbrt's own child processes.
    """
    image = folder / IMAGE
    image.unlink(missing_ok=True)
    arguments = ["--quiet", "--seed", str(seed), "--spp", str(spp), "--outfile", IMAGE, SCENE]
    with (folder / SAID).open("wb") as said:
        try:
            done = subprocess.run(
                [str(binary), *arguments],
                cwd=folder,
                stdout=said,
                stderr=said,
                timeout=backend.timeout,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise PenumbraError(
                f"pbrt gave no image in {backend.timeout:g} s and was stopped{_last(folder / SAID)}"
            ) from error
        except OSError as error:
            raise PenumbraError(f"{binary} cannot be run: {error.strerror}") from error
        if done.returncode != 0:
            raise PenumbraError(f"pbrt failed with code {done.returncode}{_last(folder / SAID)}")
        if not image.is_file():
            raise PenumbraError(f"pbrt ended well and wrote no image{_last(folder / SAID)}")
    return _read(image, scene)


def _last(said: Path) -> str:
    """The last lines of pbrt's output, after a colon."""
    last = last_words(said.read_text(errors="replace"))
    return f": {last}" if last else "; it said nothing"


def _read(path: Path, scene: SceneDescription) -> Image:
    """The mean of an image's channels, which have equal expectations in a gray scene."""
    try:
        rgb = read_rgb(path)
    except PenumbraError as error:
        raise PenumbraError(f"pbrt's image cannot be read: {str(error).removeprefix(f'{path}: ')}") from error
    expected = (scene.film.height, scene.film.width)
    if rgb.shape[:2] != expected:
        height, width = rgb.shape[:2]
        raise PenumbraError(f"pbrt's image is {width} x {height} pixels, not {expected[1]} x {expected[0]}")
    return rgb.mean(axis=-1)


BACKENDS.add("pbrt", PbrtBackend())

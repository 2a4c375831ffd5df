"""The scene that a command is given, and the notes on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pipeline.console.options import definitions

if TYPE_CHECKING:  # not at the start: `penumbra --help` must not wait for rich and NumPy
    from pipeline.console.console import Console
    from scenes import SceneDescription


def open_scene(
    name: str,
    define: Sequence[str] | None,
    console: Console,
    strict: bool = False,
    substitute: bool = False,
) -> SceneDescription:
    """Read a scene with the parameters of `-D`. A note on stderr says where its image is not pbrt's.

    strict, substitute: as for `scenes.load`, which raises PenumbraError.
    """
    from scenes import load

    with console.step(f"read {name}, percent", 100) as update:
        scene = load(
            name,
            definitions(define),
            strict=strict,
            substitute=substitute,
            progress=lambda share: update(int(100 * share)),
        )
    for note in (*scene.notes, *scene.substitutions):
        console.note(f"{name}: {note}")
    return scene

"""The public face of Penumbra: the names that a notebook, a script or a test needs.

    import penumbra as pn

    scene = pn.load("soft-shadow", {"xresolution": 64, "yresolution": 48})
    image = pn.render(scene, estimator="solid-angle", spp=16)
    truth = pn.reference(scene, spp=1024)
    pn.compare(image, truth, ["rmse", "relmse"])

A render shows itself in a notebook, and scores show as a table. Everything is imported at its first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from penumbra.face import check, compare, judge, load, reference, render, report, run, verify
    from penumbra.shown import Render, Scores
    from scenes.errors import PenumbraError, SceneError

_FACE = ("check", "compare", "judge", "load", "reference", "render", "report", "run", "verify")
_HOMES: dict[str, str] = {
    **dict.fromkeys(_FACE, "penumbra.face"),
    **dict.fromkeys(("Render", "Scores"), "penumbra.shown"),
    **dict.fromkeys(("PenumbraError", "SceneError"), "scenes.errors"),
}

__all__ = [
    "PenumbraError",
    "Render",
    "SceneError",
    "Scores",
    "check",
    "compare",
    "judge",
    "load",
    "reference",
    "render",
    "report",
    "run",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'penumbra' has no attribute {name!r}")
    from penumbra.rooms import shadowed

    if why := shadowed():
        raise ImportError(why)
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

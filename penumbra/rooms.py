"""A check that Python finds Penumbra's own packages, since others may have packages of the same names."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

ROOMS = ("scenes", "renderer", "pipeline", "reports")
HOME = Path(__file__).resolve().parents[1]


def shadowed() -> str | None:
    """Name a package of another's that Python would import in place of Penumbra's; None if there is none."""
    for room in ROOMS:
        spec = find_spec(room)
        found = Path(spec.origin).resolve() if spec and spec.origin else None
        if found is None:
            return f"the package {room!r} of Penumbra is missing: install penumbra again"
        if found.parent.parent != HOME:
            own = found.parent if found.name == "__init__.py" else found
            return (
                f"{own} hides Penumbra's own package {room!r}: start from another folder, without it on "
                "PYTHONPATH, or rename it"
            )
    return None

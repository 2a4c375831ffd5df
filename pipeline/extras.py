"""The extras of the wheel: optional parts that are heavy, or that few need."""

from __future__ import annotations

from importlib.metadata import packages_distributions, version
from importlib.util import find_spec

from scenes.errors import PenumbraError

# Extra to the modules that it brings; pyproject.toml says which packages those are.
EXTRAS = {"preview": ("pyvista",), "baseline": ("pyrender", "OpenGL")}


def missing_extra(name: str) -> str | None:
    """Name the modules of an extra that are not installed, and how to get them; None if all are installed."""
    lacking = [module for module in EXTRAS[name] if find_spec(module) is None]
    if not lacking:
        return None
    verb = "is" if len(lacking) == 1 else "are"
    return f"{' and '.join(lacking)} {verb} not installed: pip install 'penumbra[{name}]'"


def require_extra(name: str) -> None:
    """Raise PenumbraError, which says how to get it, if an extra is missing."""
    if why := missing_extra(name):
        raise PenumbraError(why)


def version_of(module: str) -> str:
    """The version of the installed package that a module belongs to."""
    return version(packages_distributions()[module][0])

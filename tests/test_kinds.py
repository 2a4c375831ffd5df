"""The files that a new kind touches, counted by those that name an existing one.

A file names a kind if its code holds one of the kind's classes as an identifier, or one of its words as a
whole string. Comments and docstrings do not count.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import typing
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from scenes import catalog
from scenes.registry import Registry
from tests.test_house import ROOT, SOURCES, registries

SCENES = tuple(scene.name for scene in catalog.library())
SWEEPS = tuple(path.stem for path in (ROOT / "pipeline" / "sweeps").glob("*.toml"))


class Kind(NamedTuple):
    """A kind that exists, how code would name it, and the number of files that may."""

    name: str
    classes: tuple[str, ...]
    words: tuple[str, ...]
    limit: int


# A limit only ever comes down.
TABLE = [
    Kind("spot light", ("SpotLight", "SpotLights"), ("spot",), 5),
    Kind("goniometric light", ("GoniometricLight", "GoniometricLights"), ("goniometric",), 4),
    Kind("projection light", ("ProjectionLight", "ProjectionLights"), ("projection",), 5),
    Kind("portal", ("PortalLight", "PortalLights"), ("portal",), 5),
    Kind("conductor", ("Conductor", "Conductors"), ("conductor",), 4),
    Kind("sheet", ("DiffuseTransmission", "DiffuseTransmissionMaterials"), ("diffusetransmission",), 3),
    Kind("checkerboard", ("Checkerboard",), ("checkerboard",), 4),
    Kind("marble", ("Marble",), ("marble",), 3),
    Kind("noise", ("NoiseTexture",), ("wrinkled",), 3),
    Kind("dots", ("Dots",), ("dots",), 3),
    Kind("disk", ("Disk", "DiskLights"), ("disk",), 7),
    Kind("quadric", ("Quadric", "QuadricLights"), ("quadric",), 7),
    *(Kind(f"scene {name}", (), (name,), 1) for name in SCENES),
    *(Kind(f"sweep {name}", (), (name,), 1) for name in SWEEPS),
]

HOMONYM = "the same word for another thing"
FOREIGN = "what another program calls its own, which becomes text of ours"

# Files that use a kind and teach the tree nothing about it: path -> why. They are not counted.
USES = {
    "spot light": {
        "pipeline/baseline/worker.py": "pyrender's own class of that name",
        "pipeline/convert/": FOREIGN,
    },
    "goniometric light": {},
    "projection light": {},
    "portal": {},
    "conductor": {
        "pipeline/references/mitsuba/plugins.py": "Mitsuba's own class of that name",
        "renderer/materials/coated.py": "the examples lay a coat over one",
        "pipeline/convert/": FOREIGN,
    },
    "sheet": {},
    "checkerboard": {"pipeline/convert/": FOREIGN},
    "marble": {},
    "noise": {},
    "dots": {},
    "disk": {
        "pipeline/convert/": FOREIGN,
        "renderer/geometry/quadrics.py": "the form of a quadric, whose parts and affine images it holds",
        "renderer/lights/quadric.py": "the whole one in object space, whose directions a part's light draws",
    },
    "quadric": {},
    # Words that mean the program, a metric or a command in the source, never the scene or the sweep.
    "scene penumbra": {"": HOMONYM},
    "sweep penumbra": {"": HOMONYM},
    "sweep noise": {"": HOMONYM},
    "sweep demo": {"pipeline/": "the command of that name", "reports/": "the command of that name"},
}

# Names that a registry hands out and other files hold too: kind -> path (a folder ends with /) -> why.
DEFAULTS = "a default, or the partner of one"
FAMILY = "one technique of light sampling, by each light"
ENTRIES: Mapping[str, Mapping[str, str]] = {
    "metric": {
        "pipeline/commands/baseline.py": HOMONYM,
        "pipeline/scoring/metric.py": HOMONYM,
        "pipeline/schema/sweep.py": "scored in any case: every report rests on it",
        "pipeline/studies/ladder.py": "the study asks for counts of samples that are no number",
    },
    "sampler": {
        "pipeline/commands/": DEFAULTS,
        "pipeline/scoring/files.py": "a key of the metadata in an EXR",
        "pipeline/schema/sweep.py": DEFAULTS,
        "pipeline/self_reference.py": DEFAULTS,
        "pipeline/studies/": DEFAULTS,
        "pipeline/references/mitsuba/worker.py": "Mitsuba's plug-in of that name",
        "renderer/render.py": DEFAULTS,
        "scenes/": "pbrt's keyword, and the default of a scene",
        "reports/": "a straight line is fitted to independent samples only",
    },
    "estimator": {
        "pipeline/commands/": DEFAULTS,
        "pipeline/self_reference.py": DEFAULTS,
        "renderer/render.py": DEFAULTS,
        "scenes/pbrt/": "pbrt's keyword",
        "pipeline/references/": "the quantity ambient-occlusion, and Mitsuba's words",
        "pipeline/convert/": FOREIGN,
        "renderer/interfaces/estimator.py": "the quantity ambient-occlusion",
        "renderer/estimators/": FAMILY,
        "renderer/light_sampling/": FAMILY,
        "renderer/lights/": FAMILY,
    },
    "reference backend": {
        "pipeline/commands/": DEFAULTS,
        "pipeline/schema/sweep.py": DEFAULTS,
        "pipeline/baseline/entry.py": "a folder of that name",
        "pipeline/store/provenance.py": "the distribution of that name",
    },
}

# Metrics that have a place of their own on the page; every other one is a column.
PAGE = {("metric", name) for name in ("mse", "rmse", "relmse", "nonfinite", "largest-share", "umbra-leak")}


@cache
def _names(path: Path) -> tuple[frozenset[str], frozenset[str]]:
    """The identifiers and the string constants in the code of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    bodies = (node.body for node in ast.walk(tree) if isinstance(node, documented))
    prose = {id(body[0].value) for body in bodies if body and isinstance(body[0], ast.Expr)}
    identifiers, words = set[str](), set[str]()
    for node in ast.walk(tree):
        match node:
            case (
                ast.Name(id=name) | ast.Attribute(attr=name) | ast.ClassDef(name=name) | ast.alias(name=name)
            ):
                identifiers.add(name)
            case ast.Constant(value=str(word)) if id(node) not in prose:
                words.add(word)
    return frozenset(identifiers), frozenset(words)


def naming(classes: tuple[str, ...], words: tuple[str, ...], uses: Mapping[str, str]) -> list[str]:
    """The source files whose code names a kind, those that only use it aside."""
    found = []
    for path in SOURCES:
        identifiers, strings = _names(path)
        name = path.relative_to(ROOT).as_posix()
        if (identifiers & set(classes) or strings & set(words)) and not name.startswith(tuple(uses)):
            found.append(name)
    return found


@pytest.mark.parametrize("kind", TABLE, ids=lambda kind: kind.name)
def test_files_that_a_new_kind_touches_are_few(kind: Kind) -> None:
    files = naming(kind.classes, kind.words, USES.get(kind.name, {}))
    assert len(files) <= kind.limit, f"{kind.name}: {len(files)} files, {kind.limit} allowed: {files}"


def test_what_only_uses_a_kind_still_does() -> None:
    """An exception that nothing needs any more goes."""
    kinds = {kind.name: kind for kind in TABLE}
    named = {name: naming(kinds[name].classes, kinds[name].words, {}) for name in USES}
    for registered, uses in ENTRIES.items():
        words = tuple(registries()[registered].names())
        assert not _unused(uses, naming((), words, {})), registered
    assert not {name: stale for name in USES if (stale := _unused(USES[name], named[name]))}


def _unused(uses: Mapping[str, str], files: list[str]) -> list[str]:
    return [path for path in uses if not any(file.startswith(path) for file in files)]


def _entries() -> Iterator[tuple[str, str, Registry[object]]]:
    for kind in ENTRIES:
        registry = registries()[kind]
        # The renderer's own backend stands outside the folder, and registers itself where it is used.
        inside = (name for name, entry in registry.items() if registry.package in _module(entry))
        yield from ((kind, name, registry) for name in inside)


def _module(entry: object) -> str:
    return entry.__module__ if isinstance(entry, type) else type(entry).__module__


@pytest.mark.parametrize(("kind", "name", "registry"), list(_entries()))
def test_an_entry_of_a_registry_is_one_file(kind: str, name: str, registry: Registry[object]) -> None:
    """Its own file registers it; others name it as a default or mean something else by the word."""
    own = f"{registry.package.replace('.', '/')}/"
    uses = dict(ENTRIES[kind])
    if (kind, name) in PAGE:
        uses["reports/"] = "the page is built on it"
    home = [file for file in naming((), (name,), {}) if file.startswith(own)]
    others = naming((), (name,), {**uses, own: "its home"})
    assert len(home) == 1 or own in uses, home
    assert not others, f"{kind} {name} is named by {others} too"


COMMANDS = [path for path in (ROOT / "pipeline" / "commands").glob("*.py") if path.stem != "__init__"]


@pytest.mark.parametrize("path", COMMANDS, ids=lambda path: path.stem)
def test_a_command_is_one_file(path: Path) -> None:
    """No file names its module: commands are found in their folder, and what they share stands in none."""
    module = f"pipeline.commands.{path.stem}"
    assert not [user for user in SOURCES if module in user.read_text(encoding="utf-8")]


# The kinds of a family; what carries one, or is part of one, is no kind itself.
FAMILIES = {
    "lights": {
        "PointLight",
        "SpotLight",
        "DistantLight",
        "Environment",
        "PortalLight",
        "GoniometricLight",
        "ProjectionLight",
    },
    "materials": {"Diffuse", "Conductor", "Dielectric", "Coated", "DiffuseTransmission", "MixedMaterial"},
    "shapes": {"TriangleMesh", "BilinearMesh", "Sphere", "Disk", "Quadric"},
    "textures": {
        "ImageTexture",
        "Checkerboard",
        "Product",
        "Mix",
        "DirectionMix",
        "Bilerp",
        "Dots",
        "NoiseTexture",
        "Marble",
    },
}
# Functions that tell two kinds of a family apart outside the kinds' own modules: why each one may.
LADDERS = {"scenes/pbrt/directives/emission.py": "a rectangle with an image is written as either mesh"}


def _asked(function: ast.FunctionDef) -> set[str]:
    """The classes that a function asks for, by isinstance, by a pattern, or by comparing a type."""
    found = set[str]()
    for node in ast.walk(function):
        match node:
            case ast.Call(func=ast.Name(id="isinstance"), args=[_, asked]):
                found |= {part.id for part in ast.walk(asked) if isinstance(part, ast.Name)}
            case ast.MatchClass(cls=ast.Name(id=name)):
                found.add(name)
            case ast.Compare(ops=[ast.Is() | ast.IsNot() | ast.Eq()], comparators=[ast.Name(id=name)]):
                found.add(name)
    return found


def _climbs(function: ast.FunctionDef) -> bool:
    """Whether a function tells kinds of one family apart, of which a new one would have to be told too."""
    return any(len(_asked(function) & family) > 1 for family in FAMILIES.values())


def test_families_are_those_of_the_description() -> None:
    for module, kinds in FAMILIES.items():
        union = getattr(
            importlib.import_module(f"scenes.description.{module}"), module.capitalize()[:-1], None
        )
        geometry = importlib.import_module("scenes.description.shapes").Geometry
        members = typing.get_args(union or geometry)
        assert kinds == {kind.__name__ for kind in members if dataclasses.is_dataclass(kind)}


def test_nothing_climbs_a_ladder_of_kinds() -> None:
    climbing = {
        path.relative_to(ROOT).as_posix()
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and _climbs(node)
    }
    assert climbing == set(LADDERS), sorted(climbing ^ set(LADDERS))


def test_a_ladder_is_found_when_one_is_built() -> None:
    ladder = (
        "def f(s):\n    if isinstance(s, Sphere):\n        return 1\n    return 2 if type(s) is Disk else 3"
    )
    tree = ast.parse(ladder)
    assert isinstance(tree.body[0], ast.FunctionDef)
    assert _climbs(tree.body[0])

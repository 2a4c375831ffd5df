"""House rules that no linter here expresses: who may import what, citations, examples in docstrings,
registries.

The direction of imports between the packages is import-linter's (pyproject.toml).
"""

from __future__ import annotations

import ast
import doctest
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from scenes.registry import Registry

ROOT = Path(__file__).parent.parent
PACKAGES = ("scenes", "renderer", "pipeline", "reports")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))
SCRIPTS = sorted(path for name in ("examples", "benchmarks") for path in (ROOT / name).rglob("*.py"))

# A library and the one file that may import it; everything else goes through that file. None: no file yet.
ONE_FILE = {
    "embreex": "renderer/geometry/triangles.py",
    "OpenImageIO": "scenes/images/exr.py",
    "mitsuba": "pipeline/references/mitsuba/worker.py",
    "drjit": "pipeline/references/mitsuba/worker.py",
    "dask": None,
    "distributed": None,
    "pyvista": "pipeline/preview/drawing.py",
    "pyrender": "pipeline/baseline/worker.py",
    "OpenGL": "pipeline/baseline/worker.py",
}
CITATION = re.compile(
    r"\[([a-z]{2,}\d{1,5}[a-z]?)\b(?:,[^\[\]]*| [^\[\]]*)?\]"
)  # [urena2013] or [urena2013, eq. 7]
WITHOUT_STATE = {
    "default_rng",
    "Generator",
    "SeedSequence",
    "BitGenerator",
    "PCG64",
    "PCG64DXSM",
    "Philox",
    "SFC64",
}


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def _imports(path: Path) -> tuple[str, ...]:
    """Every module that a file imports, by statement or by `import_module("name")`."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(_tree(path)):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield module
                yield from (f"{module}.{alias.name}" for alias in names)
            case ast.Call(
                func=ast.Attribute(attr="import_module"), args=[ast.Constant(value=str(module)), *_]
            ):
                yield module


def _docstrings(path: Path) -> Iterator[str]:
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    texts = (ast.get_docstring(node) for node in ast.walk(_tree(path)) if isinstance(node, documented))
    return (text for text in texts if text)


@pytest.mark.parametrize("library", ONE_FILE)
def test_library_is_imported_by_its_one_file_only(library: str) -> None:
    users = {_name(path) for path in SOURCES if any(name.split(".")[0] == library for name in _imports(path))}
    assert users <= {ONE_FILE[library]}


@pytest.mark.usefixtures("processes")
def test_reports_work_without_renderer() -> None:
    """Importing every module of reports brings in neither the renderer nor a reference renderer, lazy imports
    aside.
    """
    modules = [
        _name(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".") for path in SOURCES
    ]
    script = "import importlib, sys\n" + "".join(
        f"importlib.import_module({module!r})\n" for module in modules if module.startswith("reports")
    )
    script += "print(*({'renderer', 'mitsuba', 'embreex', 'pipeline.cli'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_protocols_can_be_checked_at_run_time() -> None:
    """The run-time type checks of the tests (conftest.py) cannot decorate a function that takes any other
    protocol.
    """
    wrong = [
        f"{_name(path)}:{node.lineno} {node.name}"
        for path in SOURCES
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.ClassDef) and "Protocol" in map(ast.unparse, node.bases)
        if "runtime_checkable" not in map(ast.unparse, node.decorator_list)
    ]
    assert not wrong


def test_no_global_random_state() -> None:
    """NumPy's legacy functions draw from hidden state, so that a result depends on what ran before it."""
    used = [
        f"{_name(path)}:{node.lineno} np.random.{node.attr}"
        for path in [*SOURCES, *TESTS, *SCRIPTS]
        for node in ast.walk(_tree(path))
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in ("np.random", "numpy.random")
        if node.attr not in WITHOUT_STATE
    ]
    assert not used


def test_citations_and_bibliography_agree() -> None:
    """Every [key] of a docstring has its entry, every entry is cited."""
    bibliography = (ROOT / "docs" / "references.bib").read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{([^,\s]+),", bibliography, flags=re.MULTILINE)
    cited = {
        key
        for path in [*SOURCES, *TESTS, *SCRIPTS]
        for text in _docstrings(path)
        for key in CITATION.findall(text)
    }
    assert len(entries) == len(set(entries))
    assert cited, "no docstring cites anything: the pattern of a citation must have changed"
    assert cited == set(entries)


def test_doctests() -> None:
    """Examples in docstrings run as they stand. Modules without examples are not imported."""
    modules = [path for path in SOURCES if any(">>>" in text for text in _docstrings(path))]
    failures = {}
    for path in modules:
        module = importlib.import_module(
            _name(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        )
        result = doctest.testmod(module)
        failures[_name(path)] = result.failed
        assert result.attempted, f"{_name(path)} has examples that doctest does not see"
    assert not any(failures.values()), failures


def registries() -> dict[str, Registry[object]]:
    """All registries: every module whose source makes one."""
    makers = [
        path
        for path in SOURCES
        if re.search(r"^[A-Z_]+\b.*= Registry\(", path.read_text(encoding="utf-8"), re.M)
    ]
    modules = [importlib.import_module(_name(path).removesuffix(".py").replace("/", ".")) for path in makers]
    found = [value for module in modules for value in vars(module).values() if isinstance(value, Registry)]
    return {registry.kind: registry for registry in found}


def test_registries_are_found() -> None:
    assert {"estimator", "sampler", "metric", "reference backend"} <= set(registries())


@pytest.mark.parametrize("kind", ["estimator", "sampler", "metric"])
def test_entries_have_distinct_titles(kind: str) -> None:
    """`penumbra list` and the reports show them."""
    titles = {name: getattr(entry, "title", "") for name, entry in registries()[kind].items()}
    assert all(titles.values()), titles
    assert len(set(titles.values())) == len(titles), titles


def test_docstrings_say_what_a_thing_is() -> None:
    """None begins with "What", and none says only where else to look."""
    vague = re.compile(r"What |See `[^`]*`\.$")
    found = {path.name: text for path in SOURCES for text in _docstrings(path) if vague.match(text)}
    assert not found

"""Switches that hold for every test: run-time type checks, the slow tier, markers set by fixtures, and tests
that need a part of the system.

PENUMBRA_FAST=1 (`make test-fast`) leaves out, by their markers, the tests that start processes, Mitsuba, a
browser or OpenGL, the statistical, the thorough and the large ones. In every run a test that starts any of
these without a marker that says so fails, so that the selection is right.
PENUMBRA_SLOW=1 (`make test-all`) brings in the tests marked `slow`.
PENUMBRA_STRICT=1 (`.ci/run`) turns the skip of a test that needs a system part, or of a whole module, into a
failure.

The fixtures `processes`, `mitsuba`, `browser`, `opengl`, `statistical` and `thorough` set the markers.
"""

from __future__ import annotations

import functools
import itertools
import multiprocessing.util
import os
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

if "PYTEST_XDIST_WORKER" in os.environ:  # the workers share the cores, so that each multiplies on one
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.pop(
        "COLUMNS", None
    )  # xdist says 80, for a terminal that no worker has: tables would break names

import pytest

from tests.kit import typed_calls
from tests.system_parts import TEST, Part

# Before any of the packages is imported: every annotated call in them is checked while the tests run.
typed_calls.install("scenes", "renderer", "pipeline")

STRICT = os.environ.get("PENUMBRA_STRICT") == "1"
SLOW = os.environ.get("PENUMBRA_SLOW") == "1"
FAST = os.environ.get("PENUMBRA_FAST") == "1"
_NUMBERS = itertools.count()
# By the fixture that sets it.
MARKERS = {
    "processes": "process",
    "mitsuba": "mitsuba",
    "browser": "browser",
    "opengl": "opengl",
    "statistical": "statistical",
    "thorough": "thorough",
}
STARTING = {"process", "mitsuba", "browser", "opengl"}  # markers of tests that may start what `_refuse` names
STARTS = {
    "subprocess.Popen",
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.system",
    "os.exec",
}  # audit events
HEAVY = {"mitsuba": "mitsuba", "drjit": "mitsuba", "playwright": "browser"} | dict.fromkeys(
    ("OpenGL", "pyrender", "pyvista", "vtkmodules", "vtk"), "opengl"
)  # modules that an unmarked test must not import, by the fixture that allows it
_running = [""]  # the test that must start nothing, while it runs


@pytest.fixture(scope="session")
def processes() -> None:
    """Requested by tests that start processes."""


@pytest.fixture(scope="session")
def mitsuba() -> None:
    """Requested by tests that render with Mitsuba, in a process of its own."""


@pytest.fixture(scope="session")
def browser() -> None:
    """Requested by tests that start a browser."""


@pytest.fixture(scope="session")
def opengl() -> None:
    """Requested by tests that draw with OpenGL, in a process of its own."""


@pytest.fixture(scope="session")
def statistical() -> None:
    """Requested by tests whose verdict takes many samples, and seconds; each states its false alarms."""


@pytest.fixture(scope="session")
def thorough() -> None:
    """Requested by modules of many seconds: quadratures to all digits, and renders of the whole library."""


@pytest.fixture(scope="session")
def shared_references(mitsuba: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One folder of references for all tests and workers: content-addressed, and locked while one is made."""
    base = tmp_path_factory.getbasetemp()
    return (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "references"


@pytest.fixture(autouse=True)
def _references_of_this_test(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """No test sees the user's references, nor another test's."""
    monkeypatch.setenv("PENUMBRA_CACHE", str(tmp_path_factory.getbasetemp() / f"cache{next(_NUMBERS)}"))
    monkeypatch.delenv("PENUMBRA_PBRT", raising=False)


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if not _running[0]:
        return
    if event == "import" and (fixture := HEAVY.get(str(arguments[0]).partition(".")[0])):
        pytest.fail(
            f"{_running[0]} imports {arguments[0]}: let it request the fixture `{fixture}`", pytrace=False
        )
    # Started once by whichever test comes first: git for the commit of the checkout, and on a fresh machine
    # fc-list for the fonts of matplotlib, which colour-science imports.
    if event in STARTS and not (event == "subprocess.Popen" and str(arguments[0]) in ("git", "fc-list")):
        command = " ".join(map(str, arguments[1])) if event == "subprocess.Popen" else ""
        pytest.fail(
            f"{_running[0]} starts a process ({event} {command}): let it request the fixture `processes`, "
            "`mitsuba` or `opengl`",
            pytrace=False,
        )


def _guard() -> None:
    """Let every start of a process meet `_refuse`; multiprocessing raises no audit event of its own."""
    sys.addaudithook(_refuse)
    start = multiprocessing.util.spawnv_passfds

    def spawn(path: bytes, arguments: object, passed: object) -> int:
        _refuse("os.posix_spawn", ())
        return start(path, arguments, passed)

    multiprocessing.util.spawnv_passfds = spawn


_guard()


def pytest_collection_finish() -> None:
    """What the files of the tests import is there before any test runs."""
    if early := {"mitsuba", "drjit", "OpenGL", "vtkmodules"} & sys.modules.keys():
        raise pytest.UsageError(f"imported with the tests' files: {', '.join(sorted(early))}")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    _running[0] = "" if any(map(item.get_closest_marker, STARTING)) else item.nodeid
    try:
        return (yield)
    finally:
        _running[0] = ""


@functools.cache
def _works(part: Part) -> bool:
    return part.works()


def _parts(item: pytest.Item) -> Iterator[Part]:
    return (part for marker, part in TEST.items() if item.get_closest_marker(marker))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Set markers from fixtures; leave out what starts processes if asked, slow tests if not."""
    for item in items:
        for fixture in MARKERS.keys() & set(getattr(item, "fixturenames", ())):
            item.add_marker(MARKERS[fixture])
    left_out = STARTING | {"statistical", "thorough", "large"} if FAST else set[str]()
    if not SLOW and "slow" not in config.option.markexpr:
        left_out = left_out | {"slow"}
    out = [item for item in items if any(map(item.get_closest_marker, left_out))]
    if out:
        config.hook.pytest_deselected(items=out)
        items[:] = [item for item in items if item not in set(out)]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    for part in _parts(item):
        if not _works(part):
            pytest.skip(part.missing())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if STRICT and report.skipped and not hasattr(report, "wasxfail") and any(_parts(item)):
        report.outcome, report.longrepr = (
            "failed",
            f"skipped, which PENUMBRA_STRICT forbids: {report.longrepr}",
        )
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if STRICT and report.skipped:
        report.outcome, report.longrepr = (
            "failed",
            f"{collector.nodeid} skipped as a whole: {report.longrepr}",
        )
    return report

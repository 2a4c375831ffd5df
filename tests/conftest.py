"""Switches that hold for every test: run-time type checks, the slow tier, markers set by fixtures, and tests
that need a part of the system.

PENUMBRA_SLOW=1 (`make test-all`) brings in the tests marked `slow`.
PENUMBRA_STRICT=1 (`.ci/run`) turns the skip of a test that needs a system part, or of a whole module, into a
failure.

The fixtures `processes` and `mitsuba` set the markers by which a run leaves out the tests that need them.
"""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Generator, Iterator
from pathlib import Path

if "PYTEST_XDIST_WORKER" in os.environ:  # the workers share the cores, so that each multiplies on one
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jaxtyping
import pytest

from tests.system_parts import TEST, Part

# Before any of the packages is imported: every annotated call in them is checked while the tests run.
jaxtyping.install_import_hook(["scenes", "renderer", "pipeline"], "beartype.beartype")

STRICT = os.environ.get("PENUMBRA_STRICT") == "1"
SLOW = os.environ.get("PENUMBRA_SLOW") == "1"
_NUMBERS = itertools.count()
MARKERS = {"processes": "process", "mitsuba": "mitsuba"}  # by the fixture that sets it


@pytest.fixture(scope="session")
def processes() -> None:
    """Requested by tests that start processes."""


@pytest.fixture(scope="session")
def mitsuba() -> None:
    """Requested by tests that render with Mitsuba, in a process of its own."""


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


@functools.cache
def _works(part: Part) -> bool:
    return part.works()


def _parts(item: pytest.Item) -> Iterator[Part]:
    return (part for marker, part in TEST.items() if item.get_closest_marker(marker))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Set markers from fixtures; leave the slow tier out, unless the environment or `-m` asks for it."""
    for item in items:
        for fixture in MARKERS.keys() & set(getattr(item, "fixturenames", ())):
            item.add_marker(MARKERS[fixture])
    if SLOW or "slow" in config.option.markexpr:
        return
    slow = [item for item in items if item.get_closest_marker("slow")]
    if slow:
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if not item.get_closest_marker("slow")]


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

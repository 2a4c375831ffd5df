"""Switches that hold for every test: run-time type checks, the slow tier, and tests that need a part of the
system.

PENUMBRA_SLOW=1 (`make test-all`) brings in the tests marked `slow`.
PENUMBRA_STRICT=1 (`.ci/run`) turns the skip of a test that needs a system part, or of a whole module, into a
failure.
"""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Generator, Iterator

import jaxtyping
import pytest

from tests.system_parts import TEST, Part

# Before any of the packages is imported: every annotated call in them is checked while the tests run.
jaxtyping.install_import_hook(["scenes", "renderer", "pipeline"], "beartype.beartype")

STRICT = os.environ.get("PENUMBRA_STRICT") == "1"
SLOW = os.environ.get("PENUMBRA_SLOW") == "1"
_NUMBERS = itertools.count()


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


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slow tier out, unless it was asked for by the environment or by `-m`."""
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

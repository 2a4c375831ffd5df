"""The small run of known truths and its report, written once."""

from __future__ import annotations

from pathlib import Path

import pytest

from reports import write_report
from tests.kit.small_run import write_run


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run's folder; not to be changed."""
    return write_run(tmp_path_factory.mktemp("small") / "run")


@pytest.fixture(scope="session")
def small_page(small_run: Path) -> Path:
    """The index.html of its report."""
    return write_report(small_run)

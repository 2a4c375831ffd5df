"""The tests behind a verdict, as a table and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pipeline.console.console import Console
from pipeline.statistics.welch import TestResult


def tell_tests(console: Console, tests: Sequence[TestResult]) -> None:
    """A row for each family of comparisons."""
    rows = [
        (
            test.name,
            f"{test.comparisons:,}",
            f"{test.p:.3g}",
            f"{test.effect:+.3%}",
            f"{test.smallest_detectable:.3%}" if test.smallest_detectable < float("inf") else "-",
            "differs" if test.reject else "agrees",
        )
        for test in tests
    ]
    headings = ("test", "comparisons", "p", "worst difference", "bias it would have caught", "result")
    console.table(headings, rows)


def plain_tests(tests: Sequence[TestResult]) -> list[dict[str, Any]]:
    """The figures of each family, for JSON."""
    return [
        {
            "name": test.name,
            "p": test.p,
            "effect": test.effect,
            "smallest_detectable": test.smallest_detectable,
            "comparisons": test.comparisons,
            "rejects": test.reject,
        }
        for test in tests
    ]

"""While the tests run, every annotated call of the packages is checked."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType, ModuleType

import pytest
from beartype.roar import BeartypeCallHintViolation

import scenes
from tests.kit.typed_calls import _Finder

PACKAGE = """
from __future__ import annotations
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING
import numpy as np
from numpy.typing import NDArray
if TYPE_CHECKING:
    from elsewhere import Later

TABLE = {}

def registered(function):
    TABLE["it"] = function
    return function

@registered
def root(x: float) -> NDArray[np.float64]:
    return np.sqrt(np.array([x])) if x > 0 else "none"

def late(later: Later, number: int) -> int:
    return number

@dataclass(frozen=True)
class Point:
    x: float

    @property
    def label(self) -> str:
        return self.x

@contextmanager
def opened(path: str) -> Iterator[int]:
    yield 1
"""


@pytest.fixture
def sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    (tmp_path / "sample_of_calls.py").write_text(PACKAGE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "meta_path", [_Finder(frozenset({"sample_of_calls"})), *sys.meta_path])
    yield importlib.import_module("sample_of_calls")
    del sys.modules["sample_of_calls"]


def test_right_calls_pass(sample: ModuleType) -> None:
    assert sample.root(4.0) == 2.0
    assert sample.late("anything", 3) == 3
    assert sample.Point(1.0).x == 1.0
    with sample.opened("a") as one:
        assert one == 1


def test_wrong_arguments_results_fields_and_properties_are_caught(sample: ModuleType) -> None:
    for wrong in (
        lambda: sample.root("4"),
        lambda: sample.root(-1.0),
        lambda: sample.TABLE["it"]("4"),
        lambda: sample.late("anything", "3"),
        lambda: sample.Point("1"),
        lambda: sample.Point(1.0).label,
        lambda: sample.opened(1).__enter__(),
    ):
        with pytest.raises(BeartypeCallHintViolation):
            wrong()


def test_calls_of_the_packages_are_checked() -> None:
    """Of every module that this process has imported, no function escapes."""
    with pytest.raises(BeartypeCallHintViolation):
        scenes.load(1)
    functions = [
        function
        for package in ("scenes", "renderer", "pipeline")
        for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}.")
        if module.name in sys.modules
        for function in vars(sys.modules[module.name]).values()
        if isinstance(function, FunctionType) and function.__module__ == module.name
        if {hint for name, hint in inspect.get_annotations(function).items() if name != "return"} - {"Any"}
    ]
    unchecked = [f for f in functions if not hasattr(f, "__beartype_wrapper")]
    assert len(functions) > 100
    assert [f"{f.__module__}.{f.__qualname__}" for f in unchecked] == []

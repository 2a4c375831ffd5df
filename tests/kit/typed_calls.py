"""Run-time type checks of all annotated calls of packages, by beartype: an import hook.

Every function is decorated innermost, so that registries and commands get the checked one, and the generated
`__init__` of every dataclass. beartype's own hook stops at hints that only type checkers can resolve (imports
under TYPE_CHECKING); here such a hint is left out and the others of its function are checked.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, get_args

from beartype import beartype
from beartype.roar import BeartypeDecorHintException

_DECORATOR = "__typed_calls__"
_BYTECODE = ".typed-1.pyc"  # beside what plain imports leave; another number wherever `_Decorated` changes


def typed(target: Any) -> Any:
    """The function with its calls checked; the class, with its construction checked if it is a dataclass."""
    if isinstance(target, type):
        if is_dataclass(target) and isinstance(target.__dict__.get("__init__"), FunctionType):
            target.__init__ = _checked(target.__init__)
        return target
    return _checked(target)


def _checked(function: Callable[..., Any]) -> Callable[..., Any]:
    written = function.__annotations__
    resolved = {name: _resolved(hint, function.__globals__) for name, hint in written.items()}
    function.__annotations__ = {name: hint for name, hint in resolved.items() if hint is not None}
    try:
        checked = beartype(function)
    except BeartypeDecorHintException:
        checked = function
    function.__annotations__ = checked.__annotations__ = written
    return checked


def _resolved(hint: Any, names: dict[str, Any]) -> Any:
    """The hint as an object, "None" too; None if it names what is not there at run time, or OpenImageIO.

    beartype keeps every hint. nanobind complains at exit about types of its modules that are still held.
    """
    try:
        found = eval(hint, names) if isinstance(hint, str) else hint
    except (NameError, AttributeError):
        return None
    mentioned = [getattr(one, "__module__", None) or "" for one in (found, *get_args(found))]
    return None if any(name.startswith("OpenImageIO") for name in mentioned) else found or type(None)


class _Decorated(ast.NodeTransformer):
    """Innermost on functions; outermost on classes, after `@dataclass` has made the `__init__`."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        node.decorator_list.append(ast.Name(_DECORATOR, ast.Load()))
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        self.generic_visit(node)
        node.decorator_list.insert(0, ast.Name(_DECORATOR, ast.Load()))
        return node


class _Loader(SourceFileLoader):
    def source_to_code(self, data: Any, path: Any, *, _optimize: int = -1) -> CodeType:
        tree = ast.fix_missing_locations(_Decorated().visit(ast.parse(data, path)))
        return compile(tree, path, "exec", dont_inherit=True, optimize=_optimize)

    def get_data(self, path: str) -> bytes:
        return super().get_data(_own(path))

    def set_data(self, path: str, data: Any, *, _mode: int = 0o666) -> None:
        super().set_data(_own(path), data, _mode=_mode)

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__[_DECORATOR] = typed
        super().exec_module(module)


def _own(path: str) -> str:
    return str(Path(path).with_suffix(_BYTECODE)) if path.endswith(".pyc") else path


class _Finder(MetaPathFinder):
    def __init__(self, packages: frozenset[str]) -> None:
        self.packages = packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.partition(".")[0] not in self.packages:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec


def install(*packages: str) -> None:
    """Check the calls of these packages, none of which has been imported."""
    early = [name for name in packages if name in sys.modules]
    assert not early, f"imported before their calls could be checked: {early}"
    sys.meta_path.insert(0, _Finder(frozenset(packages)))

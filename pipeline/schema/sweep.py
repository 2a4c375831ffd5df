"""A sweep as its author declares it: a TOML file of one or more studies, each a grid of cells and a
reference.

    title = "My sweep"
    plugins = ["mine.py"]                        # estimators of one's own, relative to this file

    [[study]]
    name = "samples"
    scenes = ["soft-shadow"]                 # library names, or paths relative to this file
    metrics = ["mse", "relmse"]
    baseline = "pyrender"                    # a rasterised picture, at the cheap end of error against time
    reference = { backend = "mitsuba", spp = 4096, batches = 64 }

    [study.axes]
    estimator = ["area", "solid-angle"]
    sampler = ["independent", "sobol"]
    spp = [1, 4, 16, 64]
    seeds = 3                                # that many replicates, or a list of seeds
    parameters = { gap = [1, 0.1] }          # values of the scene template's $names

Reading checks the shape of the file; `pipeline.run.grid` looks its names up and lays out the grid.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)

from scenes.errors import PenumbraError

T = TypeVar("T")

BUILTIN = Path(__file__).parent.parent / "sweeps"


def _distinct(values: list[T]) -> list[T]:
    twice = [value for i, value in enumerate(values) if value in values[:i]]
    if twice:
        raise ValueError(f"{twice[0]!r} is given twice")
    return values


def _seed_list(value: Any) -> Any:
    """A count n of replicates stands for the seeds 0 .. n-1."""
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    if value < 1:
        raise ValueError(f"{value} replicates: give at least 1, or a list of seeds")
    return list(range(value))


Names = Annotated[list[str], Field(min_length=1), AfterValidator(_distinct)]
Samples = Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1), AfterValidator(_distinct)]
Seeds = Annotated[
    list[Annotated[int, Field(ge=0)]],
    Field(min_length=1),
    AfterValidator(_distinct),
    BeforeValidator(_seed_list),
]
Values = Annotated[
    list[Annotated[float, Field(allow_inf_nan=False)]], Field(min_length=1), AfterValidator(_distinct)
]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class ReferenceDeclaration(_Strict):
    """The reference that images are measured against; spp and batches as in `ReferenceRequest`."""

    backend: str = "mitsuba"
    spp: int = Field(default=4096, ge=2)
    batches: int = Field(default=64, ge=2)
    seed: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _enough(self) -> ReferenceDeclaration:
        if self.spp < self.batches:
            raise ValueError(
                f"spp = {self.spp} cannot be dealt to batches = {self.batches}; give at least one "
                "sample a batch"
            )
        return self


class Axes(_Strict):
    """The grid: every combination is one cell."""

    estimator: Names
    sampler: Names = ["independent"]
    spp: Samples
    seeds: Seeds = [0, 1, 2]
    parameters: dict[str, Values] = {}


class Study(_Strict):
    """One question put to some scenes.

    over: the axis of its plots, `spp` or a parameter. baseline: a rasterised picture, for the cheap end of a
    plot of error against time.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    title: str = ""
    question: str = ""
    scenes: Names
    metrics: Names
    over: str = "spp"
    baseline: Literal["pyrender"] | None = None
    reference: ReferenceDeclaration = ReferenceDeclaration()
    axes: Axes

    @property
    def scored(self) -> list[str]:
        """The metrics, with MSE in any case: the report's errors, fits and efficiencies rest on it."""
        return list(dict.fromkeys([*self.metrics, "mse"]))

    @model_validator(mode="after")
    def _known_axis(self) -> Study:
        allowed = ["spp", *self.axes.parameters]
        if self.over not in allowed:
            raise ValueError(f"over = {self.over!r} is no axis of this study; allowed: {', '.join(allowed)}")
        if self.baseline and self.over != "spp":
            raise ValueError(
                f'baseline = {self.baseline!r} is a point of error against time, which needs over = "spp"'
            )
        return self


class Sweep(_Strict):
    """A whole sweep file. plugins: Python files that register estimators, samplers or metrics."""

    title: str
    description: str = ""
    plugins: Annotated[list[str], AfterValidator(_distinct)] = []
    study: Annotated[list[Study], Field(min_length=1)]

    @model_validator(mode="after")
    def _names(self) -> Sweep:
        names = [study.name for study in self.study]
        twice = [name for i, name in enumerate(names) if name in names[:i]]
        if twice:
            raise ValueError(f"study: two studies are called {twice[0]!r}")
        return self


def builtin_sweeps() -> dict[str, Path]:
    """Name to file of the sweeps that come with Penumbra, sorted by name."""
    return {path.stem: path for path in sorted(BUILTIN.glob("*.toml"))}


def load_sweep(name_or_path: str) -> Sweep:
    """Load a built-in sweep by its name, or one from a TOML file.

    PenumbraError names the file, the key path and the allowed values.
    """
    path = builtin_sweeps().get(name_or_path)
    if path is None:
        path = Path(name_or_path)
        if path.suffix != ".toml":
            raise PenumbraError(
                f"unknown sweep {name_or_path!r}; there are: {', '.join(builtin_sweeps())}, or give a "
                ".toml file"
            )
    return parse_sweep(_text(path), str(path), path.parent)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise PenumbraError(f"{path}: cannot read the sweep: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise PenumbraError(f"{path}: cannot read the sweep: not UTF-8 text") from error


def parse_sweep(text: str, source: str, folder: Path) -> Sweep:
    """Validate TOML `text`; `source` names it in messages, scene paths are taken relative to `folder`."""
    try:
        sweep = Sweep.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise PenumbraError(f"{source}: not valid TOML: {error}") from error
    except ValidationError as error:
        raise PenumbraError("\n".join(f"{source}: {line}" for line in _lines(error))) from error
    studies = [study.model_copy(update={"scenes": _resolved(study.scenes, folder)}) for study in sweep.study]
    plugins = [str(folder / plugin) for plugin in sweep.plugins]
    return sweep.model_copy(update={"study": studies, "plugins": plugins})


def _resolved(scenes: Sequence[str], folder: Path) -> list[str]:
    return [str(folder / scene) if scene.endswith(".pbrt") else scene for scene in scenes]


def _lines(error: ValidationError) -> Iterator[str]:
    """One plain line for each problem that pydantic found."""
    seen: set[str] = set()
    for problem in error.errors():
        where = _path(problem["loc"])
        kind, context = problem["type"], problem.get("ctx", {})
        if kind == "extra_forbidden":
            line = f"{where}: unknown key; {_allowed(problem['loc'])}"
        elif kind == "missing":
            line = f"{where}: missing key"
        elif kind == "value_error":
            line = f"{where}: {context['error']}"
        elif kind == "too_short":
            line = f"{where}: is empty; give at least one"
        else:
            line = f"{where}: {problem['msg'][0].lower()}{problem['msg'][1:]}, not {problem['input']!r}"
        if line not in seen:
            seen.add(line)
            yield line.removeprefix(": ")


def _path(location: Sequence[str | int]) -> str:
    """A TOML-like key path, counted from 0."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).removeprefix(
        "."
    )


def _allowed(location: Sequence[str | int]) -> str:
    model: type[BaseModel] = Sweep
    for part in location[:-1]:
        if isinstance(part, str):
            model = _model_in(model.model_fields[part].annotation)
    keys = list(model.model_fields)
    near = difflib.get_close_matches(str(location[-1]), keys, n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    return f"allowed here: {', '.join(keys)}{hint}"


def _model_in(annotation: Any) -> type[BaseModel]:
    """The pydantic model inside an annotation such as `list[Study]`."""
    if isinstance(annotation, type) and issubclass(cast("type[Any]", annotation), BaseModel):
        return cast("type[BaseModel]", annotation)
    return next(_model_in(inner) for inner in get_args(annotation) if inner is not type(None))

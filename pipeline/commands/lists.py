"""`penumbra list`: everything that has a name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.console.command import command
from pipeline.console.options import AsJson

if TYPE_CHECKING:
    from scenes.pbrt.text.template import TemplateParameter

Row = dict[str, Any]
KINDS = ("scenes", "estimators", "samplers", "metrics", "backends", "sweeps")


@command(140, ("list scenes", "estimators, samplers, metrics ..."), name="list")
def list_names(
    kind: Annotated[
        str | None,
        typer.Argument(metavar="KIND", help=f"One of: {', '.join(KINDS)}. All kinds if not given."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the kinds of things that have names, or all scenes, estimators, samplers, metrics, reference
    backends or sweeps.

    Examples:

      penumbra list scenes

      penumbra list sweeps --json
    """
    from pipeline.console.console import Console

    console = Console(as_json=as_json)
    rows = [_kind(one) for one in KINDS] if kind is None else _rows(kind)
    console.json(rows)
    if kind == "scenes":
        cells = [
            (row["name"], row["title"], "\n".join(_parameter(p) for p in row["parameters"])) for row in rows
        ]
        console.table(("scene", "what it is", "parameters: -D name=value"), cells)
    else:
        headings = list(rows[0])
        console.table(headings, [[str(row[name]) for name in headings] for row in rows])


def _kind(kind: str) -> Row:
    names = [row["name"] for row in _rows(kind)]
    return {"kind": kind, "number": len(names), "names": ", ".join(names)}


def _rows(kind: str) -> list[Row]:
    from scenes.errors import PenumbraError

    if kind not in KINDS:
        raise PenumbraError(f"cannot list {kind!r}; allowed: {', '.join(KINDS)}")
    functions = (_scenes, _estimators, _samplers, _metrics, _backends, _sweeps)
    return dict(zip(KINDS, functions, strict=True))[kind]()


def _parameter(parameter: Row) -> str:
    allowed = f", {parameter['allowed']}" if parameter["allowed"] else ""
    return f"{parameter['name']} = {parameter['default']:g}  {parameter['meaning']}{allowed}"


def _described(parameter: TemplateParameter) -> Row:
    from scenes.pbrt.text.template import ANY

    bounds = parameter.interval
    return {
        "name": parameter.name,
        "default": parameter.default,
        "meaning": parameter.meaning,
        "allowed": "" if bounds == ANY else f"in {bounds.brackets()}",
        "low": bounds.low,
        "high": bounds.high,
    }


def _scenes() -> list[Row]:
    from scenes import library

    return [
        {
            "name": scene.name,
            "title": scene.title,
            "parameters": [_described(p) for p in scene.parameters],
        }
        for scene in library()
    ]


def _estimators() -> list[Row]:
    from renderer.interfaces.estimator import ESTIMATORS

    return [{"name": name, "title": entry.title} for name, entry in ESTIMATORS.items()]


def _samplers() -> list[Row]:
    from renderer.interfaces.sampler import SAMPLERS

    return [{"name": name, "title": entry.title} for name, entry in SAMPLERS.items()]


def _metrics() -> list[Row]:
    from pipeline.scoring.metric import METRICS

    return [
        {
            "name": name,
            "title": metric.title,
            "unit": metric.unit,
            "better": metric.better,
            "source": metric.source,
        }
        for name, metric in METRICS.items()
    ]


def _backends() -> list[Row]:
    from pipeline.backends import BACKENDS

    return [{"name": name, "title": type(entry).__doc__ or ""} for name, entry in BACKENDS.items()]


def _sweeps() -> list[Row]:
    from pipeline.schema.sweep import builtin_sweeps, load_sweep

    loaded = [(name, load_sweep(name)) for name in builtin_sweeps()]
    return [
        {"name": name, "title": sweep.title, "studies": ", ".join(s.name for s in sweep.study)}
        for name, sweep in loaded
    ]

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
"""The report of a run: one page that opens from disk, with plotly and the flip book as files beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from pipeline.store.run_folder import Run, load_run
from reports.data import points_csv
from reports.figures import error_against_parameter, error_against_time, html, plotly_source
from reports.findings import (
    cost_sentences,
    left_out_sentences,
    promise_accuracy,
    promise_plan,
    promise_stability,
    stability_sentences,
)
from reports.formats import job_line, scene_title, settings
from reports.headline import Card, accuracy_card, answer, plan_card, stability_card
from reports.images import Extremes, ImageSet, select_extremes, select_images
from reports.provenance import trace_sources
from reports.series import Panel, StudyView, select_studies
from reports.tables import Table, error_table, plan_table, region_table, samples_table
from reports.viewer import flip_script, flipbook_source
from scenes.errors import PenumbraError
from scenes.files import write_file
from scenes.images.exr import write_png

ASSETS = "assets"
LEGEND_BELOW = {"orientation": "h", "x": 0, "xanchor": "left", "y": -0.34, "yanchor": "top"}
TOLD = 3  # sentences of a section that are in view; the others fold out
NAMED = 40  # missing cells that the page names; the rest it counts


@dataclass(frozen=True, eq=False)
class Section:
    """A panel as the template needs it.

    anchor: its id. plot: HTML of its figure. samples: a table, only along a parameter. regions: a table,
    only where cells are scored by region.
    """

    anchor: str
    title: str
    panel: Panel
    sentences: list[str]
    plot: str
    table: Table
    samples: Table | None
    regions: Table | None
    images: ImageSet | None


@dataclass(frozen=True, eq=False)
class Hero:
    """The first screen's answer, from the sweep's first panel. extremes: None if nothing is scored."""

    anchor: str
    question: str
    answer: str
    plot: str
    extremes: Extremes | None


def write_report(run_dir: Path, out_dir: Path | None = None) -> Path:
    """Write the report of a run, finished or not, into `out_dir` (run_dir/report if None) and return its
    index.html.

    Renders nothing. PenumbraError where there is no run or the folder cannot be written.
    """
    run = load_run(run_dir)
    out = run_dir / "report" if out_dir is None else out_dir
    views = select_studies(run)
    pairs = [(view, panel) for view in views for panel in view.panels]
    sections = [_section(run, view, panel, number) for number, (view, panel) in enumerate(pairs, 1)]
    hero = _hero(run, sections[0]) if sections else None
    try:
        (out / ASSETS).mkdir(parents=True, exist_ok=True)
        _write_assets(out / ASSETS, sections, hero)
        write_file(out / "data.csv", points_csv(_panels(views)))
        write_file(out / "index.html", _render(run, views, sections, hero))
    except OSError as error:
        raise PenumbraError(f"{out}: cannot write the report: {error.strerror}") from error
    return out / "index.html"


def _panels(views: list[StudyView]) -> list[Panel]:
    return [panel for view in views for panel in view.panels]


def _section(run: Run, view: StudyView, panel: Panel, number: int) -> Section:
    along = panel.study.over != "spp"
    anchor = f"panel-{number}"
    title = scene_title(panel.scene, panel.fixed)
    return Section(
        anchor,
        f"{title}: error along {panel.study.over}" if along else f"{title}: error against time",
        panel,
        (stability_sentences(panel) if along else cost_sentences(panel)) + left_out_sentences(view, panel),
        html(_plot(panel), f"{anchor}-plot"),
        error_table(panel),
        samples_table(panel) if along else None,
        region_table(panel),
        select_images(run.root, panel),
    )


def _hero(run: Run, section: Section) -> Hero:
    """The first panel's question and answer; its figure once more, with the legend below."""
    panel = section.panel
    figure = _plot(panel).update_layout(legend=LEGEND_BELOW, margin={"r": 16, "b": 110})
    question = panel.study.question or f"{run.manifest.sweep.title}?"
    return Hero(
        section.anchor,
        question,
        answer(panel),
        html(figure, "hero-plot"),
        select_extremes(run.root, panel),
    )


def _plot(panel: Panel) -> go.Figure:
    along = panel.study.over != "spp"
    return error_against_parameter(panel) if along else error_against_time(panel)


def _write_assets(folder: Path, sections: list[Section], hero: Hero | None) -> None:
    (folder / "plotly.min.js").write_text(plotly_source(), encoding="utf-8")
    (folder / "flipbook.js").write_text(flipbook_source(), encoding="utf-8")
    extremes = hero.extremes if hero else None
    for number, picture in enumerate(extremes.pictures if extremes else (), 1):
        gray = None if picture.limit is None else _gray(picture.pixels, picture.limit)
        shown, exposure = (
            (picture.pixels, extremes.exposure if extremes else 0.0) if gray is None else (gray, 0.0)
        )
        write_png(folder / f"hero-{number}.png", shown, exposure)
    for section in sections:
        if section.images is not None:
            script = flip_script(f"{section.anchor}-flip", section.images.pictures, section.images.exposure)
            (folder / f"{section.anchor}.js").write_text(script, encoding="utf-8")
            for number, picture in enumerate(section.images.stills, 1):
                write_png(folder / f"{section.anchor}-{number}.png", picture.pixels, section.images.exposure)


def _render(run: Run, views: list[StudyView], sections: list[Section], hero: Hero | None) -> str:
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    missing = [cell for view in views for cell in view.missing]
    unscored = [cell for view in views for cell in view.unscored]
    return environment.get_template("page.html").render(
        title=run.manifest.sweep.title,
        description=run.manifest.sweep.description,
        cards=_cards(views),
        hero=hero,
        told=TOLD,
        views=views,
        sections=sections,
        missing=[job_line(cell.job) for cell in missing[:NAMED]],
        missing_count=len(missing),
        damaged=run.damaged[:NAMED],
        damaged_count=len(run.damaged),
        cell_count=sum(len(study.cells) for study in run.manifest.studies),
        unscored=[job_line(cell.job) for cell in unscored[:NAMED]],
        unscored_count=len(unscored),
        plan=plan_table(_panels(views)),
        origin=trace_sources(run, _panels(views)),
        assets=ASSETS,
        scene_title=scene_title,
        settings=settings,
    )


def _cards(views: list[StudyView]) -> list[Card]:
    """One card for each promise of the project."""
    return [
        accuracy_card(views, promise_accuracy(views)),
        stability_card(views, promise_stability(views)),
        plan_card(views, promise_plan(_panels(views))),
    ]


def _gray(error: NDArray[np.float64], limit: float) -> NDArray[np.float64]:
    """An error map (h, w) as shades of gray (h, w, 3): black is no error, white `limit` and more."""
    return np.repeat(np.clip(error / limit, 0.0, 1.0)[..., None], 3, axis=-1)

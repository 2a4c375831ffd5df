"""The provenance of a report: code, machine, seeds, references, and the commands that reproduce it."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pipeline.schema.record import Provenance, Record, ReferenceInfo
from pipeline.store.run_folder import Run
from reports.formats import count, scene_title, sig
from reports.series import Panel, varied, wall_over_cpu
from reports.tables import Cell, Heading, Row, Table

DIGITS = 12  # of a hash


@dataclass(frozen=True)
class Sources:
    """facts: pairs of name and text. commands: what to type. references: one row each."""

    facts: list[tuple[str, str]]
    commands: list[str]
    references: Table


def trace_sources(run: Run, panels: Sequence[Panel]) -> Sources:
    """The provenance of a run and of the cells that its report shows."""
    records = [cell.record for panel in panels for cell in panel.cells]
    made = [record.provenance for record in records] or [run.manifest.provenance]
    return Sources(_facts(run, records, made), _commands(run), _references(panels))


def _facts(run: Run, records: Sequence[Record], made: Sequence[Provenance]) -> list[tuple[str, str]]:
    days = sorted(p.created for p in made)
    render = sum(record.seconds.render for record in records)
    return [
        ("Penumbra", _each(p.penumbra for p in made)),
        ("Commit", _each((p.commit or "not from a checkout") for p in made)),
        (
            "Renderer",
            f"{_each(p.renderer[:DIGITS] for p in made)} (SHA-256 of its sources, first {DIGITS} digits)",
        ),
        ("Python", _each(p.python for p in made)),
        (
            "Packages",
            _each(", ".join(f"{name} {version}" for name, version in p.versions.items()) for p in made),
        ),
        ("Machine", _each(f"{p.machine}, {count(p.cores, 'core')}; one thread a render" for p in made)),
        ("Rendered", f"{days[0]} to {days[-1]}" if days[0] != days[-1] else days[0]),
        ("Cost", f"{count(len(records), 'image')}, {sig(render)} s of rendering in all"),
        ("Clock", _clock(records)),
        (
            "Seeds",
            "; ".join(f"{s.name}: {', '.join(map(str, s.axes.seeds))}" for s in run.manifest.sweep.study),
        ),
        *said_of_scenes(records),
    ]


def said_of_scenes(records: Sequence[Record]) -> list[tuple[str, str]]:
    """Each note and each substitution once, with the scenes that it is about."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for record in records:
        said = [("Note", line) for line in record.notes]
        for pair in (*said, *(("Substituted", line) for line in record.substitutions)):
            found.setdefault(pair, {})[record.job.scene] = None
    return [(name, f"{', '.join(scenes)}: {line}") for (name, line), scenes in found.items()]


def _clock(records: Sequence[Record]) -> str:
    """The ratio of wall to CPU seconds, which shows a busy machine."""
    ratios = wall_over_cpu(records)
    if not ratios:
        return "no image took measurable CPU time"
    return (
        f"wall over CPU seconds of the renders: median {statistics.median(ratios):.2f}, largest "
        f"{max(ratios):.2f}"
    )


def _each(values: Iterable[str]) -> str:
    return "; ".join(dict.fromkeys(values))


def _commands(run: Run) -> list[str]:
    name, folder = run.manifest.name, run.root
    if name == "demo":
        return [f"penumbra demo --out {folder}"]
    return [f"penumbra run {name} --out {folder}", f"penumbra report {folder}"]


def _references(panels: Sequence[Panel]) -> Table:
    """Each reference once, under the name of its first scene."""
    found: dict[str, tuple[str, ReferenceInfo]] = {}
    for panel in panels:
        for cell in panel.cells:
            if cell.card:
                title = scene_title(panel.scene, varied(panel.study, cell.entry.job))
                found.setdefault(cell.card.reference.key, (title, cell.card.reference))
    headings = (
        Heading("scene", words=True),
        Heading("backend", words=True),
        Heading("spp"),
        Heading("batches"),
        Heading("RMS standard error", "W/(m² sr)"),
        Heading("time", "s"),
        Heading("file in the run's folder", words=True),
    )
    return Table(headings, tuple(_reference_row(title, info) for title, info in found.values()))


def _reference_row(title: str, info: ReferenceInfo) -> Row:
    sampled = info.batches > 0
    return Row(
        (
            Cell(title, kind="left"),
            Cell(info.backend, kind="left"),
            Cell(f"{info.spp:,}" if sampled else "none"),
            Cell(str(info.batches) if sampled else "none"),
            Cell(sig(info.rms_standard_error), "" if sampled else "error bound"),
            Cell(sig(info.seconds)),
            Cell(info.image.replace(info.key, f"{info.key[:DIGITS]}…"), kind="left mono", title=info.image),
        )
    )

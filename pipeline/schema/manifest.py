"""The manifest of a run: its validated sweep, the keys of its cells, and what was left out and why.

`manifest.json` is written before the first image; cells that it names and the folder lacks are still to come.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.schema.record import Job, Provenance
from pipeline.schema.sweep import Sweep

MANIFEST_VERSION = 1


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LeftOut(_Frozen):
    """Cells of the grid that are not in the run, and the reason."""

    study: str
    scene: str
    what: str = Field(description="the estimator or the reference that does not apply")
    reason: str


class CellEntry(_Frozen):
    """One cell: its job as this sweep names it, and the keys of its record and scores.

    Cells are addressed by content, so that two names for one scene share a record: show the job from here.
    """

    key: str = Field(description="cells/<key>/")
    job: Job
    score: str = Field(description="scores/<score>/")


class StudyEntry(_Frozen):
    """The cells of one study of the sweep, in the order in which they are rendered."""

    name: str
    cells: list[CellEntry]
    left_out: list[LeftOut] = []


class Manifest(_Frozen):
    """`manifest.json` of a run folder."""

    manifest_version: Literal[1] = MANIFEST_VERSION
    name: str = Field(description="the sweep as it was called: a built-in name or a file name")
    sweep: Sweep
    studies: list[StudyEntry]
    provenance: Provenance


def replaces(old: Manifest, new: Manifest) -> str | None:
    """Say which cells would be lost if `new` replaced `old`; None if none would.

    A sweep may go on with changed code, with more cells, or with other scores. Another sweep would leave
    cells in the folder that no manifest names.
    """
    if old.sweep == new.sweep:
        return None
    if old.name != new.name:
        return f"holds a run of the sweep {old.name!r}, and this is {new.name!r}"
    studies = {study.name: [cell.job for cell in study.cells] for study in new.studies}
    for study in old.studies:
        if study.name not in studies:
            return f"holds a run of an earlier {old.name!r} that had a study {study.name!r}"
        gone = [cell.job for cell in study.cells if cell.job not in studies[study.name]]
        if gone:
            return (
                f"holds a run of an earlier {old.name!r} with {len(gone)} cells in {study.name!r} that "
                "it has no more"
            )
    return None

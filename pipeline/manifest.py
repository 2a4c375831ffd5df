"""What a run is to hold: the sweep as validated, its cells by key, and what was left out and why.

`manifest.json` is written before the first image; whatever it names and the folder lacks is still to be made.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.record import Job, Provenance
from pipeline.sweep import Sweep

MANIFEST_VERSION = 1


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LeftOut(_Frozen):
    """Cells that the grid has and the run has not, in words."""

    study: str
    scene: str
    what: str = Field(description="the estimator or the reference that does not apply")
    reason: str


class CellEntry(_Frozen):
    """One cell: its job as this sweep names it, and where its record and scores are found.

    Cells are addressed by content, so that two names for one scene share a record; the job here is the one to show.
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

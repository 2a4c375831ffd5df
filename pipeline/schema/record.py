"""The records of a run as versioned JSON: the job, its cost, its result and its provenance.

Every number that a report shows comes from here. Units: seconds; radiance in W/(m^2 sr); counts of rays. A
record is read back as it was: NaN and infinities, which JSON lacks, are the strings "NaN", "Infinity" and
"-Infinity" in it. What commands print has null in their place.
"""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

SCHEMA_VERSION = 2

Verdict = Literal["ok", "untrustworthy"]


class _Frozen(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", ser_json_inf_nan="strings")


class Job(_Frozen):
    """One render to be made: all that its image depends on."""

    scene: str = Field(description="library name or path of a .pbrt file")
    parameters: dict[str, float] = Field(default_factory=dict, description="values of the template's $names")
    estimator: str
    sampler: str
    spp: int = Field(ge=1)
    seed: int = Field(ge=0)


class Seconds(_Frozen):
    """Times of one cell. `render` and `cpu` are of the passes alone, without work done once a scene."""

    load: float = Field(description="reading and parsing the scene")
    build: float = Field(description="arrays and the BVH")
    plan: float
    render: float = Field(description="wall clock of the passes, warm, one thread")
    cpu: float = Field(description="CPU seconds of the same passes")


class RayCounts(_Frozen):
    """The rays that were traced, without those that the plan left out."""

    primary: int
    shadow: int


class PlanDecision(_Frozen):
    """One effect, whether this scene calls for it, and why."""

    effect: str
    needed: bool
    reason: str


class SampleStatistics(_Frozen):
    """Statistics of the samples themselves, without any reference.

    noise: root mean square over pixels and channels of the standard error that independent samples would
    have. max_share: the largest reflected sample's share in all the reflected light of the image; in one
    pixel a large share means nothing, since a penumbra pixel rightly has one lit sample of 64. hill: Hill's
    tail index of the largest reflected samples; below 2 the variance cannot be believed; None for too few
    samples. verdict, reason: the conclusion from these figures (pipeline/statistics/samples.py).
    """

    noise: float
    max_share: float
    hill: float | None
    nonfinite: int
    verdict: Verdict
    reason: str = ""


class Provenance(_Frozen):
    """The versions, the commit and the machine that made a record."""

    penumbra: str
    renderer: str = Field(description="fingerprint of the renderer's and the scenes' sources")
    commit: str | None
    versions: dict[str, str]
    python: str
    machine: str
    cores: int
    created: str = Field(description="ISO 8601, UTC")


class Score(_Frozen):
    """A metric's value with its 95 % interval.

    value: None if undefined, for the reason in `note`. bound: whether `value` is only an upper bound, since
    the reference is too noisy; a lower bound for a metric whose higher values are better.
    """

    metric: str
    value: float | None
    low: float | None = None
    high: float | None = None
    bound: bool = False
    note: str = ""


class ReferenceInfo(_Frozen):
    """The reference that an image was scored against, with its own standard error."""

    backend: str
    key: str
    spp: int
    batches: int
    rms_standard_error: float
    seconds: float
    image: str = Field(description="path of its EXR relative to the run's folder")


class Record(_Frozen):
    """One finished cell of a sweep."""

    schema_version: Literal[2] = SCHEMA_VERSION
    key: str = Field(description="content address: scene content, job, renderer fingerprint")
    job: Job
    scene_hash: str
    width: int
    height: int
    seconds: Seconds
    rays: RayCounts
    statistics: SampleStatistics
    plan: list[PlanDecision]
    notes: list[str] = Field(
        default=[], description="where pbrt's image of the file is another, a line a kind"
    )
    substitutions: list[str] = Field(default=[], description="what is rendered as the nearest, a line a kind")
    image: str = Field(description="path of its EXR relative to the run's folder")
    provenance: Provenance


class RegionMap(_Frozen):
    """A scene's label image, with the channels region, visibility and dark (pipeline/studies/regions.py)."""

    schema_version: Literal[2] = SCHEMA_VERSION
    scene_hash: str
    spp: int
    contact: float = Field(description="distance, as a share of that to the camera, below which things touch")
    pixels: dict[str, int] = Field(description="how many pixels each region has")
    image: str = Field(description="path of its EXR relative to the run's folder")


class RegionScores(_Frozen):
    """The scores over one region of the picture."""

    pixels: int
    scores: dict[str, Score]


class ScoreCard(_Frozen):
    """The scores of one cell against one reference."""

    schema_version: Literal[2] = SCHEMA_VERSION
    cell: str
    reference: ReferenceInfo
    scores: dict[str, Score]
    error_map: str | None = Field(
        default=None, description="path of an error-map EXR relative to the run's folder"
    )
    regions: dict[str, RegionScores] = Field(
        default_factory=dict, description="by name; none where no light is scored"
    )
    region_map: RegionMap | None = None

"""Results that show themselves in a notebook: a render as an image, scores as a table."""

from __future__ import annotations

import base64
import math
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.schema.record import Score
from pipeline.scoring.metric import METRICS
from pipeline.scoring.tone import exposure
from renderer import RenderResult
from renderer.interfaces.sampler import SAMPLERS
from scenes.images.exr import write_png

Image = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Render:
    """A rendered image.

    result: the render with the statistics of its samples. stops: the exposure it is shown at; None shows the
    median lit pixel as middle gray.

        plt.imshow(pn.render("soft-shadow").image.clip(0, 1))
    """

    scene: str
    estimator: str
    sampler: str
    spp: int
    result: RenderResult
    stops: float | None = None

    @property
    def image(self) -> Image:
        """The image (h, w, 3), linear radiance."""
        return self.result.image

    @property
    def variance(self) -> Image | None:
        """The variance (h, w, 3) of the mean; None for one sample a pixel, and for dependent samples."""
        known = SAMPLERS[self.sampler].independent and np.isfinite(self.result.variance).all()
        return self.result.variance if known else None

    @property
    def seconds(self) -> float:
        """Wall-clock seconds of the render itself."""
        return self.result.seconds.render

    def exposed(self, stops: float) -> Render:
        """The same render, shown `stops` brighter than its radiance; 0 shows radiance 1 as white."""
        return replace(self, stops=stops)

    def _stops(self) -> float:
        return math.log2(exposure(self.image)) if self.stops is None else float(self.stops)

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory(prefix="penumbra-") as folder:
            path = Path(folder) / "shown.png"
            write_png(path, self.image, self._stops())
            return path.read_bytes()

    def _repr_html_(self) -> str:
        encoded = base64.b64encode(self._repr_png_()).decode("ascii")
        return (
            f'<figure><img alt="{escape(self.scene)}" src="data:image/png;base64,{encoded}">'
            f"<figcaption>{escape(str(self))}; shown at {self._stops():+.1f} stops</figcaption></figure>"
        )

    def __str__(self) -> str:
        height, width = self.image.shape[:2]
        return (
            f"{self.scene}, {self.estimator}, {self.sampler}, {self.spp} spp, {width} x {height}, "
            f"{self.seconds:.3g} s"
        )


@dataclass(frozen=True, eq=False)
class Scores(Mapping[str, Score]):
    """Scores by metric, each with its 95 % interval where it has one.

    values = {name: score.value for name, score in scores.items()}
    """

    scores: dict[str, Score]

    def __getitem__(self, name: str) -> Score:
        return self.scores[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.scores)

    def __len__(self) -> int:
        return len(self.scores)

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Metric, value, 95 % interval, unit and note of each, as text."""
        return [
            (name, _value(name, one), _interval(one), METRICS[name].unit, one.note)
            for name, one in self.scores.items()
        ]

    def __str__(self) -> str:
        return "\n".join("  ".join(filter(None, row)) for row in self.rows())

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{text}</th>" for text in ("metric", "value", "95 % interval", "unit", "note"))
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self.rows()
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _value(name: str, score: Score) -> str:
    if score.value is None:
        return "undefined"
    sign = "" if not score.bound else "≥ " if METRICS[name].better == "higher" else "≤ "
    return f"{sign}{score.value:.4g}"


def _interval(score: Score) -> str:
    return "" if score.low is None or score.high is None else f"{score.low:.4g} .. {score.high:.4g}"

"""Mean absolute error. How it is measured: absolute_error.py."""

from __future__ import annotations

from typing import final

from pipeline.scoring.absolute_error import absolute_score
from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference


@final
class Mae:
    """Mean over pixels and channels of |estimate - reference|, in radiance (imgtool's MAE [pharr2023])."""

    name = "mae"
    title = "MAE"
    unit = "W/(m² sr)"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[pharr2023], the program's Image::MAE"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score with its interval; map (h, w): mean absolute difference over channels."""
        return absolute_score(self.name, estimate, reference)


METRICS.add("mae", Mae())

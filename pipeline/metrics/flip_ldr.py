"""LDR-FLIP of the displayed pictures: one exposure, the reference's (NVIDIA's flip-evaluator)."""

from __future__ import annotations

from typing import final

from pipeline.metrics.flip import map_mean
from pipeline.scoring.flip_library import error_map
from pipeline.scoring.metric import METRICS, Better, Estimate, Judges, Measured, Reference
from pipeline.scoring.tone import displayed, exposure
from pipeline.scoring.undefined import defect, undefined


@final
class FlipLdr:
    """Mean of the FLIP error map [andersson2020] at 67 pixels a degree, of the pictures as displayed: 0
    (equal) to 1.

    Exposed for the reference, sRGB, clipped to [0, 1], so that what is brighter than white does not count;
    `flip` looks at a range of exposures. The map's filters overlap, so that one image gives no interval:
    replicate seeds do.
    """

    name = "flip-ldr"
    title = "LDR-FLIP (sRGB, exposed for the reference)"
    unit = "1"
    better: Better = "lower"
    judges: Judges = "error"
    source = "[andersson2020]; flip-evaluator 1.7"

    def __call__(self, estimate: Estimate, reference: Reference) -> Measured:
        """Score; map (h, w) of the error."""
        if note := defect(estimate, reference):
            return undefined(self.name, note)
        scale = exposure(reference.mean)
        truth, shown = displayed(reference.mean, scale), displayed(estimate.mean, scale)
        return map_mean(self.name, error_map(truth, shown, "LDR", {}), f"exposure {scale:.4g}")


METRICS.add("flip-ldr", FlipLdr())

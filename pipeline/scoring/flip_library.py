# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""NVIDIA's flip-evaluator, called for its error map only; the one import of it."""

from __future__ import annotations

import os
from typing import Any, Literal

import numpy as np

from pipeline.scoring.metric import Image

# The library reads this when it is loaded: its OpenMP threads must sleep between loops. Spinning, they take
# the cores from other workers (measured: 0.3 s a call instead of 0.05 s on two busy cores) and from timings.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

from flip_evaluator import evaluate

PIXELS_PER_DEGREE = 67.0  # 0.7 m from a 0.7 m wide display of 3840 pixels


def error_map(truth: Image, shown: Image, kind: Literal["LDR", "HDR"], parameters: dict[str, Any]) -> Image:
    """The FLIP error map, (h, w) float64 in 0 .. 1, of two finite images (h, w, 3).

    kind: "LDR" for sRGB-encoded images in [0, 1], "HDR" for linear ones.
    """
    left, right = (np.ascontiguousarray(image, dtype=np.float32) for image in (truth, shown))
    asked = {"ppd": PIXELS_PER_DEGREE} | parameters
    error, _, _ = evaluate(left, right, kind, applyMagma=False, computeMeanError=False, parameters=asked)
    return np.asarray(error, dtype=np.float64)[..., 0]

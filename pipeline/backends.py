"""All reference backends: those of `pipeline.references`, and `self`, which is the renderer itself.

Import `BACKENDS` from here: the registry alone lacks `self` until this module is imported.
"""

from __future__ import annotations

from pipeline import self_reference as self_reference
from pipeline.references.protocol import BACKENDS as BACKENDS

__all__ = ["BACKENDS", "self_reference"]

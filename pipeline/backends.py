"""All ways of making references: those of `pipeline.references`, which never see our renderer, and the
renderer itself.

Who looks backends up by name does it here; `BACKENDS` alone lacks `self` until this module is imported.
"""

from __future__ import annotations

from pipeline import self_reference as self_reference
from pipeline.references.protocol import BACKENDS as BACKENDS

__all__ = ["BACKENDS", "self_reference"]

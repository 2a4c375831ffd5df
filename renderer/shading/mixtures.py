"""Surfaces of several materials: each point is of one of them, which a hash of the point and of wo chooses.

As pbrt-v4's MixMaterial::ChooseMaterial [pharr2023, sec. 10.5.1]. The shapes of a scene are followed by rows
that stand for the materials of mixes; a kind of material sees them as further shapes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.math.hashing import hash_vectors, to_unit
from renderer.records import SurfaceHit
from renderer.textures import Places, evaluate
from scenes.arrays import Index
from scenes.description.materials import MixedMaterial
from scenes.description.shapes import ShapeDescription
from scenes.description.textures import Texture


@dataclass(frozen=True, eq=False)
class _Choice:
    """row: of the mix. first, second: the rows of its materials. salt: sets nested choices apart."""

    row: int
    amount: Texture
    first: int
    second: int
    salt: int


@dataclass(frozen=True, eq=False)
class Mixtures:
    """All choices of a scene, each before those among its own materials."""

    choices: tuple[_Choice, ...]

    def rows(self, hit: SurfaceHit) -> Index:
        """(n,): the row of the material of each point; the shape's own where it is no mix."""
        row = hit.shape.copy()
        for choice in self.choices:
            rows = np.flatnonzero(row == choice.row)
            if rows.size:
                amount = evaluate(choice.amount, Places.of(hit, rows))[0]
                # pbrt takes the second where amount >= u, and draws no u where the amount is 0 or 1.
                p, wo = hit.p.take(rows, axis=1), hit.wo.take(rows, axis=1)
                u = to_unit(hash_vectors(p, wo, salt=choice.salt))
                second = (amount >= 1) | ((amount > 0) & (amount >= u))
                row[rows] = np.where(second, choice.second, choice.first)
        return row


def mixtures(shapes: Sequence[ShapeDescription]) -> tuple[list[ShapeDescription], Mixtures | None]:
    """The shapes and, after them, a row for each material of a mix; None where nothing is mixed."""
    rows, salts = list(shapes), dict.fromkeys(range(len(shapes)), 1)
    choices: list[_Choice] = []
    for number, shape in enumerate(rows):  # which grows meanwhile
        if isinstance(shape.material, MixedMaterial):
            one, salt = shape.material, salts[number]
            at = len(rows)
            choices.append(_Choice(number, one.amount, at, at + 1, salt))
            both = zip(one.parts, one.perturbations, strict=True)
            rows += [replace(shape, material=part, perturbation=normals) for part, normals in both]
            salts |= {at: 2 * salt, at + 1: 2 * salt + 1}
    return rows, Mixtures(tuple(choices)) if choices else None

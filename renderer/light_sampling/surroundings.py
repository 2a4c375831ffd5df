"""Several lights that surround a scene, as one light: their radiance adds up, and one of them is sampled.

A direction that leaves the scene meets all of them. Its density is that of the mixture of their techniques,
so that weights stay as bounded as those of one light. Half of the choice is in proportion to flux and half is
uniform, since the visible part of a portal depends on the point.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.interfaces.light import DirectionSampler, Index, LightGroup, Parts, Surroundings
from renderer.math.vectors import Floats
from renderer.records import LightSample


@dataclass(frozen=True, eq=False)
class SumOfSurroundings:
    """All lights of the groups as one light, in the place of the first. chance: (k,) the probability of
    choosing each.
    """

    groups: tuple[Surroundings, ...]
    chance: Floats

    @staticmethod
    def of(groups: Sequence[Surroundings]) -> SumOfSurroundings:
        flux = np.concatenate([group.flux for group in groups])
        flux = flux / max(flux.max(), np.finfo(np.float64).tiny)
        equal = np.full(flux.size, 1 / flux.size)
        return SumOfSurroundings(tuple(groups), (flux / max(flux.sum(), 1.0) + equal) / (1.0 + flux.any()))

    @property
    def parts(self) -> Parts:
        return Parts.whole([min(int(group.parts.source.min()) for group in self.groups)])

    @property
    def flux(self) -> Floats:
        return np.array([sum(float(group.flux.sum()) for group in self.groups)])

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        first, *others = self.groups
        shared = (name for name in first.techniques if all(name in g.techniques for g in others))
        return {name: Mixture(self, name) for name in shared}

    def members(self) -> Iterator[tuple[Surroundings, int]]:
        """The group of each light, and its number there."""
        for group in self.groups:
            yield from ((group, i) for i in range(group.parts.source.size))

    def radiance_along(self, index: Index, ref_p: Floats, wi: Floats) -> Floats:
        out = np.zeros_like(wi)
        for group, i in self.members():
            out += group.radiance_along(np.full_like(index, i), ref_p, wi)
        return out

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        out = np.zeros(ref_p.shape)
        for group, i in self.members():
            own = group.irradiance(np.full_like(index, i), ref_p, ref_n)
            if own is None:
                return None
            out += own
        return out


@dataclass(frozen=True, eq=False)
class Mixture:
    """One of the lights by one technique, with the density of the mixture of all [veach1995]."""

    lights: SumOfSurroundings
    name: str

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """One direction a row; not valid where the chosen light is not seen."""
        li, n = self.lights, index.size
        ref_p = np.broadcast_to(ref_p, (3, n))
        ref_n = np.broadcast_to(ref_n, (3, n))
        sums = np.concatenate([[0.0], np.cumsum(li.chance)])
        last = int(np.flatnonzero(li.chance)[-1])
        above: Index = np.array(np.searchsorted(sums, u[0], side="right"), dtype=np.int64)
        chosen = np.minimum(above - 1, last)
        rest = np.clip((u[0] - sums[chosen]) / li.chance[chosen], 0.0, np.nextafter(1.0, 0.0))
        wi, radiance = np.zeros((3, n)), np.zeros((3, n))
        pdf, valid = np.zeros(n), np.zeros(n, dtype=np.bool_)
        for k, (group, i) in enumerate(li.members()):
            rows = np.flatnonzero(chosen == k)
            if not rows.size:
                continue
            own = np.full(rows.size, i, dtype=np.int64)
            p, normal = ref_p.take(rows, axis=1), ref_n.take(rows, axis=1)
            part = group.techniques[self.name].sample_direction(
                own, p, normal, np.stack([rest[rows], u[1][rows]])
            )
            wi[:, rows], valid[rows] = part.wi, part.valid
            pdf[rows], radiance[:, rows] = li.chance[k] * part.pdf, part.radiance
        # Of the light chosen its own figures hold: on an edge of a texel a look-up might take the other side.
        for k, (group, i) in enumerate(li.members()):
            rows = np.flatnonzero((chosen != k) & valid)
            own = np.full(rows.size, i, dtype=np.int64)
            p, normal, along = (v.take(rows, axis=1) for v in (ref_p, ref_n, wi))
            pdf[rows] += li.chance[k] * group.techniques[self.name].pdf_direction(own, p, normal, along)
            radiance[:, rows] += group.radiance_along(own, p, along)
        return LightSample(wi, np.full(n, np.inf), -wi, radiance, pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        out = np.zeros(index.size)
        for k, (group, i) in enumerate(self.lights.members()):
            own = np.full_like(index, i)
            out += self.lights.chance[k] * group.techniques[self.name].pdf_direction(own, ref_p, ref_n, wi)
        return out


def with_one_surroundings(groups: Sequence[LightGroup]) -> list[LightGroup]:
    """The groups, where several that surround the scene are replaced by their sum."""
    around = [group for group in groups if isinstance(group, Surroundings)]
    if sum(group.parts.source.size for group in around) < 2:
        return list(groups)
    total = SumOfSurroundings.of(around)
    first = next(i for i, group in enumerate(groups) if group is around[0])
    rest: list[LightGroup] = [group for group in groups if not isinstance(group, Surroundings)]
    return [*rest[:first], total, *rest[first:]]

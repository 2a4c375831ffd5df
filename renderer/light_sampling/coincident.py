"""Lights that share a place: the same face given twice, two back to back, or a mesh with both windings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.math.vectors import Floats
from scenes.arrays import Index, Mask
from scenes.description.coincidence import coinciding
from scenes.description.shapes import ShapeDescription
from scenes.errors import SceneError


@dataclass(frozen=True, eq=False)
class Coincident:
    """Lights that share a place, and the light that a ray sees which meets one of them.

    first: (K,) the first light in the place of each. front, back: (3, K) the radiance of all lights of that
    place together, on the side of each light's normal and on the other side. by_front, by_back: (K,) one
    light of the place that shines to that side, or the light itself. The lights of a place are equally likely
    to be chosen, so that they share one density.
    """

    first: Index
    front: Floats
    back: Floats
    by_front: Index
    by_back: Index

    def seen(self, light: Index, cosine: Floats) -> tuple[Index, Floats]:
        """The light (n,) that a ray sees where it meets lights (n,) at these cosines, and the radiance (3, n)
        of all lights in that place. cosine: (n,) of the ray with the normal of the light that it meets.
        """
        front = cosine < 0
        radiance = np.where(front, self.front.take(light, axis=1), self.back.take(light, axis=1))
        return np.where(front, self.by_front.take(light), self.by_back.take(light)), radiance

    def mean(self, values: Floats) -> Floats:
        """(K,): the mean of values (K,) over the lights of each place."""
        return (np.bincount(self.first, values) / np.maximum(np.bincount(self.first), 1))[self.first]

    def shared(self, light: Index) -> Mask:
        """(n,): whether lights (n,) share their places with others."""
        return np.bincount(self.first, minlength=self.first.size)[self.first[light]] > 1


def coincident_lights(shapes: Sequence[ShapeDescription], source: Index, of_shape: Mask) -> Coincident | None:
    """The lights that share a place, of K lights in all; None where there are none.

    shapes: the first sources. source: (K,) the source of each light. of_shape: (K,) whether that is a shape.
    Raises SceneError where a light that shares its place has an image.
    """
    found = coinciding(shapes)
    if found is None:
        return None
    for shape in (shapes[int(i)] for i in found.shapes):
        if shape.emission is not None and shape.emission.image is not None:
            raise SceneError("a light with an image is where another light is", shape.where)
    own = np.flatnonzero(of_shape)
    order = own[np.argsort(source[own], kind="stable")]  # the light that each face is
    first = np.arange(source.size)
    first[order] = order[found.group]
    emissions = [s.emission for s in shapes if s.emission is not None]
    front, back = np.zeros((3, source.size)), np.zeros((3, source.size))
    both = np.array([e.two_sided for e in emissions], dtype=np.bool_)[found.shape]
    radiance = np.stack([e.radiance for e in emissions], axis=1)[:, found.shape]
    ahead, behind = found.same_side | both, ~found.same_side | both
    by = [np.full(source.size, -1, dtype=np.int64) for _ in range(2)]
    for total, shines, one in ((front, ahead, by[0]), (back, behind, by[1])):
        group = order[found.group[shines]]
        for channel in range(3):
            total[channel] = np.bincount(group, radiance[channel, shines], minlength=source.size)
        one[group] = order[shines]
    turned = np.zeros(source.size, dtype=np.bool_)
    turned[order] = ~found.same_side
    itself = np.arange(source.size)
    fronts, backs = (np.where(one[first] >= 0, one[first], itself) for one in by)
    return Coincident(
        first,
        np.where(turned, back[:, first], front[:, first]),
        np.where(turned, front[:, first], back[:, first]),
        np.where(turned, backs, fronts),
        np.where(turned, fronts, backs),
    )

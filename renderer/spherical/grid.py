"""Images on the sphere: the texel in a direction, and the directions of a texel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.math.piecewise import BELOW_ONE, Integers, Place
from renderer.math.vectors import Floats
from renderer.spherical import latlong, octahedral
from scenes.arrays import Index, Mask


@dataclass(frozen=True, eq=False)
class SphereGrid:
    """k images whose texels are numbered through, row by row. height, width: (k,). latlong: (k,) bool,
    latitude-longitude images; the others are square and octahedral. first: (k,) an image's first texel.
    """

    height: Index
    width: Index
    latlong: Mask
    first: Index

    def texel(self, index: Integers, place: Place) -> Index:
        """The texel numbers (n,) of places. index: (n,) the image."""
        return self.first.take(index) + place.row * self.width.take(index) + place.column

    def direction(self, index: Integers, place: Place) -> Floats:
        """Unit vectors (3, n) of places; a uniform place in a texel gives a uniform direction in the texel's
        solid angle.
        """
        height, width = self.height.take(index), self.width.take(index)
        if not self.latlong.any():
            return _octahedral(place, width)
        polar = latlong.texel_to_sphere(place.row, place.column, place.x, place.y, height, width)
        return (
            polar if self.latlong.all() else np.where(self.latlong[index], polar, _octahedral(place, width))
        )

    def texel_at(self, index: Integers, w: Floats) -> Index:
        """The texel numbers (n,) in directions w (3, n), unit; on an edge, either of two. NaN gives the first
        texel.
        """
        along, down = self._position(index, w)
        height, width = self.height.take(index), self.width.take(index)
        return self.first.take(index) + _cell(down, height) * width + _cell(along, width)

    def place(self, index: Integers, w: Floats) -> Place:
        """Places of unit vectors w (3, n): the inverse of `direction`."""
        along, down = self._position(index, w)
        height, width = self.height.take(index), self.width.take(index)
        row, column = _cell(down, height), _cell(along, width)
        y = down - row
        if self.latlong.any():
            y = np.where(self.latlong[index], latlong.share_of_row(w, row, height), y)
        return Place(row, column, np.clip(along - column, 0.0, BELOW_ONE), np.clip(y, 0.0, BELOW_ONE))

    def _position(self, index: Integers, w: Floats) -> Floats:
        """Column and row (2, n) with their fractions; nearest look-up takes the floor."""
        if self.latlong.all():
            square = latlong.sphere_to_square(w)
        elif self.latlong.any():
            square = np.where(
                self.latlong[index], latlong.sphere_to_square(w), octahedral.sphere_to_square(w)
            )
        else:
            square = octahedral.sphere_to_square(w)
        square[0] *= self.width.take(index)
        square[1] *= self.height.take(index)
        return square

    def solid_angle(self, image: int) -> Floats:
        """(h, 1): the solid angle in sr of each texel of a row; an image's texels sum to 4 pi."""
        height, width = self.height[image], self.width[image]
        if not self.latlong[image]:
            return np.full((height, 1), 4 * np.pi / (height * width))
        # sin^2 b - sin^2 a = sin(b + a) sin(b - a), and angles from the nearer pole: no cancellation at
        # either
        row = np.arange(float(height)) + 0.5
        middle = np.sin(np.minimum(row, height - row) * (np.pi / height))
        return ((4 * np.pi / width) * middle * np.sin(0.5 * np.pi / height))[:, None]

    def above(self, image: int) -> Floats:
        """(h, w): the part of each texel with z > 0, for images of an even height: 0, 1, or 1/2 where z = 0
        is its diagonal.
        """
        height, width = int(self.height[image]), int(self.width[image])
        if height % 2:
            raise ValueError("the horizon cuts the texels of an image of an odd height")
        if self.latlong[image]:
            return np.repeat((np.arange(height) < height // 2).astype(np.float64)[:, None], width, axis=1)
        # z = 0 where |a| + |b| = 1 in [-1, 1]^2; twice a texel's centre is odd, so that the sum compares as
        # integers.
        off = np.abs(2 * np.arange(height) + 1 - height)
        total = off[:, None] + off
        return np.where(total < height, 1.0, np.where(total == height, 0.5, 0.0))


def _octahedral(place: Place, size: Integers) -> Floats:
    return octahedral.square_to_sphere(
        np.stack([(place.column + place.x) / size, (place.row + place.y) / size])
    )


def _cell(position: Floats, count: Integers) -> Index:
    """The cell (n,) of 0 ... count - 1 that holds a position in [0, count]; NaN counts as 0, since a cast of
    NaN is undefined.
    """
    return np.fmin(np.fmax(position, 0.0), count - 1.0).astype(np.int64)

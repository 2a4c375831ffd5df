"""Shapes as triangles with normals, and their materials as one colour each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.baseline.task import Array, Surface
from scenes.description.shapes import Emission, Geometry, ShapeDescription, Sphere


@dataclass(frozen=True, eq=False)
class View:
    """The map from world space to an OpenGL camera's. axes: (3, 3), unit rows right, up and backwards."""

    origin: Array
    axes: Array
    scale: float = 1.0

    def points(self, p: Array) -> Array:
        """World points (..., 3) in camera space."""
        return self.vectors(p - self.origin) * self.scale

    def vectors(self, v: Array) -> Array:
        """World directions (..., 3) in camera space, of unchanged length."""
        return v @ self.axes.T


def surface(shape: ShapeDescription, view: View) -> Surface:
    """The shape as triangles in camera space, with its material."""
    corners, normals = tessellate(shape.geometry)
    return Surface(
        view.points(corners).reshape(-1, 3),
        view.vectors(normals).reshape(-1, 3),
        shape.material.normal_reflectance,
        np.zeros(3) if shape.emission is None else mean_emission(shape.emission),
        shape.emission is not None and shape.emission.two_sided,
        shape.material.mean_alpha,
    )


def tessellate(geometry: Geometry) -> tuple[Array, Array]:
    """Corners and normals of triangles, (t, 3, 3) each, in world space.

    Normals lie on the emitting side. They are those of the sphere or the vertices, else of each triangle.
    """
    mesh = geometry.triangulated()
    corners, side = mesh.vertices[mesh.faces], -1.0 if mesh.reverse else 1.0
    if isinstance(geometry, Sphere):
        return corners, side * (corners - geometry.center) / geometry.radius
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    whole = length[:, 0] > 0  # the others have no area, and no normal
    flat = np.repeat((normals[whole] / length[whole] * side)[:, None], 3, axis=1)
    if mesh.normals is None:
        return corners[whole], flat
    smooth = mesh.normals[mesh.faces[whole]]
    size = np.linalg.norm(smooth, axis=-1, keepdims=True)
    told = (size > 0) & (size < np.inf)
    return corners[whole], np.where(told, smooth / np.where(told, size, 1.0), flat)


def mean_emission(emission: Emission) -> Array:
    """Mean radiance (3,) over the shape."""
    image = emission.image
    return emission.radiance if image is None else emission.radiance * image.mean(axis=(0, 1))

"""Shapes as triangles with normals, and their materials as one colour each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.baseline.task import Array, Surface
from scenes.description.materials import Conductor, Dielectric, Material
from scenes.description.shapes import Emission, Geometry, ShapeDescription, Sphere
from scenes.description.textures import Checkerboard, ImageTexture, Mix, Product, Texture

SPHERE_SAG = 3e-4  # of the radius: the most that a triangle lies below its sphere (measured, 2.85e-4)


@dataclass(frozen=True, eq=False)
class View:
    """From world space into that of an OpenGL camera. origin: (3,); axes: (3, 3), its rows right, up and
    backwards, unit.
    """

    origin: Array
    axes: Array
    scale: float = 1.0

    def points(self, p: Array) -> Array:
        """World points (..., 3) as the camera has them."""
        return self.vectors(p - self.origin) * self.scale

    def vectors(self, v: Array) -> Array:
        """World directions (..., 3), their lengths kept."""
        return v @ self.axes.T


def surface(shape: ShapeDescription, view: View) -> Surface:
    """The shape as triangles in camera space, with its material."""
    corners, normals = tessellate(shape.geometry)
    color, roughness = _color(shape.material)
    return Surface(
        view.points(corners).reshape(-1, 3),
        view.vectors(normals).reshape(-1, 3),
        color,
        np.zeros(3) if shape.emission is None else mean_emission(shape.emission),
        shape.emission is not None and shape.emission.two_sided,
        roughness,
    )


def tessellate(geometry: Geometry) -> tuple[Array, Array]:
    """Corners and normals of triangles, (t, 3, 3) each, world space; normals on the side that would emit.

    Spheres and meshes with vertex normals have those at the corners, everything else the normal of
    each triangle.
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
    """(3,) the mean radiance over the shape."""
    return (
        emission.radiance if emission.image is None else emission.radiance * emission.image.mean(axis=(0, 1))
    )


def _color(material: Material) -> tuple[Array, float | None]:
    """Albedo, or reflectance at normal incidence and roughness."""
    if isinstance(material, Conductor):
        below, above = (material.eta - 1) ** 2 + material.k**2, (material.eta + 1) ** 2 + material.k**2
        return below / above, material.mean_alpha
    if isinstance(material, Dielectric):  # opaque here: what a pane reflects, and nothing of what it shows
        reflectance = ((material.eta - 1) / (material.eta + 1)) ** 2
        return np.full(3, reflectance), material.mean_alpha
    return _mean(material.reflectance), None


def _mean(texture: Texture) -> Array:
    """(3,) the mean of a texture: exact for one image or checkerboard, and where what is multiplied does not
    vary together.
    """
    match texture:
        case ImageTexture():
            return texture.value(texture.image).mean(axis=(0, 1))
        case Checkerboard():
            return (_mean(texture.first) + _mean(texture.second)) / 2
        case Product():
            return _mean(texture.first) * _mean(texture.second)
        case Mix():
            amount = _mean(texture.amount)
            return (1 - amount) * _mean(texture.first) + amount * _mean(texture.second)
        case _:
            return texture

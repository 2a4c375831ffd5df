"""A SceneDescription as the worker's task: camera, surfaces, lights and background."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.baseline.lights import ambient, encloses, of_light, of_shape
from pipeline.baseline.surfaces import View, mean_emission, surface, tessellate
from pipeline.baseline.task import Array, Task
from pipeline.references.mitsuba.environment import radiance
from scenes.description.lights import Environment, environments
from scenes.description.scene import Camera, SceneDescription
from scenes.errors import SceneError

# Each takes up to 32 of a shader's constants, of which graphics cards and Mesa have 4096 or more.
MOST_LIGHTS = 96


def refuses(scene: SceneDescription) -> str | None:
    """Say in one sentence why the scene cannot be rasterised; None if it can."""
    lights = sum(shape.emission is not None for shape in scene.shapes) + len(scene.lights)
    if lights > MOST_LIGHTS:
        return f"it has {lights} lights, and a shader here has room for {MOST_LIGHTS}"
    try:
        make_view(scene.camera)
    except SceneError as error:
        return str(error)
    return None


def convert(scene: SceneDescription) -> Task:
    """The scene as triangles and lights without size; SceneError if `refuses` gives a reason."""
    if why := refuses(scene):
        raise SceneError(f"{scene.name} cannot be rasterised: {why}", None)
    view = make_view(scene.camera)
    depths = [-view.points(tessellate(shape.geometry)[0])[..., 2] for shape in scene.shapes]
    farthest = max((float(depth.max(initial=0.0)) for depth in depths), default=0.0)
    view = replace(view, scale=1.0 / farthest if farthest > 0 else 1.0)
    film = scene.film
    lights = [light for shape in scene.shapes for light in of_shape(shape, view)]
    lights += [of_light(light, view) for light in scene.lights if not isinstance(light, Environment)]
    skies = environments(scene.lights)
    domes = [mean_emission(shape.emission) for shape in scene.shapes if encloses(shape) and shape.emission]
    return Task(
        film.width,
        film.height,
        scene.camera.film_plane(film),
        tuple(surface(shape, view) for shape in scene.shapes),
        tuple(lights),
        np.sum([np.zeros(3), *(ambient(sky) for sky in skies), *domes], axis=0),
        _background(scene, view, skies),
        1.0 / view.scale,
    )


def make_view(camera: Camera) -> View:
    """pbrt's camera as OpenGL's: z is turned, since OpenGL looks along -z, with x and y as they are.

    This mirrors space, which keeps angles and lengths. A scale of the camera only stretches its rays.
    SceneError for a camera with shear or unequal scale.
    """
    axes = camera.pinhole("the rasterised baseline").camera_to_world[:3, :3].T
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    axes = axes / lengths
    if np.ptp(lengths) > 1e-6 * lengths.max() or np.abs(axes @ axes.T - np.eye(3)).max() > 1e-6:
        raise SceneError(
            "the camera's transformation has shear or unequal scale, which OpenGL's camera cannot have"
        )
    return View(camera.camera_to_world[:3, 3], axes * np.array([[1.0], [1.0], [-1.0]]))


def _background(scene: SceneDescription, view: View, skies: tuple[Environment, ...]) -> Array:
    """The background where no surface is seen, (h, w, 3), along the ray through each pixel's middle."""
    w, h = scene.film.width, scene.film.height
    image = np.zeros((h, w, 3))
    if not skies:
        return image
    left, top, dx, dy = scene.camera.film_plane(scene.film)
    x, y = left + dx * (np.arange(w) + 0.5), top - dy * (np.arange(h) + 0.5)
    rays = np.stack([*np.broadcast_arrays(x[None, :], y[:, None], -1.0)], axis=-1) @ view.axes
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    for sky in skies:
        image += radiance(sky, rays @ sky.frame)
    return image

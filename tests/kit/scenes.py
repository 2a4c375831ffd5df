"""Scenes made by hand, and exact points in them, for tests that need no scene file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from renderer.build import RenderScene
from renderer.interfaces.estimator import ESTIMATORS, OCCLUSION
from renderer.interfaces.sampler import SAMPLERS
from renderer.plan.plan import make_plan, plan_occlusion
from renderer.records import SurfaceHit
from renderer.shading.delta_lobes import dimensions, reflected_light
from renderer.textures import Places
from scenes.description.lights import Light, PointLight, SpotLight
from scenes.description.materials import Diffuse
from scenes.description.scene import Film, PerspectiveCamera, SceneDescription
from scenes.description.shapes import BilinearMesh, Emission, Geometry, ShapeDescription, TriangleMesh

BLACK, GRAY = Diffuse(np.zeros(3)), Diffuse(np.full(3, 0.5))


def look_at(eye: list[float], target: list[float], width: int = 32, height: int = 24, fov: float = 40.0):
    """A camera and its film; up is +y."""
    forward = np.subtract(target, eye).astype(float)
    forward /= np.linalg.norm(forward)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :4] = np.stack([right, np.cross(forward, right), forward, np.array(eye, dtype=float)], axis=1)
    return PerspectiveCamera(matrix, fov), Film(width, height)


def scene(
    shapes: list[ShapeDescription], eye=(0.3, 2.0, -5.0), target=(0.0, 0.5, 0.0), **film
) -> SceneDescription:
    camera, size = look_at(list(eye), list(target), **film)
    return SceneDescription("by hand", camera, size, tuple(shapes))


def floor(half: float = 4.0, y: float = 0.0, material: Diffuse = GRAY) -> ShapeDescription:
    p = np.array([[-half, y, -half], [-half, y, half], [half, y, half], [half, y, -half]])
    return ShapeDescription(TriangleMesh(p, np.array([[0, 1, 2], [0, 2, 3]])), material)


def patch(corner, ex, ey, radiance=None, two_sided: bool = False, reverse: bool = False) -> ShapeDescription:
    """A rectangle, emitting if a radiance is given; normal ex x ey."""
    c, x, y = (np.array(v, dtype=float) for v in (corner, ex, ey))
    mesh = BilinearMesh(np.stack([c, c + x, c + y, c + x + y]), np.array([[0, 1, 2, 3]]), reverse)
    return light(mesh, radiance, two_sided) if radiance is not None else ShapeDescription(mesh, GRAY)


def light(geometry: Geometry, radiance=(3.0, 2.0, 1.0), two_sided: bool = False) -> ShapeDescription:
    return ShapeDescription(geometry, BLACK, Emission(np.array(radiance, dtype=float), two_sided))


def reflect(
    built: RenderScene,
    points: np.ndarray,
    normal,
    shape: int,
    estimator: str,
    spp: int,
    sampler: str = "independent",
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error, each (m, 3), of the light reflected at exact points (m, 3) of a shape, spp
    samples each.
    """
    chosen = ESTIMATORS[estimator]
    plan = plan_occlusion(built) if chosen.quantity == OCCLUSION else make_plan(built, prune=False)
    m = len(points)
    pixel, sample = np.repeat(np.arange(m), spp), np.tile(np.arange(spp), m)
    p = np.ascontiguousarray(np.repeat(points, spp, axis=0).T)
    n = np.broadcast_to(np.array(normal, dtype=float)[:, None], p.shape).copy()
    none = np.full(m * spp, -1)
    # Any triangle of a flat shape will do: it says how far float32 may have moved the surface.
    own = np.full(m * spp, np.flatnonzero(built.triangles.shape == shape)[0]) if built.triangles else none
    hit = SurfaceHit(p, n, n, np.full(m * spp, shape), own, none, np.zeros((2, 1)))
    u = SAMPLERS[sampler](seed, spp).uniform(pixel, sample, 2, dimensions(chosen, built))
    samples = reflected_light(chosen, built, plan, hit, u).radiance.reshape(3, m, spp)
    return samples.mean(axis=2).T, samples.std(axis=2, ddof=1).T / np.sqrt(spp)


def moved(
    given: SceneDescription, scale: float, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> SceneDescription:
    """The whole scene, camera included, scaled about the origin and then moved; it sends the same light to
    the same pixels.
    """
    shift = np.array(offset, dtype=float)

    def shape(s: ShapeDescription) -> ShapeDescription:
        g = s.geometry
        if isinstance(g, TriangleMesh | BilinearMesh):
            return replace(s, geometry=replace(g, vertices=g.vertices * scale + shift))
        return replace(s, geometry=replace(g, center=g.center * scale + shift, radius=g.radius * scale))

    def lamp(light: Light) -> Light:
        if isinstance(light, PointLight | SpotLight):
            return replace(
                light, position=light.position * scale + shift, intensity=light.intensity * scale**2
            )
        return light

    matrix = given.camera.camera_to_world.copy()
    matrix[:3, 3] = matrix[:3, 3] * scale + shift
    return replace(
        given,
        camera=replace(given.camera, camera_to_world=matrix),
        shapes=tuple(shape(s) for s in given.shapes),
        lights=tuple(lamp(light) for light in given.lights),
        occlusion_distance=given.occlusion_distance * scale,
    )


def box(center, half: float, material: Diffuse = GRAY) -> ShapeDescription:
    """A closed cube of triangles, normals outwards."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float) * half
    faces = [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
    return ShapeDescription(TriangleMesh(np.array(center, dtype=float) + corner, np.array(faces)), material)


def places(uv: np.ndarray, p: np.ndarray | None = None, n: np.ndarray | None = None) -> Places:
    """Points of which only uv (2, n), and where given their place and normal (3, n), are known."""
    unknown = np.full((3, uv.shape[1]), np.nan)
    return Places(uv, *(unknown if v is None else v for v in (p, n)))

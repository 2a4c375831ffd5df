"""Plan and passes: camera -> hit -> emission -> light sample -> shadow -> shade -> film, in chunks of whole
pixels.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from collections.abc import Set as AbstractSet
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from numbers import Integral
from typing import cast

import numpy as np

from renderer.build import RenderScene, build
from renderer.film import BLOCK, TAIL, Film, PixelSums, RatioSums, keep_largest, luminance
from renderer.geometry.cutouts import Cutouts
from renderer.geometry.normal_perturbation import NormalPerturbations
from renderer.geometry.primitives import on_surfaces
from renderer.interfaces.estimator import ESTIMATORS, RADIANCE, Estimator
from renderer.interfaces.sampler import SAMPLERS, Sampler
from renderer.light_sampling.coincident import Coincident
from renderer.math.vectors import Floats, dot
from renderer.memory import keep_freed_memory
from renderer.plan.limits import check
from renderer.plan.plan import PRUNINGS, RenderPlan, make_plan, plan_occlusion
from renderer.records import RayCounts, Seconds, SurfaceHit
from renderer.shading.delta_lobes import dimensions, reflected_light
from renderer.shading.emission import with_emission_images
from scenes.arrays import Index
from scenes.description.scene import SceneDescription
from scenes.errors import PenumbraError

# Rows of a wavefront. Between two kernels a thread waits for the interpreter: the longer a kernel, the less.
# Arrays of the most still lie in a shared cache, those of the least in a core's own.
MOST_ROWS, LEAST_ROWS = 2**16, 2**14
PARTS = 4  # for each thread at least, so that none waits long for the last
FEW_LIGHTS = 16  # with more, memory for what each row asks of each light counts


@dataclass(frozen=True, eq=False)
class RenderResult:
    """An image, and what its samples tell about it.

    image: (h, w, 3) linear radiance. variance: (h, w, 3) of the mean, for independent samples; NaN at 1 spp.
    tail: the largest luminances among reflected samples, descending, at most 4096. reflected: the number of
    samples of reflected light; reflected_sum: the sum of their luminances. nonfinite: the number of samples
    that are NaN or infinite.
    """

    image: Floats
    variance: Floats
    film: Film
    tail: Floats
    reflected: int
    reflected_sum: float
    nonfinite: int
    rays: RayCounts
    seconds: Seconds
    plan: RenderPlan


@dataclass(frozen=True, eq=False)
class RenderJob:
    """The data that all chunks share."""

    scene: RenderScene
    plan: RenderPlan
    estimator: Estimator
    sampler: Sampler
    spp: int

    @property
    def ratio(self) -> bool:
        """Whether a pixel is a ratio of means."""
        return self.estimator.ratio


@dataclass(frozen=True, eq=False)
class _Chunk:
    """Whole pixels with all their samples."""

    pixel: Index
    sums: PixelSums | RatioSums
    tail: Floats
    reflected: int
    nonfinite: int
    rays: RayCounts


def render(
    scene: SceneDescription | RenderScene,
    *,
    estimator: str | Estimator = "mis",
    sampler: str = "independent",
    spp: int = 16,
    seed: int = 0,
    prune: bool = True,
    keep: frozenset[str] = frozenset(),
    threads: int = 1,
    rows: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> RenderResult:
    """Render the direct light of a scene.

    estimator, sampler: names from their registries; an estimator may also be given as an object. spp: samples
    a pixel. keep: prunings of PRUNINGS to leave out. threads, rows: the division of the work, without effect
    on any bit of the image. progress: called with the share done.

    Raises PenumbraError for arguments of a wrong type, unknown names, spp, threads or rows below 1, a seed
    below 0, and an estimator that does not apply to the scene.
    """
    _check_numbers(spp=(spp, 1), seed=(seed, 0), threads=(threads, 1))
    if rows is not None:
        _check_numbers(rows=(rows, 1))
    _check_types(scene, estimator, sampler, prune, progress)
    _check_prunings(keep)
    built = scene if isinstance(scene, RenderScene) else build(scene)
    chosen = ESTIMATORS[estimator] if isinstance(estimator, str) else estimator
    _check(built, chosen)
    prune, keep = (
        (prune, keep) if built.sources.all else (True, frozenset())
    )  # nothing to sample: all is black
    plan = make_plan(built, prune, keep) if chosen.quantity == RADIANCE else plan_occlusion(built)
    if chosen.quantity == RADIANCE:
        check(built, plan if prune and not keep else make_plan(built))
    work = RenderJob(built, plan, chosen, SAMPLERS[sampler](seed, spp), spp)
    keep_freed_memory()
    start, cpu = time.perf_counter(), time.process_time()
    chunks = _run(work, threads, rows, progress)
    film, total = _film(built, chunks)
    elapsed, cpu = time.perf_counter() - start, time.process_time() - cpu
    return RenderResult(
        image=film.mean,
        variance=film.variance_of_mean(),
        film=film,
        tail=keep_largest(np.concatenate([c.tail for c in chunks])),
        reflected=sum(c.reflected for c in chunks),
        reflected_sum=total,
        nonfinite=sum(c.nonfinite for c in chunks),
        rays=sum((c.rays for c in chunks), RayCounts()),
        seconds=Seconds(built.seconds_build, plan.seconds, elapsed, cpu),
        plan=plan,
    )


def _check_numbers(**given: tuple[object, int]) -> None:
    """PenumbraError for the first argument, given with its least value, that is below it or no
    whole number.
    """
    for name, (value, least) in given.items():
        if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < least:
            raise PenumbraError(f"{name} is {value!r}: it must be a whole number of at least {least}")


def _check_types(scene: object, estimator: object, sampler: object, prune: object, progress: object) -> None:
    """PenumbraError for the first argument of a wrong type."""
    given = isinstance(scene, SceneDescription | RenderScene)
    for name, value, right, what in (
        ("scene", scene, given, "a scene that is loaded or built"),
        ("estimator", estimator, isinstance(estimator, str | Estimator), "a name or an Estimator"),
        ("sampler", sampler, isinstance(sampler, str), "a name"),
        ("prune", prune, isinstance(prune, bool), "True or False"),
        ("progress", progress, progress is None or callable(progress), "a function or None"),
    ):
        if not right:
            raise PenumbraError(f"{name} is {value!r}: it must be {what}")


def _check_prunings(keep: object) -> None:
    """PenumbraError for anything but a set of names from PRUNINGS."""
    if not isinstance(keep, AbstractSet):
        raise PenumbraError(f"keep is {keep!r}: it must be a set of prunings, of {', '.join(PRUNINGS)}")
    if unknown := sorted(map(str, cast("AbstractSet[object]", keep) - set(PRUNINGS))):
        raise PenumbraError(f"unknown pruning {unknown[0]!r} in keep; there are: {', '.join(PRUNINGS)}")


def _check(built: RenderScene, estimator: Estimator) -> None:
    if why := estimator.refuses(built.description):
        raise PenumbraError(
            f"estimator {estimator.name!r} does not apply to scene {built.description.name!r}: {why}"
        )


def _run(
    work: RenderJob, threads: int, rows: int | None, progress: Callable[[float], None] | None
) -> list[_Chunk]:
    """All chunks, in the order of their pixels."""
    camera = work.scene.camera
    pixels, samples = camera.width * camera.height, min(work.spp, BLOCK)
    if rows is None:
        most = MOST_ROWS if len(work.scene.lights) <= FEW_LIGHTS else LEAST_ROWS
        rows = most if threads == 1 else min(most, max(LEAST_ROWS, pixels * samples // (PARTS * threads)))
    step = max(1, rows // samples)
    parts = [np.arange(first, min(first + step, pixels)) for first in range(0, pixels, step)]
    chunks: list[_Chunk] = []
    with ThreadPoolExecutor(threads) as pool:
        one = partial(_chunk, work)
        for chunk in pool.map(one, parts) if threads > 1 else map(one, parts):
            chunks.append(chunk)
            if progress:
                progress(len(chunks) / len(parts))
    return chunks


def _chunk(work: RenderJob, pixels: Index) -> _Chunk:
    """All samples of some pixels, a block of samples at a time."""
    sums = RatioSums(pixels.size) if work.ratio else PixelSums(pixels.size)
    tail = np.zeros(0)
    reflected, nonfinite, rays = 0, 0, RayCounts()
    for first in range(0, work.spp, BLOCK):
        samples = np.arange(first, min(first + BLOCK, work.spp))
        pixel, sample = np.tile(pixels, samples.size), np.repeat(samples, pixels.size)
        emitted, light, ratio, count, traced = _samples(work, pixel, sample)
        total = emitted + light
        nonfinite += int(total.size / 3 - np.isfinite(total).all(axis=0).sum())
        brightness = luminance(light)
        floor = tail[-1] if tail.size == TAIL else 0.0
        tail = keep_largest(np.concatenate([tail, brightness[brightness > floor]]))
        shape = (3, samples.size, pixels.size)
        if isinstance(sums, RatioSums):
            sums.add(*(v.reshape(shape) for v in (emitted, light, *ratio)))
        else:
            sums.add(total.reshape(shape), light.reshape(shape))
        reflected += count
        rays += traced
    return _Chunk(pixels, sums, tail, reflected, nonfinite, rays)


def _samples(
    work: RenderJob, pixel: Index, sample: Index
) -> tuple[Floats, Floats, tuple[Floats, ...], int, RayCounts]:
    """One sample a row: emission seen (3, n), reflected light (3, n), the parts of a ratio (3, n), the number
    of points shaded, the rays traced.
    """
    scene, plan = work.scene, work.plan
    first = scene.camera.dimensions
    o, d = scene.camera.rays(pixel, work.sampler.uniform(pixel, sample, 0, first))
    hit, emitted, rows = _first_hits(scene, plan, o, d)
    reflected = np.zeros_like(d)
    ratio = (np.zeros_like(d), np.zeros_like(d)) if work.ratio else ()
    if not rows.size:
        return emitted, reflected, ratio, 0, RayCounts(d.shape[1])
    u = work.sampler.uniform(pixel[rows], sample[rows], first, dimensions(work.estimator, scene))
    light = reflected_light(work.estimator, scene, plan, hit, u)
    reflected[:, rows] = light.radiance
    for out, part in zip(ratio, light.ratio or (), strict=True):
        out[:, rows] = part
    return emitted, reflected, ratio, rows.size, RayCounts(d.shape[1], light.shadow_rays)


def _first_hits(
    scene: RenderScene, plan: RenderPlan, o: Floats, d: Floats
) -> tuple[SurfaceHit, Floats, Index]:
    """The points to shade, the emission seen (3, n), and the rows (m,) of these points, at the first hits of
    camera rays from o (3, n) or (3, 1) along d (3, n).
    """
    t, shape, triangle, primitive = _nearest(scene, plan, o, d)
    if scene.cutouts is not None:
        _go_through(scene, plan, scene.cutouts, o, d, (t, shape, triangle, primitive))
    emitted = _emission(scene, o, d, t, shape, primitive, triangle) if plan.emits else np.zeros_like(d)
    rows = np.flatnonzero((shape >= 0) & plan.receivers[shape]) if len(scene) else shape[:0]
    mine = d.take(rows, axis=1)
    p = _from(o, rows) + mine * t[rows]
    hit = _surface(scene, p, mine, shape[rows], triangle[rows], primitive[rows])
    return hit, emitted, rows


def _nearest(
    scene: RenderScene, plan: RenderPlan, o: Floats, d: Floats, left: SurfaceHit | None = None
) -> tuple[Floats, Index, Index, Index]:
    """First hits of rays from o (3, n) or (3, 1) along d (3, n): distance (n,), inf for none; shape, triangle
    and analytic primitive (n,), -1 for none.

    left: the points whose surfaces the rays leave.
    """
    none = np.full(d.shape[1], -1, dtype=np.int64)
    if scene.triangles is None:
        t, triangle = np.full(d.shape[1], np.inf), none
    elif left is None:
        t, triangle = scene.triangles.closest(o, d)
    else:
        t, triangle = scene.triangles.closest_from(o, left.normal_towards(d), left.triangle, d)
    near, primitive = scene.analytic.closest(plan.in_view, o, d, None if left is None else left.primitive)
    # Within contact_epsilon prefer the analytic hit: float32 cannot order coplanar surfaces.
    on_analytic = near < t + scene.contact_epsilon
    t = np.where(on_analytic, near, t)
    triangle, primitive = np.where(on_analytic, -1, triangle), np.where(on_analytic, primitive, -1)
    shape = none if scene.triangles is None else np.where(triangle >= 0, scene.triangles.shape[triangle], -1)
    if on_analytic.any():
        shape = np.where(on_analytic, scene.analytic.shape[primitive], shape)
    return t, shape, triangle, primitive


def _go_through(
    scene: RenderScene,
    plan: RenderPlan,
    cutouts: Cutouts,
    o: Floats,
    d: Floats,
    found: tuple[Floats, Index, Index, Index],
) -> None:
    """Follow rays through holes to the surfaces behind. Changes `found`, the result of `_nearest`,
    in place.
    """
    t, shape, triangle, primitive = found
    rows = np.flatnonzero((shape >= 0) & cutouts.some[shape])
    start = np.broadcast_to(o, d.shape).take(rows, axis=1)
    while rows.size:
        mine = d.take(rows, axis=1)
        p = _from(o, rows) + mine * t[rows]
        _, n = on_surfaces(scene.triangles, scene.analytic, p.copy(), triangle[rows], primitive[rows])
        passed = cutouts.passed(start, mine, p, n, shape[rows], triangle[rows], primitive[rows])
        rows, mine, p = rows[passed], mine[:, passed], p[:, passed]
        hit = _surface(scene, p, mine, shape[rows], triangle[rows], primitive[rows])
        start = hit.p
        further, shape[rows], triangle[rows], primitive[rows] = _nearest(scene, plan, start, mine, hit)
        t[rows] += further
        on = cutouts.some[shape[rows]] & (shape[rows] >= 0)
        rows, start = rows[on], start[:, on]


def _of_all(
    scene: RenderScene,
    coincident: Coincident,
    le: Floats,
    cosine: Floats,
    primitive: Index,
    triangle: Index,
) -> Floats:
    """Le (3, n) of the lights that rays meet, together with the lights that share their place."""
    lights, out = scene.lights, le.copy()
    for table, which in ((lights.of_primitive, primitive), (lights.of_triangle, triangle)):
        rows = np.flatnonzero(which >= 0)
        light = table[which[rows]] if rows.size else rows
        shared = coincident.shared(light)
        rows, light = rows[shared], light[shared]
        out[:, rows] = coincident.seen(light, cosine[rows])[1]
    return out


def _from(o: Floats, rows: Index) -> Floats:
    """The origins of the rays `rows`, (3, m), or (3, 1) where all share one."""
    return o if o.shape[1] == 1 else o.take(rows, axis=1)


def _emission(
    scene: RenderScene,
    o: Floats,
    d: Floats,
    t: Floats,
    shape: Index,
    primitive: Index,
    triangle: Index,
) -> Floats:
    """Radiance (3, n) of the lights that rays from o along d (3, n) see on their emitting side, and of what
    surrounds the scene.
    """
    out = np.zeros_like(d)
    rows = (
        np.flatnonzero((shape >= 0) & (scene.sources.of_shape[shape] >= 0))
        if len(scene)
        else np.flatnonzero(shape > 0)
    )
    if rows.size:
        mine, own = d.take(rows, axis=1), shape[rows]
        p = _from(o, rows) + mine * t[rows]
        p, normal = on_surfaces(scene.triangles, scene.analytic, p, triangle[rows], primitive[rows])
        front = (dot(mine, normal) < 0) | scene.two_sided[own]
        le = with_emission_images(scene, scene.emission.take(own, axis=1), primitive[rows], p)
        le = np.where(front, le, 0.0)
        if scene.lights.coincident is not None:
            le = _of_all(
                scene, scene.lights.coincident, le, dot(mine, normal), primitive[rows], triangle[rows]
            )
        out[:, rows] = le
    if scene.lights.environment is not None:
        rows = np.flatnonzero(shape < 0)
        out[:, rows] = scene.lights.environment[0].radiance_along(
            np.zeros_like(rows), _from(o, rows), d.take(rows, axis=1)
        )
    return out


def _surface(
    scene: RenderScene,
    p: Floats,
    d: Floats,
    shape: Index,
    triangle: Index,
    primitive: Index,
) -> SurfaceHit:
    """Points near p (3, n), moved onto their surfaces, with normals on the side that rays d (3, n)
    come from.
    """
    p, n = on_surfaces(scene.triangles, scene.analytic, p, triangle, primitive)
    front = dot(n, d) <= 0
    ns = None
    if scene.shading_normals is not None:
        ns, own = scene.shading_normals.at(p, n, triangle, primitive)
        front = np.where(own, dot(ns, d) <= 0, front)
        ns = np.where(dot(ns, d) <= 0, ns, -ns)
    n = np.where(dot(n, d) <= 0, n, -n)
    # A point of a lamp's own surface must not lie on the wrong side of it by rounding: the lamp would fill
    # its whole sky.
    glowing = np.flatnonzero(scene.sources.of_shape[shape] >= 0)
    if glowing.size:
        p[:, glowing] += n.take(glowing, axis=1) * scene.contact_epsilon
    hit = SurfaceHit(p, n, -d, shape, triangle, primitive, np.zeros((2, 1)), front, shading_n=ns)
    if scene.coordinates is not None:
        hit = replace(hit, uv=scene.coordinates.at(p, triangle, primitive))
    if scene.mixtures is not None:
        hit = replace(hit, material=scene.mixtures.rows(hit))
    if scene.perturbations is not None:
        hit = _perturbed(scene.perturbations, hit)
    if scene.coordinates is None or not scene.coordinates.oriented:
        return hit
    return replace(hit, tangent=scene.coordinates.tangent(p, triangle, primitive))


def _perturbed(perturbations: NormalPerturbations, hit: SurfaceHit) -> SurfaceHit:
    """Points with shading normals turned by their normal or bump maps, on the side of wo."""
    outside = np.where(hit.front, hit.ns, -hit.ns)
    turned = perturbations.at(
        hit.p, outside, hit.uv, hit.of_one_material().shape, (hit.triangle, hit.primitive), hit.n
    )
    # The geometric normal on the outside, as pbrt orients it by the shading normal.
    n = np.where(dot(hit.n, outside) < 0, -hit.n, hit.n)
    turned = np.where(dot(turned, n) < 0, -turned, turned)
    front = dot(turned, hit.wo) >= 0
    return replace(hit, front=front, shading_n=np.where(front, turned, -turned))


def _film(scene: RenderScene, chunks: list[_Chunk]) -> tuple[Film, float]:
    """The film of all chunks, and the sum of reflected luminances in the order of pixels."""
    h, w = scene.camera.height, scene.camera.width

    def image(parts: list[Floats]) -> Floats:
        return np.ascontiguousarray(np.concatenate(parts, axis=1).T.reshape(h, w, 3))

    count = np.full((h, w), chunks[0].sums.count)
    sums = [c.sums for c in chunks]
    total = float(np.concatenate([s.reflected for s in sums]).sum())
    return Film(
        count, image([s.mean for s in sums]), image([s.m2 for s in sums]), image([s.maximum for s in sums])
    ), total

"""`Sampler`, `Integrator`, `Accelerator` and `Option`: a file's settings of the renderer, which a request may
override.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenes.errors import Location, SceneError
from scenes.pbrt.state import Builder, refuse_kind
from scenes.pbrt.text.parameters import Parameters

# pbrt-v4's sampler, what it is called here, and pbrt's number of samples where the file gives none.
SAMPLERS = {
    "independent": "independent",
    "stratified": "stratified",
    "sobol": "sobol",
    "paddedsobol": "sobol",
    "zsobol": "sobol",
    "halton": "sobol",
    "pmj02bn": "sobol",
}
SPP_LIMIT = 2**24
PATHS = ("path", "simplepath", "volpath")
# Integrators of which the direct component alone is rendered, pbrt-v3's `directlighting` among them.
TRANSPORT = (
    "simplevolpath", "randomwalk", "lightpath", "bdpt", "mlt", "sppm", "directlighting",
)  # fmt: skip
# Options that change no image of ours, and those that would if they were true.
HARMLESS = (
    "disabletexturefiltering", "disablewavelengthjitter", "displacementedgescale", "pixelstats", "rendercoordsys", "seed", "wavefront",  # noqa: E501
    "msereferenceimage", "msereferenceout",
)  # fmt: skip
HARMFUL = {
    "disablepixeljitter": "samples fall all over the pixel filter",
    "forcediffuse": "materials are as the file gives them",
}


def sampler(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Sampler`: Owen-scrambled Sobol' points stand for each of pbrt's low-discrepancy samplers."""
    refuse_kind(kind, " ".join(SAMPLERS), parameters)
    seed = parameters.integer("seed", 0)
    if seed < 0:
        raise parameters.fail("seed", f"seed must not be negative: {seed}")
    spp = (
        _strata(parameters)
        if kind == "stratified"
        else _count(parameters, "pixelsamples", 4 if kind == "independent" else 16)
    )
    if kind == "halton":
        parameters.text("randomization", "permutedigits")
    elif "sobol" in kind and parameters.text("randomization", "fastowen") not in ("fastowen", "owen"):
        parameters.remark("randomization", "points are Owen-scrambled, whatever randomization says")
    builder.defaults = replace(builder.defaults, sampler=SAMPLERS[kind], spp=spp, seed=seed)


def _count(parameters: Parameters, name: str, default: int) -> int:
    value = parameters.integer(name, default)
    if not 1 <= value <= SPP_LIMIT:
        raise parameters.fail(name, f"{name} must be at least 1 and at most {SPP_LIMIT}, not {value}")
    return value


def _strata(parameters: Parameters) -> int:
    if not parameters.flag("jitter", True):
        parameters.remark("jitter", "strata are sampled at random points, whatever jitter says")
    spp = _count(parameters, "xsamples", 4) * _count(parameters, "ysamples", 4)
    if spp > SPP_LIMIT:
        raise parameters.fail("xsamples", f"{spp} samples a pixel; at most {SPP_LIMIT} are supported")
    return spp


def integrator(builder: Builder, kind: str, parameters: Parameters) -> None:
    """`Integrator`: ambient occlusion, or the direct component of any light transport: direct light and
    visible emission, as by pbrt's path tracer at depth 1.
    """
    builder.integrator = kind, parameters.where
    if kind == "ambientocclusion":
        _ambient_occlusion(builder, parameters)
        return
    refuse_kind(kind, " ".join([*PATHS, *TRANSPORT, "ambientocclusion"]), parameters)
    builder.occlusion_distance, builder.without_lights = np.inf, None
    builder.defaults = replace(builder.defaults, estimator=None)
    if kind in TRANSPORT:
        parameters.ignore()
        problem = f'Integrator "{kind}": this is the direct component; pbrt follows light further'
        builder.report.note(problem, parameters.where)
        return
    depth = parameters.integer("maxdepth", 5)
    if depth < 1:
        parameters.unsupported(
            "maxdepth", f"maxdepth is {depth}: pbrt shows emission alone, without any light"
        )
    elif depth > 1:
        given = "" if parameters.given("maxdepth") else " (pbrt's default)"
        problem = f"maxdepth is {depth}{given}: this is the direct component, as with maxdepth 1"
        builder.report.note(problem, parameters.located("maxdepth"))
    if kind == "simplepath":
        lights, brdf = parameters.flag("samplelights", True), parameters.flag("samplebsdf", True)
        chosen = None if lights else "bsdf" if brdf else "hemisphere"
        builder.defaults = replace(builder.defaults, estimator=chosen)
        if not lights:
            builder.without_lights = parameters.located("samplelights")
        return
    parameters.text("lightsampler", "bvh")  # which light a sample goes to is the estimator's affair here
    parameters.flag("regularize", False)  # pbrt regularizes behind the first bounce only


def check_delta(builder: Builder) -> None:
    """Report `samplelights` false where pbrt would then lose delta lights, which no sampled direction
    meets.
    """
    delta = any(not light.surrounds for light in builder.lights)
    if builder.without_lights is not None and delta:
        problem = "without samplelights pbrt leaves point, spot and distant lights out; that is not supported"
        builder.report.add(f"{problem}: take them out of the scene", builder.without_lights)


def _ambient_occlusion(builder: Builder, parameters: Parameters) -> None:
    parameters.flag("cossample", True)  # how pbrt draws directions; its image is the same
    distance = parameters.number("maxdistance", np.inf)
    if distance <= 0:
        raise parameters.fail("maxdistance", f"maxdistance must be positive, not {distance:g}")
    builder.occlusion_distance, builder.without_lights = distance, None
    builder.defaults = replace(builder.defaults, estimator="ambient-occlusion")


def accelerator(_: Builder, kind: str, parameters: Parameters) -> None:
    """`Accelerator`: every value is accepted, since none changes the image."""
    parameters.ignore()


def option(builder: Builder, name: str, value: str, where: Location) -> None:
    """`Option "name" value`. As in pbrt, case, dashes and underscores of the name do not count, and a type
    before it is allowed.
    """
    word = name.split()[-1] if name.split() else ""
    known = word.lower().replace("-", "").replace("_", "")
    if known in HARMFUL:
        if value not in ("true", "false"):
            raise SceneError(f'Option "{name}" is true or false, not {value!r}', where)
        if value == "true":
            builder.report.note(f'Option "{name}" is left out: {HARMFUL[known]}', where)
    elif known not in HARMLESS:
        allowed = ", ".join(sorted([*HARMLESS, *HARMFUL]))
        raise SceneError(f'unknown Option "{name}"; there are: {allowed}', where)

"""Lights that arrive from a single direction at every point: sampled with certainty, never met by a ray."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from renderer.interfaces.light import DirectionSampler, Index, LightExample, LightKind, Parts, Source
from renderer.math.vectors import Floats, dot
from renderer.records import LightSample
from scenes.arrays import Mask
from scenes.description.lights import Light
from scenes.errors import Location, SceneError

TECHNIQUES = ("area", "solid-angle", "projected-solid-angle", "environment", "environment-compensated")
# Axes from decimal text are orthonormal to some 1e-16; what is off by more was scaled or sheared.
ORTHONORMAL = 1e-9
L = TypeVar("L", bound=Light)


@runtime_checkable
class Arrival(Protocol):
    """A group of lights, each given by the light that arrives from its single direction."""

    def arrive(self, index: Index, ref_p: Floats) -> tuple[Floats, Floats, Floats]:
        """Direction (3, n) and distance (n,) of the light, and irradiance (3, n) or (3, 1) on a surface that
        faces it.

        Where there is no direction, or the light is infinite, the result is not finite; no warning is given.
        """
        ...


@dataclass(frozen=True, eq=False)
class DeltaSampling:
    """The single direction of a light, whatever u is; its density counts as 1 [pharr2023, sec. 12.2]."""

    light: Arrival

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """The direction of each light. A row is not valid where nothing arrives, at the light itself, and
        where numbers overflow.
        """
        wi, dist, irradiance = self.light.arrive(index, ref_p)
        return LightSample(wi, dist, -wi, irradiance, np.ones(dist.size), _arrives(wi, irradiance))

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """0: no other technique finds the direction."""
        return np.zeros(index.size)


@dataclass(frozen=True, eq=False)
class DeltaLights:
    """A group of such lights, in which every technique is `DeltaSampling`."""

    parts: Parts
    arrival: Arrival

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        return dict.fromkeys(TECHNIQUES, DeltaSampling(self.arrival))

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats:
        """E cos; 0 where samples would not be valid."""
        wi, _, irradiance = self.arrival.arrive(index, ref_p)
        with np.errstate(invalid="ignore", over="ignore"):
            return np.where(_arrives(wi, irradiance), np.maximum(dot(wi, ref_n), 0.0) * irradiance, 0.0)


def delta_kind(
    describes: type[L], arrival: Callable[[Sequence[L]], Arrival], examples: Callable[[], list[LightExample]]
) -> LightKind:
    """A kind of light of a single direction; `arrival` makes its group from descriptions."""

    def make(sources: Sequence[Source], index: Sequence[int]) -> DeltaLights:
        return DeltaLights(Parts.whole(index), arrival([s for s in sources if isinstance(s, describes)]))

    return LightKind(describes, make, "lights of one direction", TECHNIQUES, examples, delta=True)


def towards(position: Floats, ref_p: Floats) -> tuple[Floats, Floats]:
    """Unit vectors (3, n) and distances (n,) to positions (3, n) or (3, 1); NaN vectors at distance 0.

    Scaled by the largest component first: squares of distances beyond 1e154 or below 1e-154 would over- or
    underflow.
    """
    with np.errstate(all="ignore"):
        d = position - ref_p
        size = np.maximum(np.maximum(np.abs(d[0]), np.abs(d[1])), np.abs(d[2]))
        d = d / size
        length = np.sqrt(dot(d, d))
        return d / length, np.where(size > 0, size * length, 0.0)


def fall_off(intensity: Floats, dist: Floats) -> Floats:
    """I/d^2, (3, n); not finite where it overflows."""
    with np.errstate(all="ignore"):
        return intensity / dist / dist


def light_values(values: Floats, what: str, where: Location | None) -> Floats:
    """The three channels of a light; SceneError for values that are not finite or below 0."""
    if not (np.isfinite(values) & (values >= 0)).all():
        raise SceneError(
            f"{what} must be finite and not negative, not {', '.join(f'{v:.6g}' for v in values)}", where
        )
    return values


def finite_vector(vector: Floats, what: str, where: Location | None) -> Floats:
    """The vector; SceneError where a component is not finite."""
    if not np.isfinite(vector).all():
        raise SceneError(f"{what} must be finite, not {', '.join(f'{v:.6g}' for v in vector)}", where)
    return vector


def unit_vector(vector: Floats, what: str, where: Location | None) -> Floats:
    """The direction as a unit vector; SceneError for a vector of no direction."""
    _, length = towards(finite_vector(vector, what, where)[:, None], np.zeros((3, 1)))
    if not length[0] > 0:
        raise SceneError(f"{what} must not be zero", where)
    return towards(vector[:, None], np.zeros((3, 1)))[0][:, 0]


def light_axes(frame: Floats, what: str, where: Location | None) -> Floats:
    """Axes (3, 3) of a light's image; SceneError where they are not orthonormal."""
    if not np.abs(frame.T @ frame - np.eye(3)).max() < ORTHONORMAL:
        raise SceneError(f"{what} axes may be turned and mirrored, but not scaled or sheared", where)
    return frame


def _arrives(wi: Floats, irradiance: Floats) -> Mask:
    """(n,): whether light arrives: a direction, and a finite amount above 0."""
    r, g, b = irradiance
    # Adding might overflow what is finite.
    finite = np.isfinite(r) & np.isfinite(g) & np.isfinite(b) & np.isfinite(wi[0])
    return finite & ((r > 0) | (g > 0) | (b > 0))

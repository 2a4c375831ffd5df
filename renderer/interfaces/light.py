"""What a kind of light offers.

One object holds all lights of its kind, their parameters in arrays of length k.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats, dot, gather, normalize
from renderer.records import LightSample
from scenes.description.lights import Light
from scenes.description.shapes import Geometry, ShapeDescription
from scenes.registry import Registry

Index = NDArray[np.integer]
# What may be a light: a shape that emits, or a light that is no shape.
Source = ShapeDescription | Light
G = TypeVar("G", bound=Geometry)


@runtime_checkable
class DirectionSampler(Protocol):
    """A technique: directions from reference points to a light, with their density."""

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """A direction for each row. index: (n,) which light. ref_p, ref_n: (3, n). u: (2, n) in [0, 1)."""
        ...

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of the directions wi (3, n); 0 where the light is not hit or the technique
        never goes.
        """
        ...


@dataclass(frozen=True, eq=False)
class LightExample:
    """A light alone and points to see it from, for the contract tests. ref_p, ref_n: (3, n)."""

    name: str
    source: Source
    ref_p: Floats
    ref_n: Floats


def receivers(center: Floats, size: float) -> tuple[Floats, Floats]:
    """Points to see a light at `center` (3,) from: below, far, aside, grazing, near, the normal turned.

    Two (3, 6) arrays.
    """
    away = np.array(
        [[0, -2, 0], [30, -40, 10], [2, -1, 1], [3, -1e-2, 0.3], [0.1, -1e-2, 0.2], [0.3, -1.5, 0.1]]
    ).T
    n = np.array([[0, 1, 0], [0, 1, 0], [-1, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0.1, 0]], dtype=np.float64).T
    return center[:, None] + away * size, normalize(n)


@runtime_checkable
class LightKind(Protocol):
    """All lights of one kind.

    `delta`: light comes from one direction only at every point, and is never met by chance.
    """

    delta: ClassVar[bool]

    @property
    def source(self) -> NDArray[np.int64]:
        """(k,) which of the scene's sources each light is, or is part of."""
        ...

    @property
    def share(self) -> Floats:
        """(k,) the chance of each light among those of its source; they sum to 1 over a source."""
        ...

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """Sampling techniques by name; what is missing here is explained by `missing`."""
        ...

    @staticmethod
    def missing(technique: str) -> str | None:
        """Why this kind has no such technique, in a few words; None where it has."""
        ...

    @classmethod
    def accepts(cls, source: Source) -> bool:
        """Whether a light, or a shape that emits, is of this kind."""
        ...

    @classmethod
    def make(cls, sources: Sequence[Source], index: Sequence[int]) -> LightKind:
        """From the sources of this kind and their indices among the scene's; SceneError where one cannot
        be.
        """
        ...

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """Irradiance (3, n) in W/m^2 of surfaces at ref_p facing ref_n, nothing being in between; None
        without a closed form.
        """
        ...

    @classmethod
    def examples(cls) -> list[LightExample]:
        """Cases for the contract tests: near, far, grazing, crossing the horizon."""
        ...


def emits_as(source: Source, geometry: type | tuple[type, ...]) -> bool:
    """Whether a source is a shape of some geometry that emits."""
    return (
        isinstance(source, ShapeDescription)
        and source.emission is not None
        and isinstance(source.geometry, geometry)
    )


def geometries(sources: Sequence[Source], kind: type[G]) -> list[G]:
    """The geometries of those sources that are shapes of one kind of geometry."""
    shapes = [s.geometry for s in sources if isinstance(s, ShapeDescription)]
    return [g for g in shapes if isinstance(g, kind)]


def shares(source: NDArray[np.int64], weight: Floats) -> Floats:
    """(k,) each light's part of the weight of its source. source, weight: (k,)."""
    _, own = np.unique(source, return_inverse=True)
    return weight / np.bincount(own, weight)[own]


LIGHTS: Registry[type[LightKind]] = Registry("light", "renderer.lights")


@dataclass(frozen=True, eq=False)
class Emitters:
    """What every area light has: which source it is, its radiance, and on which sides it emits.

    source: (k,). radiance: (3, k). two_sided: (k,) bool.
    """

    source: NDArray[np.int64]
    radiance: Floats
    two_sided: NDArray[np.bool_]

    def emits(self, index: Index, cos_light: Floats) -> NDArray[np.bool_]:
        """(n,): whether a point whose outward direction makes cos_light (n,) with the emitting normal sends
        light there.
        """
        if not self.two_sided.any():
            return cos_light > 0
        return (cos_light > 0) | (self.two_sided.take(index) & (cos_light < 0))

    def repeat(self, each: Sequence[int]) -> Emitters:
        """Each emitter as many times as `each` says: the parts of one shape."""
        return Emitters(
            self.source.repeat(each, axis=0),
            self.radiance.repeat(each, axis=1),
            self.two_sided.repeat(each, axis=0),
        )

    @staticmethod
    def of(sources: Sequence[Source], index: Sequence[int]) -> Emitters:
        """The emitters of a sequence of emitting shapes."""
        shapes = [s for s in sources if isinstance(s, ShapeDescription)]
        emissions = [s.emission for s in shapes if s.emission is not None]
        return Emitters(
            np.array(index, dtype=np.int64),
            np.stack([e.radiance for e in emissions], axis=1).astype(np.float64),
            np.array([e.two_sided for e in emissions], dtype=np.bool_),
        )


@runtime_checkable
class Surface(Protocol):
    """What area sampling asks of a light: points on it, and where a ray meets it."""

    @property
    def emitters(self) -> Emitters:
        """What the lights send out."""
        ...

    @property
    def area(self) -> Floats:
        """(k,) areas."""
        ...

    def emits(self, index: Index, ref_p: Floats, cos_light: Floats) -> NDArray[np.bool_]:
        """(n,): whether a surface point sends light to ref_p, the rest of its own surface not being in the
        way.
        """
        ...

    def position(self, index: Index, u: Floats) -> tuple[Floats, Floats]:
        """Uniform points (3, n) on the surface and the emitting unit normals (3, n) or (3, 1) there."""
        ...

    def intersect(self, index: Index, origin: Floats, wi: Floats) -> tuple[Floats, Floats]:
        """Distance (n,) to the emitting side that a ray sees first (inf: none) and the cosine (n,) there."""
        ...


@dataclass(frozen=True, eq=False)
class AreaSampling:
    """Uniform over the light's surface: pdf = d^2 / (cos_light A) [pharr2023, sec. 6.1]; unbounded weights as
    d goes to 0.
    """

    surface: Surface

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """See `DirectionSampler`."""
        y, ny = self.surface.position(index, u)
        d = y - ref_p
        d2 = dot(d, d)
        # d = 0 (a point on the light itself) has no direction; the row is masked, its numbers never used.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            dist = np.sqrt(d2)
            wi = d / dist
            cos_light = -dot(wi, ny)
            pdf = d2 / (np.abs(cos_light) * gather(self.surface.area, index))
        valid = self.surface.emits(index, ref_p, cos_light) & (pdf > 0) & (pdf < np.inf)
        return LightSample(wi, dist, ny, gather(self.surface.emitters.radiance, index), pdf, valid)

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """See `DirectionSampler`."""
        dist, cos_light = self.surface.intersect(index, ref_p, wi)
        hit = dist < np.inf
        denominator = np.where(hit, np.abs(cos_light) * gather(self.surface.area, index), 1.0)
        return np.where(hit, np.where(hit, dist, 0.0) ** 2 / denominator, 0.0)

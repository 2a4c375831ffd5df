"""The protocol of lights: groups of one kind, whose parameters are arrays, and the registry of kinds.

A new kind of light is one module in `renderer.lights`: a group of such lights, and its `LightKind`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from renderer.math.vectors import Floats
from renderer.records import LightSample
from scenes.description.lights import Light
from scenes.description.shapes import ShapeDescription
from scenes.registry import Registry

Index = NDArray[np.integer]
# A shape that emits, or a light that is no shape.
Source = ShapeDescription | Light


@runtime_checkable
class DirectionSampler(Protocol):
    """A sampling technique: directions from reference points to a light, and their density."""

    def sample_direction(self, index: Index, ref_p: Floats, ref_n: Floats, u: Floats) -> LightSample:
        """One direction a row. index: (n,) the light. ref_p, ref_n: (3, n). u: (2, n) in [0, 1)."""
        ...

    def pdf_direction(self, index: Index, ref_p: Floats, ref_n: Floats, wi: Floats) -> Floats:
        """Density (n,) in 1/sr of directions wi (3, n); 0 where they miss the light or the technique never
        goes.
        """
        ...


@dataclass(frozen=True, eq=False)
class LightExample:
    """One light and reference points for the contract tests. ref_p, ref_n: (3, n)."""

    name: str
    source: Source
    ref_p: Floats
    ref_n: Floats


@dataclass(frozen=True, eq=False)
class Parts:
    """The division of a scene's sources into the k lights of a group.

    source: (k,) the source that each light belongs to. share: (k,) the probability of a light among those of
    its source.
    """

    source: NDArray[np.int64]
    share: Floats

    @staticmethod
    def whole(index: Sequence[int]) -> Parts:
        """One light for each source."""
        return Parts(np.array(index, dtype=np.int64), np.ones(len(index)))

    @staticmethod
    def by_area(index: Sequence[int], each: Sequence[int], area: Floats) -> Parts:
        """`each` lights for each source, chosen in proportion to their areas (k,)."""
        source = np.array(index, dtype=np.int64).repeat(each)
        _, own = np.unique(source, return_inverse=True)
        return Parts(source, area / np.bincount(own, area)[own])


@runtime_checkable
class LightGroup(Protocol):
    """All lights of one kind in a scene, k of them."""

    @property
    def parts(self) -> Parts:
        """The sources of the lights, and the share of each light in its source."""
        ...

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """Sampling techniques by name."""
        ...

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """Unoccluded irradiance (3, n) in W/m^2 at ref_p facing ref_n; None without a closed form."""
        ...


@runtime_checkable
class Surroundings(LightGroup, Protocol):
    """A group of lights that surround the scene: rays meet them where they leave it."""

    @property
    def flux(self) -> Floats:
        """(k,): radiance times solid angle of each light, by which one of several is chosen."""
        ...

    def radiance_along(self, index: Index, ref_p: Floats, wi: Floats) -> Floats:
        """Radiance (3, n) along unit directions wi (3, n) from ref_p (3, n) or (3, 1). index: (n,) the light
        of the group.
        """
        ...


@dataclass(frozen=True, eq=False)
class LightKind:
    """One kind of light.

    describes: the class of the light, or of the geometry that emits. plural: the kind's name in messages.
    make: the group of some sources and their numbers in the scene; it raises SceneError for a light that it
    cannot render. techniques: names of the sampling techniques. absent: reasons for techniques that it lacks.
    examples: cases for the contract tests: near, far, grazing and crossing the horizon. delta: whether the
    light arrives from a single direction at every point, so that no ray meets it. closed_form: whether there
    is a formula of irradiance.
    """

    describes: type
    make: Callable[[Sequence[Source], Sequence[int]], LightGroup]
    plural: str
    techniques: tuple[str, ...]
    examples: Callable[[], list[LightExample]]
    absent: Mapping[str, str] = field(default_factory=dict[str, str])
    delta: bool = False
    closed_form: bool = True

    def accepts(self, source: Source) -> bool:
        """Whether a light, or a shape that emits, is of this kind."""
        if isinstance(source, ShapeDescription):
            return source.emission is not None and isinstance(source.geometry, self.describes)
        return isinstance(source, self.describes)

    def missing(self, technique: str) -> str | None:
        """The reason why the kind lacks a technique, in a few words; None where it has it."""
        if technique in self.techniques:
            return None
        return self.absent.get(technique, f"{self.plural} have no {technique} sampling")


LIGHTS: Registry[LightKind] = Registry("light", "renderer.lights")

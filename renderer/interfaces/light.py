"""The protocol of lights: groups of one kind, whose parameters are arrays, and the registry of kinds.

Adding a kind of light is one module in `renderer.lights`: a group of such lights, and its `LightKind`.
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


@dataclass(frozen=True, eq=False)
class Parts:
    """The scene's sources that k lights are, or are part of.

    source: (k,) index of the source. share: (k,) probability of each light among those of its source.
    """

    source: NDArray[np.int64]
    share: Floats

    @staticmethod
    def whole(index: Sequence[int]) -> Parts:
        """Every source is one light."""
        return Parts(np.array(index, dtype=np.int64), np.ones(len(index)))

    @staticmethod
    def by_area(index: Sequence[int], each: Sequence[int], area: Floats) -> Parts:
        """Each source is as many lights as `each` says, chosen in proportion to their areas (k,)."""
        source = np.array(index, dtype=np.int64).repeat(each)
        _, own = np.unique(source, return_inverse=True)
        return Parts(source, area / np.bincount(own, area)[own])


@runtime_checkable
class LightGroup(Protocol):
    """All lights of one kind in a scene, k of them."""

    @property
    def parts(self) -> Parts:
        """The sources that the lights belong to."""
        ...

    @property
    def techniques(self) -> Mapping[str, DirectionSampler]:
        """Sampling techniques by name."""
        ...

    def irradiance(self, index: Index, ref_p: Floats, ref_n: Floats) -> Floats | None:
        """Unoccluded irradiance (3, n) in W/m^2 of surfaces at ref_p facing ref_n; None without a formula."""
        ...


@runtime_checkable
class Surroundings(LightGroup, Protocol):
    """A group of lights that rays meet where they leave the scene."""

    @property
    def flux(self) -> Floats:
        """(k,): radiance times solid angle of each, by which one is chosen where they are several."""
        ...

    def radiance_along(self, index: Index, ref_p: Floats, wi: Floats) -> Floats:
        """Radiance (3, n) that rays from ref_p (3, n) or (3, 1) along wi (3, n), unit, see.

        index: (n,) which light of the group.
        """
        ...


@dataclass(frozen=True, eq=False)
class LightKind:
    """One kind of light.

    describes: the class of the light, or of the geometry that emits. plural: the kind's name in messages.
    make: a group from the sources of this kind and their indices among the scene's; it raises SceneError for
    lights that cannot be. techniques: names of the sampling techniques. absent: why it lacks others.
    examples: cases for the contract tests, near, far, grazing and crossing the horizon. delta: whether the
    light comes from a single direction at every point, so that no ray ever meets it. closed_form: whether
    shapes of this kind have a formula of irradiance.
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
        """Why the kind lacks a technique, in a few words; None where it has it."""
        if technique in self.techniques:
            return None
        return self.absent.get(technique, f"{self.plural} have no {technique} sampling")


LIGHTS: Registry[LightKind] = Registry("light", "renderer.lights")

"""Materials as data: how surfaces scatter light."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from scenes.description.normal_perturbation import NormalPerturbation
from scenes.description.textures import ColorMap, Texture, map_colors, mean, needs_uv

Array = NDArray[np.float64]
SMOOTHEST = 1e-3  # where no alpha reaches this, pbrt-v4 takes a surface for a mirror


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambertian reflection from both sides, as pbrt's. reflectance: (3,) float64 in [0, 1], or a texture of
    such.
    """

    reflectance: Texture

    @property
    def needs_uv(self) -> bool:
        """Whether the material depends on texture coordinates."""
        return needs_uv(self.reflectance)

    @property
    def mean_alpha(self) -> None:
        """None: a diffuse surface has no microfacets."""

    @property
    def normal_reflectance(self) -> Array:
        """(3,) the mean reflectance at normal incidence, for programs that draw one colour."""
        return mean(self.reflectance)

    def map_colors(self, change: ColorMap) -> Diffuse:
        return Diffuse(map_colors(self.reflectance, change))

    def beneath(self, eta: float) -> Diffuse:
        return self


@dataclass(frozen=True, eq=False)
class Roughness:
    """A roughness that varies over a surface.

    u: a texture of numbers, along dp/du. v: the texture across it, None if it is u too. remap: whether alpha
    is the square root of the roughness, as by pbrt's default.
    """

    u: Texture
    v: Texture | None
    remap: bool

    def alpha(self, found: Array) -> Array:
        """The alphas of roughness values, at least SMOOTHEST, so that no point becomes a mirror."""
        found = np.maximum(found, 0.0)
        return np.maximum(np.sqrt(found) if self.remap else found, SMOOTHEST)

    def mean_alphas(self) -> tuple[float, float | None]:
        """The alphas along dp/du and across, by the textures' means."""
        u, v = (None if one is None else float(self.alpha(mean(one))[0]) for one in (self.u, self.v))
        assert u is not None
        return u, v


class Microfacets:
    """GGX (Trowbridge-Reitz) microfacets, given by alpha rather than roughness; alpha 0 is smooth.

    alpha: along dp/du, at least 1e-4. alpha_v: across it, None if equal. varying: textures that replace both,
    which are then means; None without textures.
    """

    alpha: float
    alpha_v: float | None
    varying: Roughness | None

    @property
    def needs_uv(self) -> bool:
        """Whether the material depends on texture coordinates."""
        varying = self.varying
        textured = varying is not None and needs_uv(*(v for v in (varying.u, varying.v) if v is not None))
        return textured or self.alpha_v is not None

    @property
    def mean_alpha(self) -> float:
        """The alpha of isotropic microfacets with the same density of normals along the surface's normal."""
        return self.alpha if self.alpha_v is None else float(np.sqrt(self.alpha * self.alpha_v))


@dataclass(frozen=True, eq=False)
class Conductor(Microfacets):
    """A metal of both sides: microfacets with the Fresnel reflectance of eta + i k, or a mirror if smooth.
    eta, k: (3,) float64 for red, green and blue.
    """

    eta: Array
    k: Array
    alpha: float
    alpha_v: float | None = None
    varying: Roughness | None = None

    @property
    def normal_reflectance(self) -> Array:
        below, above = (self.eta - 1) ** 2 + self.k**2, (self.eta + 1) ** 2 + self.k**2
        return below / above

    def map_colors(self, change: ColorMap) -> Conductor:
        return replace(self, eta=change(self.eta), k=change(self.k))

    def beneath(self, eta: float) -> Conductor:
        """The same metal under a medium of index `eta` in place of air."""
        return replace(self, eta=self.eta / eta, k=self.k / eta)


@dataclass(frozen=True, eq=False)
class Dielectric(Microfacets):
    """A boundary of glass or the like. eta: the index inside over the index outside, where the normal points.
    thin: whether it is a smooth pane with two sides, which bends no ray.
    """

    eta: float
    alpha: float
    thin: bool = False
    alpha_v: float | None = None
    varying: Roughness | None = None

    @property
    def normal_reflectance(self) -> Array:
        """The reflectance of the boundary alone, without what shows through it."""
        return np.full(3, ((self.eta - 1) / (self.eta + 1)) ** 2)

    def map_colors(self, change: ColorMap) -> Dielectric:
        return self


class Composite(ABC):
    """A material made of other materials."""

    @property
    @abstractmethod
    def parts(self) -> tuple[Material, Material]:
        """The materials that it is made of."""

    @property
    def needs_uv(self) -> bool:
        """Whether the material depends on texture coordinates."""
        return any(part.needs_uv for part in self.parts)


@dataclass(frozen=True, eq=False)
class Coated(Composite):
    """A surface under a layer of varnish, two-sided: pbrt's `coateddiffuse` and `coatedconductor`.

    coat: the boundary to the air. base: the surface underneath, as it would be in air. thickness: of the
    layer, in mean free paths of its medium. albedo: (3,) float64 in [0, 1], of the medium, which scatters by
    Henyey and Greenstein's phase function of asymmetry g. These three may be textures. max_depth: the most
    events of a walk between the boundaries. samples: the number of walks for one value of the BSDF.
    """

    coat: Dielectric
    base: Diffuse | Conductor
    thickness: float | Texture = 0.01
    albedo: Texture = field(default_factory=lambda: np.zeros(3))
    g: float | Texture = 0.0
    max_depth: int = 10
    samples: int = 1

    @property
    def parts(self) -> tuple[Material, Material]:
        return self.coat, self.base

    @property
    def has_textured_layer(self) -> bool:
        """Whether thickness, albedo or g is a texture."""
        return not isinstance(self.albedo, np.ndarray) or not all(
            isinstance(one, float | int) for one in (self.thickness, self.g)
        )

    @property
    def needs_uv(self) -> bool:
        layer = (one for one in (self.thickness, self.albedo, self.g) if not isinstance(one, float | int))
        return needs_uv(*layer) or super().needs_uv

    @property
    def mean_alpha(self) -> float | None:
        """The alpha of the base, whose colour programs draw."""
        return self.base.mean_alpha

    @property
    def normal_reflectance(self) -> Array:
        """The reflectance of the base alone."""
        return self.base.normal_reflectance

    def map_colors(self, change: ColorMap) -> Coated:
        return replace(self, base=self.base.map_colors(change), albedo=map_colors(self.albedo, change))


@dataclass(frozen=True, eq=False)
class DiffuseTransmission:
    """A thin sheet that scatters light to both of its sides by Lambert's law, as pbrt's.

    reflectance, transmittance: (3,) float64 each, or textures of such. Both are multiplied by `scale`, then
    clamped to [0, 1].
    """

    reflectance: Texture
    transmittance: Texture
    scale: float = 1.0

    @property
    def needs_uv(self) -> bool:
        return needs_uv(self.reflectance, self.transmittance)

    @property
    def mean_alpha(self) -> None:
        """None: a diffuse sheet has no microfacets."""

    @property
    def normal_reflectance(self) -> Array:
        return np.clip(self.scale * mean(self.reflectance), 0.0, 1.0)

    def map_colors(self, change: ColorMap) -> DiffuseTransmission:
        reflectance, transmittance = (
            map_colors(one, change) for one in (self.reflectance, self.transmittance)
        )
        return replace(self, reflectance=reflectance, transmittance=transmittance)


@dataclass(frozen=True, eq=False)
class MixedMaterial(Composite):
    """One of two materials at each point, by chance, as pbrt's `mix`.

    amount: the probability of the second, equal in all three components; 0 below 0, and 1 above 1.
    perturbations: the maps that turn the shading normals of points of the first, and of the second.
    """

    first: Material
    second: Material
    amount: Texture
    perturbations: tuple[NormalPerturbation | None, NormalPerturbation | None] = (None, None)

    @property
    def parts(self) -> tuple[Material, Material]:
        return self.first, self.second

    @property
    def needs_uv(self) -> bool:
        return needs_uv(self.amount) or self.perturbs_normals or super().needs_uv

    @property
    def perturbs_normals(self) -> bool:
        """Whether a part of the mix, or of a mix within it, turns shading normals."""
        return any(one is not None for one in self.perturbations) or any(
            isinstance(part, MixedMaterial) and part.perturbs_normals for part in self.parts
        )

    def without_perturbations(self) -> MixedMaterial:
        """The mix with all shading normals left as they are."""
        first, second = (
            part.without_perturbations() if isinstance(part, MixedMaterial) else part for part in self.parts
        )
        return replace(self, first=first, second=second, perturbations=(None, None))

    @property
    def _share(self) -> float:
        return float(np.clip(mean(self.amount)[0], 0.0, 1.0))

    @property
    def mean_alpha(self) -> float | None:
        """The alpha of the likelier material."""
        return self.parts[int(self._share > 0.5)].mean_alpha

    @property
    def normal_reflectance(self) -> Array:
        first, second = (part.normal_reflectance for part in self.parts)
        return (1 - self._share) * first + self._share * second

    def map_colors(self, change: ColorMap) -> MixedMaterial:
        """The mix with `change` applied to the colours of its materials; the amount is no colour."""
        return replace(self, first=self.first.map_colors(change), second=self.second.map_colors(change))


Material = Diffuse | Conductor | Dielectric | Coated | DiffuseTransmission | MixedMaterial


def is_oriented(material: Material) -> bool:
    """Whether a material depends on the direction of dp/du: it has anisotropic microfacets, or parts that
    have.
    """
    if isinstance(material, Composite):
        return any(is_oriented(part) for part in material.parts)
    return isinstance(material, Microfacets) and material.alpha_v is not None

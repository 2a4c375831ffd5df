"""Materials of glTF: metallic-roughness as pbrt's conductors and coated diffuse surfaces."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.convert.document import Losses
from pipeline.convert.gltf.file import GltfFile, Object
from scenes.arrays import Array
from scenes.color import conductor_of_reflectance
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse, Material
from scenes.description.shapes import Emission
from scenes.description.textures import ImageTexture, Texture, UVMapping, mean
from scenes.images.exr import read_texture

CLAMP, MIRRORED, NEAREST = 33071, 33648, 9728
IMAGES = {"image/png": ".png", "image/jpeg": ".jpg"}


@dataclass(frozen=True, eq=False)
class Surface:
    """A converted material. coordinates: the number of the set of texture coordinates that it uses."""

    material: Material
    emission: Emission | None
    coordinates: int = 0


@dataclass(eq=False)
class Surfaces:
    """Converts materials, each once."""

    file: GltfFile
    losses: Losses
    _known: dict[int, Surface] = field(default_factory=dict[int, Surface])
    _images: dict[int, Array] = field(default_factory=dict[int, Array])

    def surface(self, index: Any, where: str) -> Surface:
        """The material of this index in the file."""
        found = self.file.one("materials", index, where)
        if index not in self._known:
            self._known[index] = self._convert(found, f"materials[{index}]")
        return self._known[index]

    def _convert(self, given: Object, where: str) -> Surface:
        rough: Object = given.get("pbrMetallicRoughness", {})
        more: Object = given.get("extensions", {})
        for name in ("normalTexture", "occlusionTexture"):
            if name in given:
                self._lost(f"the {name} of a material is left out", where)
        if "metallicRoughnessTexture" in rough:
            self._lost("the metallicRoughnessTexture is left out, its factors stay", where)
        if given.get("alphaMode", "OPAQUE") != "OPAQUE":
            self._lost("transparency by alpha is left out", where)
        for name in sorted(set(more) - EXTENSIONS):
            self._lost(f"extension {name} is left out", where)
        color, coordinates = self._color(rough, where)
        return Surface(
            self._material(rough, more, color, where), self._emission(given, more, where), coordinates
        )

    def _material(self, rough: Object, more: Object, color: Texture, where: str) -> Material:
        metallic = self.file.number(rough, "metallicFactor", 1.0, where)
        alpha = self.file.number(rough, "roughnessFactor", 1.0, where) ** 2
        ior = self.file.number(more.get("KHR_materials_ior", {}), "ior", 1.5, where)
        passing = self.file.number(
            more.get("KHR_materials_transmission", {}), "transmissionFactor", 0.0, where
        )
        shine = self.file.number(more.get("KHR_materials_specular", {}), "specularFactor", 1.0, where)
        for value in (metallic, passing, shine):
            if 0 < value < 1:
                self._lost("a material between two kinds is the nearer one", where)
        if metallic > 0.5:
            if not isinstance(color, np.ndarray):
                self._lost("the texture of a metal is its mean", where)
            return Conductor(*conductor_of_reflectance(mean(color)), alpha)
        if passing > 0.5:
            self._lost("the colour of glass is left out", where)
            thin = "KHR_materials_volume" not in more
            return Dielectric(ior, 0.0 if thin else alpha, thin)
        if shine <= 0.5 or ior <= 1:
            return Diffuse(color)
        self._lost("glTF's dielectrics are pbrt's coateddiffuse, another model", where)
        return Coated(Dielectric(ior, alpha), Diffuse(color))

    def _emission(self, given: Object, more: Object, where: str) -> Emission | None:
        """The emission of a material, with W/(m^2 sr) for glTF's nits: one factor for all lights."""
        factor = self.file.numbers(given, "emissiveFactor", [0.0, 0.0, 0.0], where)
        strength = more.get("KHR_materials_emissive_strength", {})
        radiance = factor * self.file.number(strength, "emissiveStrength", 1.0, where)
        if (radiance < 0).any():
            raise self.file.fail(where, "emissiveFactor must not be negative")
        if "emissiveTexture" in given and radiance.any():
            self._lost("a texture of emission is its mean", where)
            radiance = radiance * mean(self.texture(given["emissiveTexture"], where)[0])
        return Emission(radiance, bool(given.get("doubleSided", False))) if radiance.any() else None

    def _color(self, rough: Object, where: str) -> tuple[Texture, int]:
        factor = self.file.numbers(rough, "baseColorFactor", [1.0, 1.0, 1.0, 1.0], where)[:3]
        if (factor < 0).any() or (factor > 1).any():
            raise self.file.fail(where, "baseColorFactor must lie in [0, 1]")
        if "baseColorTexture" not in rough:
            return factor, 0
        texture, coordinates = self.texture(rough["baseColorTexture"], where)
        if isinstance(texture, ImageTexture):
            same = bool((factor == 1).all())
            return (texture if same else replace(texture, image=texture.image * factor)), coordinates
        return mean(texture) * factor, coordinates

    def texture(self, info: Object, where: str) -> tuple[Texture, int]:
        """A texture, and the number of its set of texture coordinates. glTF's images begin at v = 0."""
        found = self.file.one("textures", info.get("index"), where)
        sampler = self.file.one("samplers", found["sampler"], where) if "sampler" in found else {}
        moved: Object = info.get("extensions", {}).get("KHR_texture_transform", {})
        image = self._image(found.get("source"), where)
        coordinates = moved.get("texCoord", info.get("texCoord", 0))
        if moved.get("rotation", 0):
            self._lost("a texture that is turned is its mean", where)
            return image.mean(axis=(0, 1)), coordinates
        scale = self.file.numbers(moved, "scale", [1.0, 1.0], where)
        offset = self.file.numbers(moved, "offset", [0.0, 0.0], where)
        if MIRRORED in (sampler.get("wrapS"), sampler.get("wrapT")):
            self._lost("a mirrored texture is repeated instead", where)
        wrap = "clamp" if sampler.get("wrapS") == sampler.get("wrapT") == CLAMP else "repeat"
        kind = "point" if sampler.get("magFilter") == NEAREST else "bilinear"
        mapping = UVMapping(float(scale[0]), -float(scale[1]), float(offset[0]), 1.0 - float(offset[1]))
        return ImageTexture(image, mapping, wrap, kind), coordinates

    def _image(self, index: Any, where: str) -> Array:
        """The image of this index, (h, w, 3), linear."""
        found = self.file.one("images", index, where)
        if index not in self._images:
            if "uri" in found and not str(found["uri"]).startswith("data:"):
                image = read_texture(self.file.find(found["uri"], f"images[{index}]"))
            else:
                image = self._embedded(found, f"images[{index}]")
            self._images[index] = np.clip(image, 0.0, 1.0)
        return self._images[index]

    def _embedded(self, found: Object, where: str) -> Array:
        if "uri" in found:
            kind, data = str(found["uri"])[5:].split(";")[0], self.file.resource(found["uri"], where)
        else:
            kind, data = found.get("mimeType", ""), bytes(self.file.view(found.get("bufferView"), where)[0])
        if kind not in IMAGES:
            raise self.file.fail(where, f"an image of type {kind!r}; there are: {', '.join(IMAGES)}")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{where}{IMAGES[kind]}"
            path.write_bytes(data)
            return read_texture(path)

    def _lost(self, what: str, where: str) -> None:
        self.losses.add(what, f"{self.file.path.name}: {where}")


EXTENSIONS = {
    "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_specular", "KHR_materials_volume",
    "KHR_materials_emissive_strength",
}  # fmt: skip

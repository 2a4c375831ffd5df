"""The meaning of each directive with a parameter list, and which kind of defaults `Attribute` holds for
it.
"""

from __future__ import annotations

from scenes.pbrt.directives.camera import camera, film, pixel_filter
from scenes.pbrt.directives.integrator import accelerator, integrator, sampler
from scenes.pbrt.directives.lights import area_light, light_source
from scenes.pbrt.directives.materials import make_named_material, material
from scenes.pbrt.directives.media import named_medium
from scenes.pbrt.directives.shapes import shape
from scenes.pbrt.state import Handler

ATTRIBUTE_TARGETS = ("shape", "light", "material", "medium", "texture")


OPTIONS: dict[str, Handler] = {
    "Camera": camera,
    "Film": film,
    "PixelFilter": pixel_filter,
    "Sampler": sampler,
    "Integrator": integrator,
    "Accelerator": accelerator,
}
# Each with the target of the `Attribute`s that hold for it.
WORLD: dict[str, tuple[Handler, str]] = {
    "Material": (material, "material"),
    "MakeNamedMaterial": (make_named_material, "material"),
    "AreaLightSource": (area_light, "light"),
    "LightSource": (light_source, "light"),
    "Shape": (shape, "shape"),
}
# Allowed on both sides of WorldBegin: a camera may stand in a medium.
ANYWHERE: dict[str, tuple[Handler, str]] = {"MakeNamedMedium": (named_medium, "medium")}

"""Reference images in closed form: exact radiance, integrated over each pixel with an error bound.

No sampling and no ray tracing: the light's outline and the receivers' edges are cut exactly on the film, and
adaptive quadrature integrates the smooth rest. The scene must have one light over coplanar receivers
(closed_form/scene.py), or distant lights and a sky of one radiance over such (closed_form/uniform.py). The
image is right even where every sampling reference fails, such as for a light that touches the floor.

`variance` of the image is the square of the error bound, `batches` and `spp` are 0: nothing was sampled, and
a test against this reference has the noise of the other side only. The error is almost always far below its
bound.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.references.closed_form.film import film_plane
from pipeline.references.closed_form.image import closed_form_image, radiance_at, to_reference
from pipeline.references.closed_form.scene import ClosedFormScene, analyse
from pipeline.references.closed_form.uniform import (
    UniformScene,
    is_uniform,
    open_scene,
    uniform_image,
    uniform_scene,
)
from pipeline.references.protocol import (
    BACKENDS,
    Continuation,
    Progress,
    Quantity,
    ReferenceImage,
    ReferenceRequest,
    require,
)
from pipeline.store.keys import imported_code
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError

Array = NDArray[np.float64]

TOLERANCE = 1e-8  # error bound wanted for a pixel, relative to its value or to a hundredth of the mean
"""One gray level of 8 bits is 4e-3: this is far below what any sampled image resolves."""


class ClosedFormBackend:
    """One light, nothing in between: the image by formula and quadrature."""

    name = "closed-form"

    def version(self) -> str:
        return imported_code(Path(__file__))

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        try:
            _parts(scene, quantity)
            film_plane(scene.camera, scene.film)
        except SceneError as error:
            return str(error)
        return None

    def render(
        self,
        scene: SceneDescription,
        request: ReferenceRequest,
        progress: Progress | None = None,
        continuation: Continuation | None = None,
    ) -> ReferenceImage:
        require(self, scene, request.quantity)
        start = time.perf_counter()
        parts, film = _parts(scene, request.quantity), film_plane(scene.camera, scene.film)
        if isinstance(parts, UniformScene):
            image = uniform_image(parts, film)
        else:
            image = closed_form_image(parts, film, TOLERANCE)
        if progress:
            progress(1.0)
        provenance = {"backend": self.name, "version": self.version(), "tolerance": f"{TOLERANCE:g}"}
        return to_reference(image, scene.film, provenance, start)


def _parts(scene: SceneDescription, quantity: Quantity) -> ClosedFormScene | UniformScene:
    """The parts of the image; SceneError where there is no closed form."""
    if quantity == "ambient-occlusion":
        return open_scene(scene)
    return uniform_scene(scene) if is_uniform(scene) else analyse(scene)


def radiance_at_centers(scene: SceneDescription) -> Array:
    """Exact radiance (h, w, 3) through the pixels' centres; SceneError for a scene without closed form."""
    film = film_plane(scene.camera, scene.film)
    return radiance_at(analyse(scene), film, film.centers()).reshape(scene.film.height, scene.film.width, 3)


BACKENDS.add("closed-form", ClosedFormBackend())

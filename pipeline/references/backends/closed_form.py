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

from pathlib import Path

from pipeline.references.closed_form.film import film_plane
from pipeline.references.closed_form.image import PixelImage, closed_form_image, render_reference
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
)
from pipeline.store.keys import imported_code
from scenes.description.scene import SceneDescription
from scenes.errors import SceneError

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
        def draw() -> PixelImage:
            parts, film = _parts(scene, request.quantity), film_plane(scene.camera, scene.film)
            if isinstance(parts, UniformScene):
                return uniform_image(parts, film)
            return closed_form_image(parts, film, TOLERANCE)

        return render_reference(self, scene, request, progress, TOLERANCE, draw)


def _parts(scene: SceneDescription, quantity: Quantity) -> ClosedFormScene | UniformScene:
    """The parts of a scene with a closed form; SceneError with the reason if it has none."""
    if quantity == "ambient-occlusion":
        return open_scene(scene)
    return uniform_scene(scene) if is_uniform(scene) else analyse(scene)


BACKENDS.add("closed-form", ClosedFormBackend())

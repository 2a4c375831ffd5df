"""The closed form of a straight edge's penumbra (closed_form/edge_scene.py, closed_form/edge_image.py).

`variance` of the image is the square of the error bound, `batches` and `spp` are 0: nothing was sampled.
"""

from __future__ import annotations

from pathlib import Path

from pipeline.references.closed_form.edge_image import TOLERANCE, edge_image
from pipeline.references.closed_form.edge_scene import analyse_edge
from pipeline.references.closed_form.film import film_plane
from pipeline.references.closed_form.image import PixelImage, render_reference
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


class EdgeBackend:
    """A straight edge before a flat light: the penumbra by formula and quadrature."""

    name = "closed-form-edge"

    def version(self) -> str:
        return imported_code(Path(__file__))

    def refuses(self, scene: SceneDescription, quantity: Quantity = "radiance") -> str | None:
        if quantity != "radiance":
            return f"there is no closed form of {quantity} here"
        try:
            analyse_edge(scene)
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
            return edge_image(analyse_edge(scene), film_plane(scene.camera, scene.film))

        return render_reference(self, scene, request, progress, TOLERANCE, draw)


BACKENDS.add("closed-form-edge", EdgeBackend())

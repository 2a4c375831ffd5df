"""The renderer: direct lighting in NumPy by every textbook estimator, as far as a scene calls for it."""

from renderer.build import RenderScene, build
from renderer.fingerprint import fingerprint, image_fingerprint
from renderer.render import RenderResult, render

__all__ = ["RenderResult", "RenderScene", "build", "fingerprint", "image_fingerprint", "render"]

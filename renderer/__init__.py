"""The renderer: direct lighting in NumPy, every textbook estimator, nothing that the scene does not call
for.
"""

from renderer.build import RenderScene, build
from renderer.fingerprint import fingerprint, image_fingerprint
from renderer.render import RenderResult, render

__all__ = ["RenderResult", "RenderScene", "build", "fingerprint", "image_fingerprint", "render"]

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportPrivateUsage=false, reportMissingImports=false
"""The worker that rasterises tasks with pyrender: `python -m pipeline.baseline.worker FOLDER`.

The only import of pyrender and PyOpenGL, in a process of its own: an environment variable tells PyOpenGL at
its import which library to load, and an OpenGL context belongs to a thread. FOLDER holds tasks.pickle and
gets one file for each task.

pyrender hands the scene to OpenGL and draws it. Three of its parts are replaced, since they would falsify the
measurement: its shader (by shaders/mesh.frag), its framebuffer of 8 bits and four samples a pixel (by 32-bit
floats, one sample in the middle of each pixel), and its limit of 4 lights of a kind.
"""

from __future__ import annotations

import pickle
import sys
import time
import types
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.baseline.task import Array, SizelessLight, Surface, Task

TASKS = "tasks.pickle"
NEAREST = 1e-5  # of the farthest depth: what is nearer is cut off
MARGIN = 0.5  # the near plane of the image, of the least depth that was seen with the plane at NEAREST
# The far plane, in depths of the farthest corner: in the buffer that corner is at least 5e-6 below 1, which
# is the background.
FARTHEST = 2.0
REPEATS = 5  # timed draws, of which the median tells the time
SHADERS = Path(__file__).parent / "shaders"


def result_file(folder: Path, number: int) -> Path:
    """The file of the result of task `number`."""
    return folder / f"{number}.npz"


def main(folder: Path) -> None:
    """Draw the tasks in `folder`, one after the other."""
    tasks: tuple[Task, ...] = pickle.loads((folder / TASKS).read_bytes())
    for number, task in enumerate(tasks):
        canvas = _Canvas(task)
        np.savez(result_file(folder, number), allow_pickle=False, **_draw(task, canvas))
        canvas.offscreen.delete()


def _draw(task: Task, canvas: _Canvas) -> dict[str, Any]:
    """Draw once to find the near plane, once to warm up, and then REPEATS times against the clock."""
    _, first = canvas.draw(NEAREST)
    seen = first[np.isfinite(first)]
    near = max(NEAREST, MARGIN * float(seen.min())) if seen.size else NEAREST
    canvas.draw(near)
    laps: list[tuple[float, float]] = []
    image, depth = task.background, first
    for _ in range(REPEATS):
        start, cpu = time.perf_counter(), time.process_time()
        image, depth = canvas.draw(near)
        laps.append((time.perf_counter() - start, time.process_time() - cpu))
    seconds, cpu = np.median(laps, axis=0)
    image = np.where(np.isfinite(depth)[..., None], image, task.background)
    times = {"seconds": seconds, "cpu": cpu}
    return {"image": image, "depth": depth, "near": near, "far": FARTHEST, "device": canvas.device, **times}


class _Canvas:
    """A task's scene as pyrender's, its context and its framebuffer."""

    def __init__(self, task: Task) -> None:
        # pyrender's window comes with its package, and wants X11 and a screen's OpenGL, which nothing here
        # opens.
        sys.modules["pyrender.viewer"] = _no_viewer()
        import pyrender
        import pyrender.renderer
        from OpenGL import GL
        from pyrender.shader_program import ShaderProgramCache

        self.gl, self.size = GL, (task.width, task.height)
        pyrender.renderer.MAX_N_LIGHTS = max(4, len(task.lights))
        self.offscreen = pyrender.OffscreenRenderer(task.width, task.height)  # keeps the context alive
        self.renderer: Any = self.offscreen._renderer
        self.renderer._program_cache = ShaderProgramCache(str(SHADERS))
        self.renderer._main_fb, self.renderer._main_fb_ms = self._framebuffer(), self._framebuffer()
        self.renderer._main_fb_dims = self.size
        self.flags = pyrender.RenderFlags.OFFSCREEN
        left, top, dx, dy = task.film
        # In pixels from the top left: the focal lengths, and where the camera looks.
        self.camera = pyrender.IntrinsicsCamera(1 / dx, 1 / dy, -left / dx, top / dy, zfar=FARTHEST)
        self.scene = _scene(pyrender, task, self.camera)
        self.device = str(GL.glGetString(GL.GL_RENDERER), "utf-8")  # pyright: ignore[reportArgumentType]

    def _framebuffer(self) -> int:
        """A framebuffer of 32-bit floats, colour and depth, one sample a pixel."""
        gl = self.gl
        made = gl.glGenFramebuffers(1)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, made)
        for form, attachment in (
            (gl.GL_RGBA32F, gl.GL_COLOR_ATTACHMENT0),
            (gl.GL_DEPTH_COMPONENT32F, gl.GL_DEPTH_ATTACHMENT),
        ):
            buffer = gl.glGenRenderbuffers(1)
            gl.glBindRenderbuffer(gl.GL_RENDERBUFFER, buffer)
            gl.glRenderbufferStorage(gl.GL_RENDERBUFFER, form, *self.size)
            gl.glFramebufferRenderbuffer(gl.GL_FRAMEBUFFER, attachment, gl.GL_RENDERBUFFER, buffer)
        if gl.glCheckFramebufferStatus(gl.GL_FRAMEBUFFER) != gl.GL_FRAMEBUFFER_COMPLETE:
            raise RuntimeError("this OpenGL draws no images of 32-bit floats")
        return made

    def draw(self, near: float) -> tuple[Array, Array]:
        """The image (h, w, 3) and the depths (h, w) along the view, infinite in the background."""
        self.camera.znear = near
        self.renderer.render(self.scene, self.flags)  # leaves its framebuffer bound for reading
        gl, (width, height) = self.gl, self.size
        image = gl.glReadPixels(0, 0, width, height, gl.GL_RGB, gl.GL_FLOAT)
        buffer = gl.glReadPixels(0, 0, width, height, gl.GL_DEPTH_COMPONENT, gl.GL_FLOAT)
        image = np.asarray(image, dtype=np.float64).reshape(height, width, 3)[::-1]
        d = np.asarray(buffer, dtype=np.float64).reshape(height, width)[::-1]
        return image, np.where(d < 1.0, near * FARTHEST / (FARTHEST - d * (FARTHEST - near)), np.inf)


def _no_viewer() -> types.ModuleType:
    module = types.ModuleType("pyrender.viewer")
    module.__dict__["Viewer"] = None
    return module


def _scene(pyrender: Any, task: Task, camera: Any) -> Any:
    scene = pyrender.Scene(bg_color=np.zeros(4), ambient_light=task.ambient)
    scene.add(camera, pose=np.eye(4))
    for surface in task.surfaces:
        scene.add(_mesh(pyrender, surface))
    for light in task.lights:
        scene.add(_light(pyrender, light), pose=_pose(light))
    return scene


def _mesh(pyrender: Any, surface: Surface) -> Any:
    metal = surface.roughness is not None
    material = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=np.append(surface.color, 0.0 if surface.two_sided else 1.0),
        metallicFactor=float(metal),
        roughnessFactor=surface.roughness if metal else 1.0,
        emissiveFactor=surface.emission,
        doubleSided=True,
    )
    return pyrender.Mesh(
        [pyrender.Primitive(positions=surface.positions, normals=surface.normals, material=material, mode=4)]
    )


def _light(pyrender: Any, light: SizelessLight) -> Any:
    """pyrender's light; shaders/mesh.frag tells how it reads the fields."""
    if light.position is None:
        return pyrender.DirectionalLight(color=light.power)
    if light.axis is None:
        return pyrender.PointLight(color=light.power)
    return pyrender.SpotLight(
        color=light.power,
        intensity=float(light.linear),
        innerConeAngle=light.inner,
        outerConeAngle=light.outer,
    )


def _pose(light: SizelessLight) -> Array:
    """The transformation (4, 4) that puts a light at its place and turns its -z the way it shines."""
    result = np.eye(4)
    if light.axis is not None:
        z = -light.axis
        x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
        x /= np.linalg.norm(x)
        result[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    if light.position is not None:
        result[:3, 3] = light.position
    return result


if __name__ == "__main__":
    main(Path(sys.argv[1]))

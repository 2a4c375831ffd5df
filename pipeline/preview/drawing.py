# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A picture of a scene from outside: geometry, camera, lights, and the samples of one pixel.

The only import of pyvista, which draws off screen by OpenGL. Without OpenGL VTK ends the whole process, so
that it is tried in a process of its own first.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.preview.samples import HIDDEN, IDLE, SEEN, Tried
from pipeline.preview.view import View
from pipeline.references.subprocesses import attempt, last_words
from renderer import RenderScene
from scenes.arrays import Array
from scenes.description.scene import SceneDescription
from scenes.description.shapes import ShapeDescription
from scenes.errors import PenumbraError

SIZE = (1280, 900)  # pixels
SEGMENTS = 256  # of a disk's rim, and 5,120 triangles a sphere
HANDED = np.array([1.0, 1.0, -1.0])  # pbrt's space is left-handed, VTK's right-handed: z is turned
COLOURS = {SEEN: "#ffb000", HIDDEN: "#dc267f", IDLE: "#648fff"}  # told apart by the colour-blind too
BACKGROUND, INK = "#eef0f4", "#1b1f2a"
SECONDS = 120  # for the trial: the first import of VTK from a slow disk
# VTK's windows for Linux, those first that need no display; elsewhere the system's own is the only one.
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow", "vtkXOpenGLRenderWindow")
TRIAL = """
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
plotter.add_mesh(pyvista.Sphere(), color="red")
image = plotter.screenshot(None, return_img=True)
assert image.std() > 1, "the picture is empty"
print("ok", plotter.render_window.GetClassName())
"""
REMEDY = "install EGL with Mesa, for example: apt install libegl1"


@dataclass(frozen=True)
class OffScreen:
    """Whether pictures can be drawn here. detail: how, or why not. window: the class of VTK's window."""

    works: bool
    detail: str
    window: str = ""


def off_screen() -> OffScreen:
    """Try VTK's windows one after the other, each in a process of its own."""
    if not sys.platform.startswith("linux"):
        return _tried("")
    asked = os.environ.get("VTK_DEFAULT_OPENGL_WINDOW")
    names = (
        [asked] if asked else [name for name in WINDOWS if os.environ.get("DISPLAY") or "XOpenGL" not in name]
    )
    found = [_tried(names[0])]
    for name in names[1:]:
        if not found[-1].works:
            found.append(_tried(name))
    return found[-1] if found[-1].works else OffScreen(False, "; ".join(item.detail for item in found))


def _tried(window: str) -> OffScreen:
    environment = os.environ | ({"VTK_DEFAULT_OPENGL_WINDOW": window} if window else {})
    done = attempt([sys.executable, "-c", TRIAL], SECONDS, environment)
    if isinstance(done, str):
        problem = done
    elif done.returncode == 0 and done.stdout.startswith("ok"):
        return OffScreen(True, f"VTK draws off screen by {done.stdout.split()[-1]}", window)
    else:
        problem = "OpenGL does not start" if done.returncode < 0 else last_words(done.stderr, 1) or "?"
    return OffScreen(False, f"{window or 'VTK'}: {problem}")


def draw(scene: RenderScene, view: View, tried: Tried | None, title: str, path: Path, how: OffScreen) -> None:
    """Write the picture, SIZE pixels. tried: the samples of a pixel, if there is one to show."""
    if how.window:
        os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = how.window
    import pyvista as pv

    view = view.mirrored(HANDED)

    plotter: Any = pv.Plotter(off_screen=True, window_size=list(SIZE), lighting="none")
    plotter.set_background(BACKGROUND)
    for elevation, azimuth, strength in ((55, 35, 0.75), (20, -70, 0.4)):
        light = pv.Light(light_type="camera light", intensity=strength)
        light.set_direction_angle(elevation, azimuth)
        plotter.add_light(light)
    for i, shape in enumerate(scene.description.shapes):
        _shape(pv, plotter, shape, i in view.veiled, view.extent)
    _lights(pv, plotter, scene.description, view)
    _camera(pv, plotter, view)
    labels = list(view.labels)
    if tried is not None:
        tried = replace(tried, start=tried.start * HANDED, end=tried.end * HANDED)
        _samples(pv, plotter, tried, view.extent)
    _words(plotter, title, tried, labels)
    plotter.camera.position, plotter.camera.focal_point, plotter.camera.up = (
        tuple(v.tolist()) for v in (view.position, view.target, np.array([0.0, 1.0, 0.0]))
    )
    plotter.camera.view_angle = view.angle
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    try:
        plotter.screenshot(str(path))
    except OSError as error:
        raise PenumbraError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        plotter.close()


def _shape(pv: Any, plotter: Any, shape: ShapeDescription, veiled: bool, extent: float) -> None:
    mesh = _mesh(pv, shape)
    if shape.emission is not None:
        bright = shape.emission.radiance / max(float(shape.emission.radiance.max()), 1e-300)
        plotter.add_mesh(
            mesh, color=tuple(0.25 + 0.75 * bright), lighting=False, opacity=0.35 if veiled else 1.0
        )
        edges = mesh.extract_feature_edges(
            feature_edges=False, non_manifold_edges=False, manifold_edges=False
        )
        if edges.n_points:
            plotter.add_mesh(edges, color=INK, line_width=2)
        return
    shade = tuple(np.clip(0.15 + 0.85 * np.sqrt(shape.material.normal_reflectance), 0, 1))
    plotter.add_mesh(mesh, color=shade, opacity=0.12 if veiled else 1.0, ambient=0.4, diffuse=0.6)


def _mesh(pv: Any, shape: ShapeDescription) -> Any:
    mesh = shape.geometry.triangulated(SEGMENTS)
    return pv.PolyData.from_regular_faces(mesh.vertices * HANDED, mesh.faces)


def _lights(pv: Any, plotter: Any, scene: SceneDescription, view: View) -> None:
    """Lights without a shape: a ball for one with a place, an arrow for one with a direction."""
    for light in scene.lights:
        if light.place is not None:
            ball = pv.Sphere(radius=0.02 * view.extent, center=light.place * HANDED)
            plotter.add_mesh(ball, color="#ffd75e", lighting=False)
        elif light.towards is not None:
            towards = light.towards * HANDED
            start = view.target + towards * 0.75 * view.extent
            arrow = pv.Arrow(
                start=start, direction=-towards, scale=0.25 * view.extent, shaft_radius=0.02, tip_radius=0.06
            )
            plotter.add_mesh(arrow, color="#e09000", ambient=0.4)


def _camera(pv: Any, plotter: Any, view: View) -> None:
    """The camera's frustum, up to a screen that shows its image."""
    eye, corners = view.eye, view.screen[[0, 0, -1, -1], [0, -1, -1, 0]]
    h, w = view.image.shape[:2]
    grid = pv.StructuredGrid(*(np.ascontiguousarray(view.screen[..., i])[None] for i in range(3)))
    grid.cell_data["rgb"] = view.image.transpose(1, 0, 2).reshape(h * w, 3)
    # A structured grid runs through its first axis fastest.
    plotter.add_mesh(grid, scalars="rgb", rgb=True, lighting=False)
    for a, b in [*((eye, c) for c in corners), *zip(corners, np.roll(corners, -1, axis=0), strict=True)]:
        plotter.add_mesh(pv.Line(a, b), color=INK, line_width=2)
    plotter.add_mesh(pv.Sphere(radius=0.012 * view.extent, center=eye), color=INK)
    if view.seen is not None:
        plotter.add_mesh(pv.Line(eye, view.seen), color="#118833", line_width=3)
        plotter.add_mesh(
            pv.Sphere(radius=0.006 * view.extent, center=view.seen), color="#118833", lighting=False
        )


def _samples(pv: Any, plotter: Any, tried: Tried, extent: float) -> None:
    """Every sample as a line, with a dot at its end on a light or on the surface that hides the light."""
    for state in (IDLE, HIDDEN, SEEN):
        rows = np.flatnonzero(tried.state == state)
        if not rows.size:
            continue
        points = np.stack([tried.start[rows], tried.end[rows]], axis=1).reshape(-1, 3)
        links = np.column_stack([np.full(rows.size, 2), np.arange(2 * rows.size).reshape(-1, 2)])
        plotter.add_mesh(pv.PolyData(points, lines=links.ravel()), color=COLOURS[state], line_width=2)
        ends = tried.end[rows[~tried.far[rows] | (state == HIDDEN)]]
        if state != IDLE and len(ends):
            dots = pv.PolyData(ends).glyph(scale=False, orient=False, geom=pv.Sphere(radius=0.007 * extent))
            plotter.add_mesh(dots, color=COLOURS[state], lighting=False)


def _words(plotter: Any, title: str, tried: Tried | None, labels: list[tuple[Array, str]]) -> None:
    heading = plotter.add_text(title, position=(0.012, 0.955), viewport=True, font_size=13, color=INK)
    heading.prop.background_color, heading.prop.background_opacity = "white", 0.75
    if labels:
        plotter.add_point_labels(
            np.stack([place for place, _ in labels]), [text for _, text in labels], font_size=17, bold=False,
            text_color=INK, shape_color="white", shape_opacity=0.75, show_points=False, always_visible=True, margin=4,  # noqa: E501
        )  # fmt: skip
    if tried is None:
        return
    rows = [[f"{tried.count(state)} {tried.words[state]}", COLOURS[state]] for state in (SEEN, HIDDEN, IDLE)]
    plotter.add_legend(
        rows, bcolor="white", border=True, face="rectangle", size=(0.4, 0.13), loc="lower left"
    )

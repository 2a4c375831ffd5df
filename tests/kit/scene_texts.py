"""Scene texts for the tests of the parser."""

from __future__ import annotations

import numpy as np
import pytest

from scenes.description.scene import SceneDescription
from scenes.errors import Location, SceneError
from scenes.pbrt.parser import parse

HEAD = """\
LookAt 0 1 -5  0 1 0  0 1 0
Camera "perspective" "float fov" [ 40 ]
Film "rgb" "integer xresolution" [ 8 ] "integer yresolution" [ 6 ]
PixelFilter "box"
Integrator "path" "integer maxdepth" [ 1 ]
WorldBegin
"""
HEAD_LINES = HEAD.count("\n")
TRIANGLE = 'Shape "trianglemesh" "point3 P" [ 0 0 0  1 0 0  0 1 0 ]'
PATCH = 'Shape "bilinearmesh" "point3 P" [ 0 0 0  1 0 0  0 1 0  1 1 0 ]'


def world(body: str) -> SceneDescription:
    """A whole scene whose world is `body`; its line n is line HEAD_LINES + n of the file "<text>"."""
    return parse(HEAD + body)


def fails(text: str, line: int, column: int, *words: str) -> None:
    """Assert that `text` is refused at exactly this place and that the message has these words in one
    line.
    """
    with pytest.raises(SceneError) as caught:
        parse(text)
    error = caught.value
    assert error.location == Location("<text>", line, column), f"{error}"
    assert "\n" not in str(error)
    for word in words:
        assert word in str(error), f"{word!r} is not in: {error}"


def world_fails(body: str, line: int, column: int, *words: str) -> None:
    """As `fails`; line and column count in `body`."""
    fails(HEAD + body, HEAD_LINES + line, column, *words)


def face_normals(vertices: np.ndarray, faces: np.ndarray, reverse: bool) -> np.ndarray:
    """Unit normals by the description's own rule: (p1-p0) x (p2-p0), also (p10-p00) x (p01-p00), turned if
    `reverse`.
    """
    p0, p1, p2 = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(p1 - p0, p2 - p0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return -normals if reverse else normals

"""What is no environment: one line that says what is wrong, where, and what is allowed."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest

from renderer.lights.environment import EnvironmentLights
from scenes.description.lights import Environment
from scenes.errors import Location, SceneError

ONE = np.ones(3)


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        (Environment(ONE, np.full((2, 2, 3), np.nan)), "nan, nan, nan in row 0, column 0"),
        (Environment(ONE, np.full((2, 2, 3), np.inf)), "finite and not negative; it is inf"),
        (Environment(1e200 * ONE, np.full((2, 2, 3), 1e200)), "finite and not negative; it is inf"),
        (
            Environment(ONE, np.arange(12.0).reshape(2, 2, 3) - 0.5),
            "-0.5, 0.5, 1.5 in row 0, column 0 of its image",
        ),
        (Environment(-ONE), "not negative; it is -1, -1, -1$"),
        (Environment(ONE, np.ones((2, 3, 3))), "must be square; this one is 3x2"),
        (Environment(ONE, np.ones((2, 2, 1))), "(h, w, 3)"),
        (Environment(ONE, np.ones((0, 0, 3))), "(h, w, 3)"),
        (Environment(ONE, np.ones((2, 4, 3)), "cube"), "unknown mapping 'cube'"),
        (Environment(ONE, frame=2 * np.eye(3)), "not scaled or sheared"),
    ],
)
def test_what_is_no_environment_is_an_error_with_its_place(environment: Environment, message: str):
    placed = dataclasses.replace(environment, where=Location("sky.pbrt", 4, 1))
    with pytest.raises(SceneError, match="^sky.pbrt:4:1: .*" + re.escape(message).replace(r"\$", "$")):
        EnvironmentLights.make([placed], [0])

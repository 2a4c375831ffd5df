"""pbrt-v4's transformations: each carries its inverse, and `LookAt` makes a left-handed camera space."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import cosdg, sindg  # pyright: ignore[reportMissingTypeStubs]

from scenes.errors import Location, SceneError

Array = NDArray[np.float64]

COORDINATE_LIMIT = 1e18  # beyond it squares overflow the float32 of ray tracers
SHAPE_TOLERANCE = 1e-5  # matrices in scene files are often rounded to six digits
INVERSE_TOLERANCE = 1e-6
FLAT = "the transformation flattens space: it has no inverse"
REMEMBERED = 4096  # matrices whose properties are kept
FEW = 64  # points, below which calls cost more than what they do
IDENTITY = np.eye(4)
STILL = np.eye(3).tobytes()
ROUNDING = 1e-14  # what is orthogonal up to this is inverted by transposition, exactly


@dataclass(frozen=True, eq=False)
class Transform:
    """matrix, inverse: (4, 4) float64; columns are the images of the axes, as in pbrt.

    The inverse is NaN where there is none: then space is flattened, and only points can be placed.
    """

    matrix: Array
    inverse: Array

    def __matmul__(self, other: Transform) -> Transform:
        """`self` after `other`."""
        return Transform(_product(self.matrix, other.matrix), _product(other.inverse, self.inverse))

    def points(self, p: Array) -> Array:
        """Transform points: (m, 3) -> (m, 3)."""
        x, y, z = p.T
        rows = self.matrix
        if len(p) <= FEW:  # the same sums, in a third of the calls
            a, b, c, d = rows[:3].T
            return a * x[:, None] + b * y[:, None] + c * z[:, None] + d + 0.0
        out = np.zeros(p.shape)
        for i in range(3):  # a column at a time: the points may be most of the memory
            out[:, i] = rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * z + rows[i, 3]
        out += 0.0
        return out

    def vector(self, v: Array) -> Array:
        """Transform one vector: (3,) -> (3,)."""
        rows = self.matrix
        return np.array([rows[i, 0] * v[0] + rows[i, 1] * v[1] + rows[i, 2] * v[2] for i in range(3)]) + 0.0

    def normals(self, n: Array) -> Array:
        """Transform normals by the inverse transpose, (m, 3) -> (m, 3); lengths are not kept."""
        rows = self.inverse
        return n[:, :1] * rows[0, :3] + n[:, 1:2] * rows[1, :3] + n[:, 2:] * rows[2, :3] + 0.0

    @property
    def flattens(self) -> bool:
        """Whether there is no inverse."""
        return math.isnan(self.inverse.item(0))

    @property
    def only_moves(self) -> bool:
        """Whether it is exactly a translation, its inverse too."""
        return self.matrix[:3, :3].tobytes() == self.inverse[:3, :3].tobytes() == STILL

    @property
    def projects(self) -> bool:
        """Whether the map is not affine, so that it cannot place points."""
        return self.matrix[3].tolist()[:3] != [0.0, 0.0, 0.0]

    @property
    def swaps_handedness(self) -> bool:
        """Whether the transformation mirrors."""
        return _swaps_handedness(self.matrix[:3, :3].tobytes())

    def inverted(self) -> Transform:
        """The inverse, without any computation."""
        return Transform(self.inverse, self.matrix)


@lru_cache(REMEMBERED)
def _swaps_handedness(linear: bytes) -> bool:
    return bool(np.linalg.slogdet(np.frombuffer(linear).reshape(3, 3))[0] < 0)


def _product(a: Array, b: Array) -> Array:
    # Not `@`: BLAS may fuse multiplications and additions, and then a scene's hash would depend on the
    # machine.
    return (a[:, :, None] * b[None, :, :]).sum(axis=1)


def identity() -> Transform:
    """The identity."""
    return Transform(IDENTITY.copy(), IDENTITY.copy())


def translate(x: float, y: float, z: float) -> Transform:
    """Translation by (x, y, z)."""
    matrix, inverse = IDENTITY.copy(), IDENTITY.copy()
    matrix[:3, 3] = (x, y, z)
    inverse[:3, 3] = (-x, -y, -z)
    return Transform(matrix, inverse)


def scale(x: float, y: float, z: float) -> Transform:
    """Scaling along the axes."""
    if 0 in (x, y, z):
        return Transform(np.diag([x, y, z, 1.0]), np.full((4, 4), np.nan))
    return Transform(np.diag([x, y, z, 1.0]), np.diag([1 / x, 1 / y, 1 / z, 1.0]))


def rotate(degrees: float, x: float, y: float, z: float) -> Transform:
    """Right-handed rotation about the axis (x, y, z), exact at multiples of 90 degrees; ValueError if there
    is no axis.
    """
    axis = unit(np.array([x, y, z]))
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = math.fmod(degrees, 360.0)  # exact, where those below lose a large angle
    c, s = float(cosdg(turn)), float(sindg(turn))
    matrix = np.eye(4)
    matrix[:3, :3] = c * np.eye(3) + (1 - c) * np.outer(axis, axis) + s * cross
    return Transform(matrix, matrix.T.copy())


def look_at(eye: Array, target: Array, up: Array) -> Transform:
    """World to camera at `eye`, z towards `target`; x = up cross z, so the space is left-handed as pbrt's.

    ValueError where eye and target coincide, or up lies along the direction of view.
    """
    forward = unit(target - eye)
    right = np.cross(unit(up), forward)
    if np.linalg.norm(right) < 1e-12:
        raise ValueError("the up vector lies along the direction of view")
    right = unit(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    to_world[:3, 3] = eye
    rotation = np.eye(4)
    rotation[:3, :3] = to_world[:3, :3].T
    return Transform(rotation, rotation.T.copy()) @ translate(*(-eye))


def from_matrix(values: Sequence[float]) -> Transform:
    """The matrix of `Transform` and `ConcatTransform`: 16 numbers, column after column; ValueError where its
    last number is 0.
    """
    matrix = np.array(values).reshape(4, 4).T + 0.0
    if matrix[3, 3] == 0:
        raise ValueError("the matrix has no inverse")
    matrix = np.asarray(matrix / matrix[3, 3], dtype=np.float64) + 0.0
    linear, projects = matrix[:3, :3], bool(np.any(matrix[3, :3]))
    if not projects and not np.any(matrix[:3, 3]) and np.abs(linear.T @ linear - np.eye(3)).max() <= ROUNDING:
        return Transform(matrix, matrix.T.copy())
    try:
        inverse = np.linalg.inv(matrix).astype(np.float64)
    except np.linalg.LinAlgError:
        return Transform(matrix, np.full((4, 4), np.nan))
    if not projects:
        inverse[3] = (0, 0, 0, 1)
    if not np.abs(_product(matrix, inverse) - np.eye(4)).max() <= INVERSE_TOLERANCE:
        inverse = np.full((4, 4), np.nan)  # none that can be computed
    return Transform(matrix, inverse)


def unit(v: Array) -> Array:
    """The vector (3,) at length 1, unchanged if it has that length up to rounding. ValueError for the zero
    vector.
    """
    largest = np.abs(v).max()
    if largest == 0:
        raise ValueError("a direction must not be the zero vector")
    if largest <= 1 and abs(v @ v - 1) <= 8 * np.finfo(np.float64).eps:
        return v
    v = v / largest  # else squares of tiny or huge components leave the range
    return v / np.linalg.norm(v)


def uniform_scale(columns: Array) -> float | None:
    """The factor by which orthogonal columns of one length, (3, k), scale; None for columns that stretch or
    shear.
    """
    return _uniform_scale(columns.tobytes(), columns.shape[1])


# Shapes by the thousand differ in where they stand and share how they are turned.
@lru_cache(REMEMBERED)
def _uniform_scale(data: bytes, count: int) -> float | None:
    columns = np.frombuffer(data).reshape(3, count)
    lengths = np.linalg.norm(columns, axis=0)
    factor = float(lengths.mean())
    gram = (columns / factor).T @ (columns / factor)
    if not np.abs(gram - np.eye(count)).max() <= SHAPE_TOLERANCE:
        return None
    return 1.0 if abs(factor - 1) <= ROUNDING else factor


def rigid(transform: Transform) -> Array | None:
    """Camera to world from a camera's CTM, without its uniform scale and rounding: (4, 4). None if it
    stretches.
    """
    matrix = transform.inverse.copy()
    axes = orthonormal(matrix[:3, :3])
    if axes is None:
        return None
    matrix[:3, :3] = axes
    return matrix + 0.0


def orthonormal(linear: Array) -> Array | None:
    """Orthogonal columns of one length, (3, 3), made orthonormal; unchanged if they are so up to rounding.
    None if they stretch.
    """
    axes = _orthonormal(linear.tobytes())
    return None if axes is None else axes.copy()


@lru_cache(REMEMBERED)
def _orthonormal(data: bytes) -> Array | None:
    linear = np.frombuffer(data).reshape(3, 3)
    if uniform_scale(linear) is None:
        return None
    if np.abs(linear.T @ linear - np.eye(3)).max() <= ROUNDING:
        return linear + 0.0
    left, _, right = np.linalg.svd(linear)
    return left @ right + 0.0


_MAKERS: dict[str, tuple[int, Callable[..., Transform]]] = {
    "Identity": (0, identity),
    "Translate": (3, translate),
    "Scale": (3, scale),
    "Rotate": (4, rotate),
    "LookAt": (9, lambda *v: look_at(np.array(v[:3]), np.array(v[3:6]), np.array(v[6:]))),
    "Transform": (16, lambda *v: from_matrix(v)),
    "ConcatTransform": (16, lambda *v: from_matrix(v)),
}
ARGUMENTS = {name: count for name, (count, _) in _MAKERS.items()}


def in_range(numbers: Array) -> bool:
    """Whether all of them are within COORDINATE_LIMIT; NaN is not."""
    if numbers.size <= FEW:
        return all(-COORDINATE_LIMIT <= x <= COORDINATE_LIMIT for x in numbers.ravel().tolist())
    return bool(np.abs(numbers).max() <= COORDINATE_LIMIT)


def apply_directive(
    name: str, values: Sequence[float], current: Transform, where: Callable[[], Location]
) -> Transform:
    """The current transformation after directive `name` with its numbers, made without warnings of overflow.
    SceneError at `where()` for one that is not invertible.
    """
    try:
        made = _MAKERS[name][1](*values)
    except ValueError as error:
        raise SceneError(f"{name}: {error}", where()) from None
    result = made if name in ("Identity", "Transform") else current @ made
    for matrix in (result.matrix,) if result.flattens else (result.matrix, result.inverse):
        if not in_range(matrix):
            message = f"{name}: it, or its inverse, is beyond {COORDINATE_LIMIT:g}, the range of coordinates"
            raise SceneError(message, where())
    return result

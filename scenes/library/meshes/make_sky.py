"""Makes maps/sky.exr: a sky with clouds and a small sun, 128 x 128 texels in pbrt's equal-area octahedral
layout.

Run `python scenes/library/meshes/make_sky.py` from the checkout; the file it writes is the one that is
checked in.

Directions are those of the light's own space, z up. The sky is blue at the zenith and pale at the horizon,
the clouds are sums of cosines, the ground is dark; a texel belongs to the sun if its middle is within
SUN_RADIUS of the sun's. Values are rounded to multiples of 2^-8, so that the file does not depend on the last
bits of a cosine, and is small.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.images.exr import write_exr

Array = NDArray[np.float64]

SIZE = 128
SUN = np.array([-0.55, -0.5, 0.5])  # towards the sun, of any length
SUN_RADIUS = np.radians(2.6)
SUN_RADIANCE = np.array([300.0, 250.0, 180.0])
ZENITH, HORIZON, GROUND = (np.array(c) for c in ([0.06, 0.13, 0.34], [0.42, 0.4, 0.36], [0.08, 0.07, 0.05]))
CLOUD = np.array([0.85, 0.82, 0.8])
# Wave vectors and phases of the clouds, over the plane that the sky is projected on.
WAVES = (
    (1.3, 0.7, 0.2),
    (-0.9, 1.9, 1.1),
    (2.9, -1.3, 2.3),
    (-2.1, -3.7, 0.7),
    (5.3, 2.9, 4.1),
    (-4.7, 6.1, 5.2),
)


def directions() -> Array:
    """Unit vectors (SIZE, SIZE, 3) of the texels' middles: the equal-area octahedral map [clarberg2008], rows
    along +y.
    """
    grid = (np.arange(SIZE) + 0.5) / SIZE * 2 - 1
    a, b = grid[None, :] * np.ones((SIZE, 1)), grid[:, None] * np.ones((1, SIZE))
    upper = np.abs(a) + np.abs(b) <= 1
    s, t = np.where(upper, np.abs(a), 1 - np.abs(b)), np.where(upper, np.abs(b), 1 - np.abs(a))
    r = s + t
    angle = np.pi / 2 * t / r
    sine = r * np.sqrt(2 - r**2)
    z = np.where(upper, 1 - r**2, r**2 - 1)
    return np.stack([np.copysign(np.cos(angle) * sine, a), np.copysign(np.sin(angle) * sine, b), z], axis=2)


def clouds(d: Array) -> Array:
    """How much cloud there is, 0 to 1, (SIZE, SIZE), on a plane above; none below the horizon."""
    z = np.maximum(d[..., 2], 0.05)
    x, y = d[..., 0] / (z + 0.15), d[..., 1] / (z + 0.15)
    total = sum(np.cos(kx * x + ky * y + phase) / (1 + i) for i, (kx, ky, phase) in enumerate(WAVES))
    return np.clip((total - 0.1) / 1.2, 0, 1) * np.clip(d[..., 2] / 0.15, 0, 1)


def sky() -> Array:
    """Radiance (SIZE, SIZE, 3)."""
    d = directions()
    up = d[..., 2:]
    clear = HORIZON + (ZENITH - HORIZON) * np.clip(up, 0, 1) ** 0.5
    cover = clouds(d)[..., None]
    radiance = np.where(
        up > 0, clear + (CLOUD - clear) * cover, GROUND + (HORIZON - GROUND) * np.exp(up * 12)
    )
    towards = SUN / np.sqrt(np.sum(SUN**2))
    in_sun = np.sum(d * towards, axis=2, keepdims=True) > np.cos(SUN_RADIUS)
    return np.round(np.where(in_sun, SUN_RADIANCE, radiance) * 2**8) / 2**8


if __name__ == "__main__":
    target = Path(__file__).parent.parent / "maps" / "sky.exr"
    image = sky()
    write_exr(target, {name: image[..., i] for i, name in enumerate("RGB")})
    print(f"{target}: {target.stat().st_size} bytes")

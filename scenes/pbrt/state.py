"""The scene read so far, and the state that the next directive meets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenes.description.lights import Light
from scenes.description.materials import Diffuse, Material
from scenes.description.normal_perturbation import NormalMap
from scenes.description.scene import Camera, Film, PerspectiveCamera, PixelFilter, RenderDefaults
from scenes.description.shapes import Emission, Geometry
from scenes.description.textures import Texture
from scenes.errors import Location, Report, SceneError, Unsupported
from scenes.pbrt.text.parameters import SRGB, VERSION_3, Parameter, Parameters
from scenes.pbrt.transforms import Transform, identity

DEFAULT_REFLECTANCE = 0.5
PROJECTION = (
    "the last row of the matrix (each fourth number) must be 0 0 0 1: only an infinite light may have others"
)
COUNT_LIMIT = 10_000_000  # of shapes, of lights, of names: some 10 GB

# pbrt-v4's radii of its filters where a file gives none, and its filter where a file names none.
FILTERS = {"box": 0.5, "triangle": 2.0, "gaussian": 1.5}
DEFAULT_FILTER = PixelFilter("gaussian", FILTERS["gaussian"], FILTERS["gaussian"], 0.5)

MATERIALS_OF_VERSION_3 = (
    "matte", "plastic", "uber", "glass", "mirror", "substrate", "translucent", "metal", "disney", "fourier",
    "kdsubsurface",
)  # fmt: skip

Array = NDArray[np.float64]
Active = Literal["All", "StartTime", "EndTime"]


@dataclass(frozen=True)
class NamedMaterial:
    """A use of a material by its name, which is looked up after the whole file is read, as in pbrt."""

    name: str
    where: Location


@dataclass(frozen=True)
class TexturedDiffuse:
    """A diffuse material with a spectrum texture as reflectance, given by name; looked up like
    `NamedMaterial`.
    """

    texture: str
    where: Location


@dataclass(frozen=True)
class NamedNumbers:
    """A float texture by its name; looked up like `NamedMaterial`."""

    texture: str
    where: Location


Alpha = float | NamedNumbers


@dataclass(frozen=True, eq=False)
class Pending:
    """A material of several names, resolved like `NamedMaterial`: make looks them up."""

    make: Callable[[Builder], Material]


@dataclass(frozen=True, eq=False)
class MixedUse:
    """A mix of two materials by their names; resolved like `NamedMaterial`. amount: looks up its texture."""

    first: NamedMaterial
    second: NamedMaterial
    amount: Callable[[Builder], Texture]


@dataclass(frozen=True)
class Interface:
    """A material without a surface, which light passes through, as pbrt's null material."""


@dataclass(frozen=True)
class MediumInterface:
    """The names of the media on both sides of a surface, "" for empty space."""

    inside: str
    outside: str
    where: Location


@dataclass(frozen=True, eq=False)
class PerturbedUse:
    """A material with a normal map, or with a displacement that turns its normals alone."""

    material: Interface | Material | TexturedDiffuse | Pending
    perturbation: NormalMap | NamedNumbers


MaterialUse = Interface | Material | TexturedDiffuse | Pending | MixedUse | NamedMaterial | PerturbedUse


@dataclass(frozen=True, eq=False)
class AreaLight:
    """`AreaLightSource`. emission: without `power`. power: in W, to be spread over each shape; None if not
    given.
    """

    emission: Emission
    power: float | None
    where: Location


@dataclass(frozen=True, eq=False)
class GraphicsState:
    """The state that `AttributeBegin` saves and `AttributeEnd` restores. attributes: what `Attribute` said,
    by its target. space: of `rgb`. media: None for empty space.

    transform: when the shutter opens. end: when it closes. active: which of the two directives change.
    """

    transform: Transform = field(default_factory=identity)
    end: Transform = field(default_factory=identity)
    active: Active = "All"
    reverse: bool = False
    material: MaterialUse = field(default_factory=lambda: Diffuse(np.full(3, DEFAULT_REFLECTANCE)))
    light: AreaLight | None = None
    media: MediumInterface | None = None
    space: str = SRGB
    attributes: Mapping[str, tuple[Parameter, ...]] = field(default_factory=dict[str, tuple[Parameter, ...]])

    def under(self, transform: Transform, end: Transform) -> GraphicsState:
        """The state under other transformations, which most directives change; `replace` is slow."""
        s = self
        rest = (s.active, s.reverse, s.material, s.light, s.media, s.space, s.attributes)
        return GraphicsState(transform, end, *rest)


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape of the file, in world space or in the space of its object, with its state."""

    geometry: Geometry
    material: MaterialUse
    light: AreaLight | None
    where: Location
    alpha: Alpha | None = None


@dataclass(eq=False)
class MediumUse:
    """Media at a camera or at a shape. owner: the object that the shape is part of. parts: the shape, empty
    for a camera and where no ray meets it.
    """

    media: MediumInterface
    owner: str | None = None
    parts: Sequence[PlacedShape] = ()


@dataclass(frozen=True, eq=False)
class InstanceUse:
    """An `ObjectInstance`."""

    name: str
    transform: Transform
    where: Location


@dataclass(frozen=True, eq=False)
class NamedTexture:
    """A texture by its name. value: None for an unsupported one, which the report lists. size: the number of
    its nodes. plain: whether pbrt takes it for a constant.
    """

    value: Texture | None
    size: int
    plain: bool = False


@dataclass(eq=False)
class Builder:
    """A scene as far as it has been read. textures: by ("float" or "spectrum", name). objects: by name.
    texels: of all images.

    integrator: its kind and its place. media: where each is made. media_used: by the camera and the shapes,
    with the object that each shape is part of. interfaces: how many shapes light passes through.

    without_lights: where `Integrator` says that lights are not to be sampled. full_size: of the film before
    its crop, x0, x1, y0, y1 in pixels. diagonal: of the film, mm. exposure: seconds that the shutter is open.
    """

    report: Report = field(default_factory=Report)
    state: GraphicsState = field(default_factory=GraphicsState)
    in_world: bool = False
    camera: Camera = field(default_factory=lambda: PerspectiveCamera(np.eye(4), 90.0))
    screen_window: Array | None = None
    full_size: tuple[int, int] = (1280, 720)
    crop: tuple[int, int, int, int] | None = None
    diagonal: float = 35.0
    exposure: float = 1.0
    iso: float = 100.0
    film: Film = field(default_factory=lambda: Film(1280, 720, "", DEFAULT_FILTER))
    defaults: RenderDefaults = field(default_factory=RenderDefaults)
    occlusion_distance: float = np.inf
    without_lights: Location | None = None
    integrator: tuple[str, Location] | None = None
    media: dict[str, Location] = field(default_factory=dict[str, Location])
    media_used: list[MediumUse] = field(default_factory=list[MediumUse])
    interfaces: int = 0
    materials: dict[str, MaterialUse] = field(default_factory=dict[str, MaterialUse])
    textures: dict[tuple[str, str], NamedTexture] = field(default_factory=dict[tuple[str, str], NamedTexture])
    texture_names: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])
    systems: dict[str, tuple[Transform, Transform]] = field(
        default_factory=dict[str, tuple[Transform, Transform]]
    )
    shapes: list[PlacedShape] = field(default_factory=list[PlacedShape])
    lights: list[Light] = field(default_factory=list[Light])
    objects: dict[str, list[PlacedShape]] = field(default_factory=dict[str, list[PlacedShape]])
    current_object: str | None = None
    uses: list[InstanceUse] = field(default_factory=list[InstanceUse])
    texels: int = 0
    images: dict[tuple[str, ...], Array] = field(
        default_factory=dict[tuple[str, ...], Array]
    )  # `scenes.pbrt.directives.texels` fills it

    @property
    def moves(self) -> bool:
        """Whether an object placed now would move while the shutter is open."""
        start, end = self.state.transform.matrix, self.state.end.matrix
        return start is not end and not np.array_equal(start, end)

    def check_affine(self, where: Location) -> None:
        """Raise Unsupported if the transformation is a projection."""
        if self.state.transform.projects:
            raise Unsupported(PROJECTION, where)

    def check_placed(self, what: str, where: Location) -> None:
        """Report `what` where it moves: it may be rendered as it stands when the shutter opens.

        Unsupported where the transformation is a projection.
        """
        self.check_affine(where)
        if self.moves:
            self.report.substitute(f"{what} that moves", "as it stands at the start", where)


Handler = Callable[[Builder, str, Parameters], None]


def check_room(collection: Sized, what: str, where: Location) -> None:
    """SceneError where a file would make more of something than memory should hold."""
    if len(collection) >= COUNT_LIMIT:
        raise SceneError(f"more than {COUNT_LIMIT:,} {what}", where)


def refuse_kind(kind: str, supported: str, parameters: Parameters) -> None:
    """`Unsupported` unless `kind` is one of the words of `supported`."""
    if parameters.owner in ("Material", "MakeNamedMaterial") and kind in MATERIALS_OF_VERSION_3:
        raise SceneError(f'{parameters.owner} "{kind}" {VERSION_3}', parameters.where)
    if kind not in supported.split():
        allowed = ", ".join(f'"{name}"' for name in supported.split())
        raise Unsupported(
            f'{parameters.owner} "{kind}" is not supported; supported: {allowed}', parameters.where
        )


def require_value(
    parameters: Parameters, name: str, value: float | str | bool, allowed: float | str | bool, why: str
) -> None:
    """Report the parameter `name` unless its value is the one that is simulated."""
    if value != allowed:
        shown = (
            f'"{allowed}"'
            if isinstance(allowed, str)
            else f"{allowed:g}"
            if isinstance(allowed, float)
            else str(allowed).lower()
        )
        parameters.unsupported(name, f"{parameters.owner}: {name} must be {shown}: {why}")

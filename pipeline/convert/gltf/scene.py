"""A glTF scene as a document of pbrt's.

Cameras of glTF look along their -z with +x to the right and +y up; pbrt's look along +z with the same x and
y. World coordinates stay as they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from trimesh.transformations import quaternion_matrix  # pyright: ignore[reportUnknownVariableType]

from pipeline.convert.document import Document, mesh_lines
from pipeline.convert.gltf.file import GltfFile, Object, read_gltf
from pipeline.convert.gltf.surfaces import Surface, Surfaces
from scenes.arrays import Array, Index
from scenes.description.lights import DistantLight, PointLight, SpotLight
from scenes.description.materials import Diffuse
from scenes.errors import PenumbraError
from scenes.files import Files
from scenes.pbrt.transforms import look_at

FORWARD = np.diag([1.0, 1.0, -1.0, 1.0])
HEIGHT, ASPECT, SPP = 720, 16 / 9, 16  # of images, of which glTF says nothing
DEPTH = 200  # of nodes inside each other
TRIANGLES, STRIP, FAN = 4, 5, 6
FILTER = 'PixelFilter "gaussian"'
KNOWN = {
    "KHR_lights_punctual", "KHR_materials_ior", "KHR_materials_transmission", "KHR_materials_specular",
    "KHR_materials_volume", "KHR_materials_emissive_strength", "KHR_texture_transform", "KHR_materials_unlit",
}  # fmt: skip


def convert(path: Path, stem: str, allow_outside: bool = False) -> Document:
    """Convert the scene of a .gltf or .glb file. stem: how the names of its images begin.

    SceneError or PenumbraError for a malformed file. The document lists what could not be kept.
    """
    file = read_gltf(path, Files(path.parent, allow_outside))
    document = Document(stem)
    _Converter(document, file).scene()
    return document


class _Converter:
    def __init__(self, document: Document, file: GltfFile) -> None:
        self._document, self._file = document, file
        self._surfaces = Surfaces(file, document.losses)
        self._camera: tuple[Object, Array, str] | None = None
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)

    def _lost(self, what: str, where: str) -> None:
        self._document.losses.add(what, f"{self._file.path.name}: {where}")

    def scene(self) -> None:
        file = self._file
        needed = sorted({str(name) for name in file.data.get("extensionsRequired", [])} - KNOWN)
        if needed:
            raise file.fail("extensionsRequired", f"{', '.join(needed)} cannot be read")
        for kind in ("animations", "skins"):
            if file.data.get(kind):
                self._lost(f"{kind} are left out: everything stands as its node says", kind)
        if file.all("scenes"):
            index = file.data.get("scene", 0)
            roots = file.one("scenes", index, "scene").get("nodes", [])
        else:
            roots = range(len(file.all("nodes")))
        for root in roots:
            self._node(root, np.eye(4), ())
        if self._camera is None:
            self._look_on()
        else:
            self._take(*self._camera)

    def _node(self, index: Any, outer: Array, inside: tuple[int, ...]) -> None:
        node = self._file.one("nodes", index, "nodes")
        where = f"nodes[{index}]"
        if index in inside or len(inside) > DEPTH:
            raise self._file.fail(where, "it is inside itself, or too deep")
        matrix = np.asarray(outer @ self._matrix(node, where), dtype=np.float64)
        if "mesh" in node:
            self._mesh(node["mesh"], matrix, where)
        if "camera" in node:
            if self._camera is None:
                self._camera = self._file.one("cameras", node["camera"], where), matrix, where
            else:
                self._lost("one camera is converted, the first", where)
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            self._light(light.get("light"), matrix, where)
        for child in node.get("children", []):
            self._node(child, matrix, (*inside, index))

    def _matrix(self, node: Object, where: str) -> Array:
        """The transformation (4, 4) of a node: its matrix, or translation x rotation x scale."""
        if "matrix" in node:
            return self._file.numbers(node, "matrix", [0.0] * 16, where).reshape(4, 4).T
        out = np.eye(4)
        x, y, z, w = self._file.numbers(node, "rotation", [0.0, 0.0, 0.0, 1.0], where)
        out[:3, :3] = quaternion_matrix([w, x, y, z])[:3, :3]
        out[:3, :3] *= self._file.numbers(node, "scale", [1.0, 1.0, 1.0], where)
        out[:3, 3] = self._file.numbers(node, "translation", [0.0, 0.0, 0.0], where)
        return out

    def _mesh(self, index: Any, matrix: Array, where: str) -> None:
        mesh = self._file.one("meshes", index, where)
        for i, primitive in enumerate(mesh.get("primitives", [])):
            self._primitive(primitive, matrix, f"meshes[{index}].primitives[{i}]")

    def _primitive(self, primitive: Object, matrix: Array, where: str) -> None:
        attributes: Object = primitive.get("attributes", {})
        mode = primitive.get("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in attributes:
            self._lost("points and lines are left out", where)
            return
        for name, what in (("targets", "morph targets"), ("COLOR_0", "colours of vertices")):
            if name in primitive or name in attributes:
                self._lost(f"{what} are left out", where)
        points = self._vectors(attributes["POSITION"], 3, None, where)
        vertices = np.einsum("ij,mj->mi", matrix[:3, :3], points) + matrix[:3, 3]
        faces = self._faces(primitive, mode, len(points), where)
        if "material" in primitive:
            surface = self._surfaces.surface(primitive["material"], where)
        else:
            surface = Surface(Diffuse(np.ones(3)), None)
            self._lost("a mesh without a material is white", where)
        uv = self._uv(attributes, surface, len(points), where)
        normals = self._normals(attributes, surface, matrix, len(points), where)
        lines = mesh_lines(vertices, faces, uv, normals, bool(np.linalg.det(matrix[:3, :3]) < 0))
        self._document.shape(lines, surface.material, surface.emission)
        self._low = np.minimum(self._low, vertices.min(axis=0))
        self._high = np.maximum(self._high, vertices.max(axis=0))

    def _uv(self, attributes: Object, surface: Surface, count: int, where: str) -> Array | None:
        name = f"TEXCOORD_{surface.coordinates}"
        if not surface.material.needs_uv:
            return None
        if name not in attributes:
            self._lost("a texture without coordinates shows one of its corners", where)
            return np.zeros((count, 2))
        return self._vectors(attributes[name], 2, count, where)

    def _normals(
        self, attributes: Object, surface: Surface, matrix: Array, count: int, where: str
    ) -> Array | None:
        """Vertex normals (m, 3) in world space; None for a light, whose sides follow from its faces."""
        if "NORMAL" not in attributes or surface.emission is not None:
            return None
        normals = self._vectors(attributes["NORMAL"], 3, count, where)
        try:
            return np.einsum("ji,mj->mi", np.linalg.inv(matrix[:3, :3]), normals)
        except np.linalg.LinAlgError:
            raise self._file.fail(where, "its node's transformation has no inverse") from None

    def _vectors(self, index: Any, width: int, count: int | None, where: str) -> Array:
        found = self._file.accessor(index, where).astype(np.float64)
        if found.shape != (count or len(found), width) or not np.isfinite(found).all():
            raise self._file.fail(
                where, f"accessors[{index}] must be finite vectors of {width}, one a vertex"
            )
        return found

    def _faces(self, primitive: Object, mode: int, count: int, where: str) -> Index:
        """(t, 3) indices of a list, a strip or a fan of triangles."""
        if "indices" in primitive:
            order = self._file.accessor(primitive["indices"], where)[:, 0].astype(np.int64)
        else:
            order = np.arange(count)
        if (
            order.size < 3
            or (mode == TRIANGLES and order.size % 3)
            or not (order.min() >= 0 and order.max() < count)
        ):
            raise self._file.fail(where, "its indices are no triangles of its vertices")
        if mode == TRIANGLES:
            return order.reshape(-1, 3)
        i = np.arange(order.size - 2)
        if mode == FAN:
            return np.stack([order[i + 1], order[i + 2], np.full(i.size, order[0])], axis=1)
        odd = i % 2
        return np.stack([order[i], order[i + 1 + odd], order[i + 2 - odd]], axis=1)

    def _light(self, index: Any, matrix: Array, where: str) -> None:
        """Add a punctual light, with W for glTF's lumen: one factor for all lights."""
        every = self._file.data.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
        if not isinstance(index, int) or not 0 <= index < len(every):
            raise self._file.fail(where, f"there is no light {index}")
        light, file = every[index], self._file
        self._lost("candela and lux are taken for W/sr and W/m^2, nits for W/(m^2 sr)", where)
        if "range" in light:
            self._lost("the range of lights is left out: they reach everywhere", where)
        color = file.numbers(light, "color", [1.0, 1.0, 1.0], where)
        amount = color * file.number(light, "intensity", 1.0, where)
        away = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        if light.get("type") == "directional":
            self._document.light(DistantLight(-away + 0.0, amount))
        elif light.get("type") == "point":
            self._document.light(PointLight(matrix[:3, 3] + 0.0, amount))
        elif light.get("type") == "spot":
            cone = light.get("spot", {})
            inner = file.number(cone, "innerConeAngle", 0.0, where)
            outer = file.number(cone, "outerConeAngle", np.pi / 4, where)
            self._lost("spots fall off by pbrt's curve", where)
            degrees = [float(np.degrees(angle)) for angle in (outer, inner)]
            self._document.light(SpotLight(matrix[:3, 3] + 0.0, away + 0.0, amount, degrees[0], degrees[1]))
        else:
            raise file.fail(where, f"a light of type {light.get('type')!r}")

    def _take(self, camera: Object, matrix: Array, where: str) -> None:
        kind = camera.get("type")
        own: Object = camera.get(str(kind), {})
        if kind == "perspective":
            aspect = self._file.number(own, "aspectRatio", ASPECT, where)
            half = np.tan(self._file.number(own, "yfov", np.pi / 4, where) / 2)
            degrees = float(2 * np.degrees(np.arctan(half * min(aspect, 1.0))))
            if not (aspect > 0 and 0 < degrees < 180):
                raise self._file.fail(where, "the camera's yfov or aspectRatio is none that there can be")
            directive = f'Camera "perspective" "float fov" [ {degrees!r} ]'
        elif kind == "orthographic":
            x, y = (self._file.number(own, name, 1.0, where) for name in ("xmag", "ymag"))
            if not (x > 0 and y > 0):
                raise self._file.fail(where, "xmag and ymag must be above 0")
            aspect = x / y
            directive = f'Camera "orthographic" "float screenwindow" [ {-x!r} {x!r} {-y!r} {y!r} ]'
        else:
            raise self._file.fail(where, f"a camera of type {kind!r}")
        self._document.camera(np.asarray(matrix @ FORWARD, dtype=np.float64), directive)
        self._film(aspect)

    def _look_on(self) -> None:
        """Add a camera on the +z side of the scene, a little above, that sees its whole bounding box."""
        if not np.isfinite(self._low).all():
            raise PenumbraError(f"{self._file.path}: there is nothing in the scene")
        self._lost("the scene has no camera: one looks at it from +z", "cameras")
        middle = (self._low + self._high) / 2
        radius = float(np.linalg.norm(self._high - self._low)) / 2 or 1.0
        eye = middle + radius * 3 * np.array([0.0, 0.3, 1.0]) / np.hypot(0.3, 1.0)
        # look_at has x = up cross forward; in a right-handed world right is the other way.
        to_world = look_at(eye, middle, np.array([0.0, 1.0, 0.0])).inverse @ np.diag([-1.0, 1.0, 1.0, 1.0])
        self._document.camera(to_world, 'Camera "perspective" "float fov" [ 40 ]')
        self._film(ASPECT)

    def _film(self, aspect: float) -> None:
        self._document.film(max(1, round(HEIGHT * aspect)), HEIGHT, FILTER, SPP)

"""glTF as pbrt text: derived images of files made here, and what is malformed."""

from __future__ import annotations

import base64
import copy
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pipeline.convert.document import Document, write
from pipeline.convert.gltf.file import read_gltf
from pipeline.convert.gltf.scene import convert
from renderer import render
from scenes.description.materials import Coated, Conductor, Dielectric, Diffuse
from scenes.description.scene import SceneDescription
from scenes.description.shapes import TriangleMesh, vertex_normals
from scenes.errors import PenumbraError, SceneError
from scenes.files import Files
from tests.pipeline.commands.test_commands import Penumbra, penumbra

__all__ = ["penumbra"]

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])  # counter-clockwise from +z
FACES = np.array([0, 1, 2, 0, 2, 3])
MATTE = {
    "pbrMetallicRoughness": {"metallicFactor": 0},
    "extensions": {"KHR_materials_specular": {"specularFactor": 0}},
}


class Maker:
    """Collects a glTF file; its one buffer is a data URI, or the binary chunk of a .glb."""

    def __init__(self) -> None:
        self.buffer = b""
        self.data: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}

    def add(self, kind: str, item: dict[str, Any]) -> int:
        self.data.setdefault(kind, []).append(item)
        return len(self.data[kind]) - 1

    def view(self, data: bytes, **more: Any) -> int:
        self.buffer += b"\0" * (-len(self.buffer) % 4)
        start, self.buffer = len(self.buffer), self.buffer + data
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": len(data), **more})

    def accessor(self, values: np.ndarray[Any, Any], component: int, type_: str, **more: Any) -> int:
        dtype = {5121: "<u1", 5123: "<u2", 5126: "<f4"}[component]
        view = self.view(values.astype(dtype).tobytes())
        count = {"bufferView": view, "componentType": component, "count": len(values), "type": type_}
        return self.add("accessors", count | more)

    def square(self, material: dict[str, Any], **more: Any) -> int:
        attributes = {"POSITION": self.accessor(SQUARE, 5126, "VEC3"), **more.pop("attributes", {})}
        primitive = {"attributes": attributes, "indices": self.accessor(FACES, 5123, "SCALAR"), **more}
        primitive["material"] = self.add("materials", copy.deepcopy(material))
        return self.add("meshes", {"primitives": [primitive]})

    def node(self, **content: Any) -> None:
        self.data["scenes"][0]["nodes"].append(self.add("nodes", content))

    def camera(self, **place: Any) -> None:
        """A film of 720 x 240, which reaches 3 to each side at distance 3."""
        perspective = {"yfov": 2 * float(np.arctan(1 / 3)), "aspectRatio": 3.0, "znear": 0.1}
        index = self.add("cameras", {"type": "perspective", "perspective": perspective})
        self.node(camera=index, **place)

    def light(self, kind: str, color: list[float], intensity: float, **place: Any) -> None:
        lights = (
            self.data.setdefault("extensions", {})
            .setdefault("KHR_lights_punctual", {})
            .setdefault("lights", [])
        )
        lights.append({"type": kind, "color": color, "intensity": intensity})
        self.node(extensions={"KHR_lights_punctual": {"light": len(lights) - 1}}, **place)

    def write(self, path: Path) -> Path:
        binary = path.suffix == ".glb"
        uri = (
            {}
            if binary
            else {"uri": "data:application/octet-stream;base64," + base64.b64encode(self.buffer).decode()}
        )
        self.data["buffers"] = [{"byteLength": len(self.buffer), **uri}]
        text = json.dumps(self.data).encode()
        if not binary:
            path.write_bytes(text)
            return path
        text += b" " * (-len(text) % 4)
        body = self.buffer + b"\0" * (-len(self.buffer) % 4)
        chunks = (
            struct.pack("<II", len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(body), 0x004E4942)
            + body
        )
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
        return path


def converted(
    maker: Maker, folder: Path, name: str = "s.gltf", rows: int = 3
) -> tuple[SceneDescription, Document]:
    document = convert(maker.write(folder / name), "s")
    document.head = [
        line.replace("2160", str(3 * rows)).replace("720", str(rows)) for line in document.head
    ]  # pixels
    document.head = [line.replace('"gaussian"', '"box"') for line in document.head]
    return write(document, name, folder / "s.pbrt"), document


def lamp(*color: float, **more: Any) -> dict[str, Any]:
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10.0}}
    return {**MATTE, "emissiveFactor": [c / 10 for c in color], **more,
            "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
            "extensions": MATTE["extensions"] | strength}  # fmt: skip


@pytest.mark.parametrize("name", ["s.gltf", "s.glb"])
def test_the_camera_looks_along_minus_z_with_x_to_the_right(name: str, tmp_path: Path) -> None:
    """Three squares fill three thirds. In the middle one is turned away, and black but for a second lamp of
    two sides behind it; a mirrored node keeps its front.
    """
    maker = Maker()
    maker.camera()
    maker.node(mesh=maker.square(lamp(1, 2, 3)), translation=[-2, 0, -3])
    half_turn = [0, 1, 0, 0]
    maker.node(mesh=maker.square(lamp(4, 5, 6)), translation=[0, 0, -3], rotation=half_turn)
    maker.node(mesh=maker.square(lamp(7, 8, 9)), translation=[2, 0, -3], scale=[-1, 1, 1])
    image = render(converted(maker, tmp_path, name)[0], spp=4).image
    np.testing.assert_allclose(image[:, :3], np.broadcast_to([1.0, 2, 3], (3, 3, 3)), rtol=1e-6)
    assert not image[:, 3:6].any()
    np.testing.assert_allclose(image[:, 6:], np.broadcast_to([7.0, 8, 9], (3, 3, 3)), rtol=1e-6)
    maker.data["materials"][1]["doubleSided"] = True
    image = render(converted(maker, tmp_path, name)[0], spp=4).image
    np.testing.assert_allclose(image[:, 3:6], np.broadcast_to([4.0, 5, 6], (3, 3, 3)), rtol=1e-6)


def test_the_world_turned_by_a_parent_gives_the_same_image(tmp_path: Path) -> None:
    """Camera and squares under one node with a matrix: a quarter turn about z and a shift."""
    maker = Maker()
    maker.camera()
    maker.node(mesh=maker.square(lamp(1, 2, 3)), translation=[-2, 0, -3])
    turn = [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]  # columns
    maker.data["scenes"][0]["nodes"] = [maker.add("nodes", {"matrix": turn, "children": [0, 1]})]
    image = render(converted(maker, tmp_path)[0], spp=4).image
    np.testing.assert_allclose(image[:, :3], np.broadcast_to([1.0, 2, 3], (3, 3, 3)), rtol=1e-6)
    assert not image[:, 3:].any()


@pytest.mark.parametrize("kind", ["point", "directional", "spot"])
def test_lights_give_their_irradiance(kind: str, tmp_path: Path) -> None:
    """A white floor seen from its front, 0.5 from it, with a light 2 in front of its middle: 1 / pi of E."""
    maker = Maker()
    maker.camera(translation=[0, 0, 0.5])
    maker.node(mesh=maker.square(MATTE))
    maker.light(kind, [1.0, 0.5, 0.25], 1.0 if kind == "directional" else 4.0, translation=[0, 0, 2.0])
    scene, document = converted(maker, tmp_path)
    image = render(scene, spp=64).image
    expected = np.array([1.0, 0.5, 0.25]) / np.pi
    off = 0.0 if kind == "directional" else 0.01  # a pixel is 1/9 wide: cos^4 of 1/18 at 2 is 1 - 1.5e-3
    np.testing.assert_allclose(image[1, 4], expected, rtol=off + 1e-6)
    assert any("candela" in line for line in document.losses.lines())


def test_the_first_row_of_a_texture_is_at_v_0(tmp_path: Path) -> None:
    """A square over the film's middle third, its texture 4 x 4 gray levels: each pixel shows its texel."""
    levels = np.arange(0, 256, 17, dtype=np.uint8).reshape(4, 4)
    out = io.BytesIO()
    Image.fromarray(levels).convert("RGB").save(out, "PNG")
    maker = Maker()
    maker.camera()
    uv = np.array([[0, 255], [255, 255], [255, 0], [0, 0]])  # v downwards, normalised bytes
    coordinates = maker.accessor(uv, 5121, "VEC2", normalized=True)
    image = maker.add("images", {"bufferView": maker.view(out.getvalue()), "mimeType": "image/png"})
    texture = maker.add("textures", {"source": image, "sampler": maker.add("samplers", {"magFilter": 9728})})
    material = {**MATTE, "pbrMetallicRoughness": {"metallicFactor": 0, "baseColorTexture": {"index": texture},
                                                  "baseColorFactor": [1, 0.5, 0.25, 1]}}  # fmt: skip
    maker.node(mesh=maker.square(material, attributes={"TEXCOORD_0": coordinates}), translation=[0, 0, -3])
    maker.light("directional", [1, 1, 1], np.pi)
    shown = render(converted(maker, tmp_path, rows=4)[0], spp=1).image[:, 4:8]
    encoded = levels / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(shown, linear[..., None] * [1, 0.5, 0.25], atol=2e-6)


def test_materials(tmp_path: Path) -> None:
    maker = Maker()
    maker.camera()
    rough = {"baseColorFactor": [0.5, 0.25, 0.75, 1], "roughnessFactor": 0.5}
    glass = {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_ior": {"ior": 1.4}}
    for material in (
        {"pbrMetallicRoughness": rough},
        {"pbrMetallicRoughness": {**rough, "metallicFactor": 0}},
        {"pbrMetallicRoughness": {**rough, "metallicFactor": 0}, "extensions": glass},
        MATTE,
    ):
        maker.node(mesh=maker.square(material), translation=[0, 0, -3])
    metal, coated, pane, matte = (s.material for s in converted(maker, tmp_path)[0].shapes)
    assert isinstance(metal, Conductor)
    np.testing.assert_allclose(metal.normal_reflectance, [0.5, 0.25, 0.75])
    assert metal.alpha == 0.25
    assert isinstance(coated, Coated)
    assert isinstance(coated.base, Diffuse)
    assert np.asarray(coated.base.reflectance).tolist() == [0.5, 0.25, 0.75]
    assert (coated.coat.alpha, coated.coat.eta) == (0.25, 1.5)
    assert isinstance(pane, Dielectric)
    assert (pane.thin, pane.eta) == (True, 1.4)
    assert isinstance(matte, Diffuse)


def test_strips_fans_strides_and_sparse_values(tmp_path: Path) -> None:
    """One square four ways: each has the same two triangles, all seen from the front."""
    maker = Maker()
    maker.camera()
    interleaved = np.concatenate([SQUARE, np.ones((4, 1))], axis=1).astype("<f4")
    view = maker.view(interleaved.tobytes(), byteStride=16)
    strided = maker.add("accessors", {"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"})
    bent = SQUARE.copy()
    bent[2] = (9, 9, 9)
    sparse = {
        "count": 1,
        "indices": {"bufferView": maker.view(np.array([2], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": maker.view(SQUARE[2:3].astype("<f4").tobytes())},
    }
    mended = maker.accessor(bent, 5126, "VEC3", sparse=sparse)
    strip = maker.accessor(SQUARE[[0, 1, 3, 2]], 5126, "VEC3")
    for position, mode, indexed in (
        (strided, 4, True),
        (mended, 4, True),
        (strip, 5, False),
        (strided, 6, False),
    ):
        primitive = {"attributes": {"POSITION": position}, "mode": mode, "material": 0}
        if indexed:
            primitive["indices"] = maker.accessor(FACES, 5123, "SCALAR")
        maker.add("meshes", {"primitives": [primitive]})
    maker.add("materials", MATTE)
    for i in range(4):
        maker.node(mesh=i)
    for shape in converted(maker, tmp_path)[0].shapes:
        mesh = shape.geometry
        assert isinstance(mesh, TriangleMesh)
        corners = mesh.vertices[mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert normals.tolist() == [[0, 0, 4], [0, 0, 4]]


def test_vertex_normals_turn_with_their_node(tmp_path: Path) -> None:
    maker = Maker()
    maker.camera()
    lean = np.broadcast_to(np.array([0.6, 0.0, 0.8]), (4, 3))
    normal = maker.accessor(lean, 5126, "VEC3")
    maker.node(mesh=maker.square(MATTE, attributes={"NORMAL": normal}), scale=[-2, 1, 1])
    found = vertex_normals(converted(maker, tmp_path)[0].shapes[0].geometry)
    assert found is not None
    np.testing.assert_allclose(
        found[0] / np.linalg.norm(found[0]), np.array([-0.3, 0, 0.8]) / np.hypot(0.3, 0.8), rtol=1e-6
    )


def test_a_scene_without_a_camera_is_seen_whole(tmp_path: Path) -> None:
    """A lamp to the left of the middle is in the left half of the image."""
    maker = Maker()
    maker.node(mesh=maker.square(lamp(1, 1, 1)), translation=[-3, 0, 0])
    maker.node(mesh=maker.square(MATTE), translation=[3, 0, 0])
    document = convert(maker.write(tmp_path / "s.gltf"), "s")
    document.head = [line.replace("1280", "16").replace("720", "9") for line in document.head]
    image = render(write(document, "s", tmp_path / "s.pbrt"), spp=4).image[..., 0]
    assert image[:, :8].max() > 0.5
    assert image[:, 8:].max() < 0.5
    assert image[:, [0, -1]].max() == image[[0, -1]].max() == 0
    assert any("no camera" in line for line in document.losses.lines())


def broken(maker: Maker, path: str, value: Any) -> Maker:
    """The file with a value of its JSON replaced."""
    *keys, last = [int(key) if key.isdigit() else key for key in path.split("/")]
    target: Any = maker.data
    for key in keys:
        target = target[key]
    target[last] = value
    return maker


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("asset/version", "1.0", "no glTF 2.0"),
        ("extensionsRequired", ["KHR_draco_mesh_compression"], "KHR_draco_mesh_compression cannot be read"),
        ("accessors/0/count", 10**9, r"accessors\[0\]: reaches beyond"),
        ("accessors/0/componentType", 1, r"accessors\[0\]: its componentType"),
        ("bufferViews/0/byteLength", 10**9, r"bufferViews\[0\]: reaches beyond"),
        ("bufferViews/0/buffer", 7, r"bufferViews\[0\]: there is no buffers\[7\]"),
        ("nodes/1/children", [1], r"nodes\[1\]: it is inside itself"),
        ("nodes/1/scale", [1, 2], r"nodes\[1\]: scale must be 3 finite numbers"),
        ("nodes/1/mesh", 5, r"nodes\[1\]: there is no meshes\[5\]"),
        ("meshes/0/primitives/0/material", 5, "there is no materials"),
        ("nodes", 3, "nodes: a list of objects"),
        ("materials/0/pbrMetallicRoughness", 3, r"materials\[\]\.pbrMetallicRoughness: an object is needed"),
        ("materials/0/extensions/KHR_materials_specular", [1], r"specular: an object is needed, not '\[1\]'"),
        ("meshes/0/primitives", None, r"meshes\[\]\.primitives: a list is needed"),
        ("scenes/0/nodes", True, r"scenes\[\]\.nodes: a list is needed"),
        ("accessors/0/componentType", "5126", "componentType: a whole number is needed"),
        ("accessors/0/type", {}, r"accessors\[\]\.type: a string is needed"),
    ],
)
def test_malformed_files_are_told_with_their_place(
    path: str, value: Any, message: str, tmp_path: Path
) -> None:
    maker = Maker()
    maker.camera()
    maker.node(mesh=maker.square(MATTE))
    with pytest.raises(PenumbraError, match=message):
        converted(broken(maker, path, value), tmp_path)
    assert not (tmp_path / "s.pbrt").exists()


def test_nothing_is_fetched_and_nothing_outside_is_read(tmp_path: Path) -> None:
    path = tmp_path / "in" / "s.gltf"
    path.parent.mkdir()
    for uri, message in (("http://localhost/b.bin", "nothing is fetched"), ("file:///etc/passwd", "fetched"),
                         ("../b.bin", "outside the folder"), ("data:;base64,%%", "no base64")):  # fmt: skip
        maker = Maker()
        maker.node(mesh=maker.square(MATTE))
        maker.write(path)
        maker.data["buffers"] = [{"byteLength": 4, "uri": uri}]
        path.write_text(json.dumps(maker.data))
        with pytest.raises(PenumbraError, match=message):
            convert(path, "s")


def test_malformed_json_is_told_with_line_and_column(tmp_path: Path) -> None:
    path = tmp_path / "s.gltf"
    path.write_text('{\n  "asset": oops\n}')
    with pytest.raises(SceneError, match=r"s.gltf:2:12: no JSON that can be read"):
        read_gltf(path, Files(tmp_path))
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 20) + struct.pack("<II", 99, 0x4E4F534A))
    with pytest.raises(PenumbraError, match="ends beyond"):
        read_gltf(path, Files(tmp_path))


def test_the_command_converts_it(penumbra: Penumbra, tmp_path: Path) -> None:
    maker = Maker()
    maker.camera()
    maker.node(mesh=maker.square(lamp(1, 2, 3)), translation=[0, 0, -3])
    path = maker.write(tmp_path / "s.glb")
    code, out, err = penumbra("convert", path, "-o", tmp_path / "out.pbrt", "--json")
    assert (code, json.loads(out)["shapes"], json.loads(out)["lost"], err) == (0, 1, [], "")
    assert penumbra("convert", path, "-D", "a=1", "-o", tmp_path / "out.pbrt")[0] == 2
    assert penumbra("convert", tmp_path / "s.obj", "-o", tmp_path / "out.pbrt")[0] == 2

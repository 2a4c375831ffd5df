"""glTF 2.0 files, .gltf and .glb: their JSON, and the numbers and images in their buffers.

The reader is our own: trimesh's keeps no lights and no cameras. Nothing is fetched: a buffer lies in the file
itself, in a data URI, or in a file inside the folder. An accessor's size is checked against its buffer before
any of it is read. Source: the specification of glTF 2.0, sections 3.6 and 4.4 [gltf2021].
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from scenes.errors import Location, PenumbraError, SceneError
from scenes.files import Files, read_bytes

Object = dict[str, Any]

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MAGIC, JSON, BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
_DATA = re.compile(r"data:[^,]*;base64,")
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


@dataclass(eq=False)
class GltfFile:
    """A glTF file that was read. data: its JSON. files: finds others. binary: the chunk of a .glb."""

    path: Path
    data: Object
    files: Files
    binary: bytes | None
    _buffers: dict[int, bytes] = field(default_factory=dict[int, bytes])

    def fail(self, where: str, message: str) -> PenumbraError:
        """An error at a place in the JSON, for the caller to raise."""
        return PenumbraError(f"{self.path}: {where}: {message}")

    def all(self, kind: str) -> list[Object]:
        """All objects of a kind, such as nodes or meshes."""
        found = self.data.get(kind, [])
        if not isinstance(found, list) or not all(isinstance(one, dict) for one in cast("list[Any]", found)):
            raise self.fail(kind, "a list of objects is needed")
        return cast("list[Object]", found)

    def one(self, kind: str, index: Any, where: str) -> Object:
        """The object of a kind by its index; PenumbraError if there is none."""
        every = self.all(kind)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(every):
            raise self.fail(where, f"there is no {kind}[{index}]")
        return every[index]

    def numbers(self, owner: Object, name: str, default: list[float], where: str) -> NDArray[np.float64]:
        """A list of finite numbers, as many as the default has."""
        values = owner.get(name, default)
        try:
            out = np.array(values, dtype=np.float64)
        except (ValueError, TypeError):
            out = np.zeros(0)
        if out.shape != (len(default),) or not np.isfinite(out).all():
            raise self.fail(where, f"{name} must be {len(default)} finite numbers, not {str(values)[:60]}")
        return out

    def number(self, owner: Object, name: str, default: float, where: str) -> float:
        """One finite number."""
        return float(self.numbers({name: [owner.get(name, default)]}, name, [0.0], where)[0])

    def accessor(self, index: Any, where: str) -> NDArray[Any]:
        """The numbers (n, width) of an accessor: float64 if they are floats or normalised, else int64."""
        found = self.one("accessors", index, where)
        where = f"accessors[{index}]"
        kind, width, count = found.get("componentType"), WIDTHS.get(found.get("type", "")), found.get("count")
        if kind not in COMPONENTS or width is None or not isinstance(count, int) or count < 1:
            raise self.fail(where, "its componentType, type or count is none that is known")
        dtype = np.dtype(COMPONENTS[kind])
        values = np.zeros((count, width), dtype) if "bufferView" not in found else self._view(
            found["bufferView"], found.get("byteOffset", 0), count, width, dtype, where
        )  # fmt: skip
        if "sparse" in found:
            values = self._sparse(found["sparse"], values, where)
        if found.get("normalized") and dtype.kind != "f":
            return np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values.astype(np.float64 if dtype.kind == "f" else np.int64)

    def _sparse(self, sparse: Object, values: NDArray[Any], where: str) -> NDArray[Any]:
        try:
            count, rows, new = sparse["count"], sparse["indices"], sparse["values"]
            dtype = np.dtype(COMPONENTS[rows["componentType"]])
            places = self._view(rows["bufferView"], rows.get("byteOffset", 0), count, 1, dtype, where)[:, 0]
            found = self._view(
                new["bufferView"], new.get("byteOffset", 0), count, values.shape[1], values.dtype, where
            )
        except (KeyError, TypeError, AttributeError):
            raise self.fail(where, "its sparse values cannot be read") from None
        if places.max(initial=0) >= len(values):
            raise self.fail(where, "a sparse value lies beyond its rows")
        out = values.copy()
        out[places] = found
        return out

    def _view(
        self, index: Any, offset: Any, count: Any, width: int, dtype: np.dtype[Any], where: str
    ) -> NDArray[Any]:
        """The numbers (count, width) of a buffer view, from `offset` bytes into it."""
        data, view = self.view(index, where)
        size = width * dtype.itemsize
        stride = view.get("byteStride", size)
        if not all(isinstance(n, int) and n >= 0 for n in (offset, count, stride)) or stride < size:
            raise self.fail(where, "its offsets are no whole numbers, or too small")
        if count and offset + stride * (count - 1) + size > len(data):
            raise self.fail(where, f"reaches beyond the {len(data)} bytes of its buffer view")
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def view(self, index: Any, where: str) -> tuple[memoryview, Object]:
        """The bytes of a buffer view, and its object."""
        view = self.one("bufferViews", index, where)
        data = self._buffer(view.get("buffer"), f"bufferViews[{index}]")
        start, size = view.get("byteOffset", 0), view.get("byteLength", -1)
        whole = isinstance(start, int) and isinstance(size, int)
        if not whole or start < 0 or size < 0 or start + size > len(data):
            raise self.fail(f"bufferViews[{index}]", f"reaches beyond the {len(data)} bytes of its buffer")
        return memoryview(data)[start : start + size], view

    def _buffer(self, index: Any, where: str) -> bytes:
        buffer = self.one("buffers", index, where)
        if index not in self._buffers:
            if "uri" in buffer:
                self._buffers[index] = self.resource(buffer["uri"], f"buffers[{index}]")
            elif index == 0 and self.binary is not None:
                self._buffers[index] = self.binary
            else:
                raise self.fail(f"buffers[{index}]", "it has no uri, and there is no binary chunk")
        return self._buffers[index]

    def resource(self, uri: Any, where: str) -> bytes:
        """The bytes that a URI names."""
        if isinstance(uri, str) and (match := _DATA.match(uri)) is not None:
            try:
                return base64.b64decode(uri[match.end() :], validate=True)
            except binascii.Error:
                raise self.fail(where, "its data URI is no base64") from None
        return read_bytes(self.find(uri, where))

    def find(self, uri: Any, where: str) -> Path:
        """The file that a URI names, inside the folder."""
        if not isinstance(uri, str) or _SCHEME.match(uri):
            raise self.fail(
                where, f"the URI {str(uri)[:60]!r} names no file beside this one: nothing is fetched"
            )
        return self.files.find(unquote(uri), None, Location(str(self.path), 1, 1))


def read_gltf(path: Path, files: Files) -> GltfFile:
    """Read a .gltf or .glb file; SceneError at the place of malformed JSON, PenumbraError for other
    damage.
    """
    content = read_bytes(path)
    text, binary = _chunks(path, content) if content[:4] == b"glTF" else (content, None)
    try:
        data: Any = json.loads(text.decode("utf-8-sig"))
    except json.JSONDecodeError as error:
        place = Location(str(path), error.lineno, error.colno)
        raise SceneError(f"no JSON that can be read: {error.msg}", place) from None
    except (UnicodeDecodeError, RecursionError) as error:
        raise PenumbraError(f"{path}: no JSON that can be read: {error}") from None
    asset: Any = cast("Object", data).get("asset") if isinstance(data, dict) else None
    version = str(cast("Object", asset).get("version", "")) if isinstance(asset, dict) else ""
    if not version.startswith("2."):
        raise PenumbraError(f"{path}: no glTF 2.0: its version is {version or 'not given'}")
    _check_kinds(path, cast("Object", data))
    return GltfFile(path, cast("Object", data), files, binary)


def _check_kinds(path: Path, data: Object) -> None:
    """Raise PenumbraError for a value of another JSON type than glTF has at its place."""
    left: list[tuple[str, Any]] = [("", data)]
    while left:
        where, value = left.pop()
        items: list[tuple[str, Any]] = []
        if isinstance(value, dict):
            items = [(f"{where}.{key}", one) for key, one in cast("Object", value).items()]
        elif isinstance(value, list):
            items = [(f"{where}[]", one) for one in cast("list[Any]", value)]
        for place, one in items:
            for ending, kind, needed in _KINDS:
                if ending.search(place) and (not isinstance(one, kind) or isinstance(one, bool)):
                    raise PenumbraError(f"{path}: {place[1:]}: {needed} is needed, not {str(one)[:40]!r}")
            if not place.endswith(".extras"):  # which hold anything
                left.append((place, one))


_KINDS: list[tuple[re.Pattern[str], type, str]] = [
    (
        re.compile(
            r"\.(extensions|pbrMetallicRoughness|attributes|sparse|spot|\w+Texture)$"
            r"|\.extensions\.\w+$|\.(primitives|lights|scenes)\[\]$|sparse\.(indices|values)$|^\.cameras\[\]\.\w+graphic$"
            r"|^\.cameras\[\]\.perspective$"
        ),
        dict,
        "an object",
    ),
    (
        re.compile(r"\.(primitives|lights|children|extensionsRequired|targets)$|^\.scenes\[\]\.nodes$"),
        list,
        "a list",
    ),
    (
        re.compile(r"\.(componentType|count|byteOffset|byteLength|byteStride|mode|texCoord)$"),
        int,
        "a whole number",
    ),
    (re.compile(r"\.(type|uri|mimeType)$"), str, "a string"),
]


def _chunks(path: Path, content: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a .glb file."""
    at, found = 12, dict[int, bytes]()
    while at + 8 <= len(content):
        size, kind = struct.unpack_from("<II", content, at)
        if at + 8 + size > len(content):
            raise PenumbraError(f"{path}: a chunk of the file ends beyond its {len(content)} bytes")
        found.setdefault(kind, content[at + 8 : at + 8 + size])
        at += 8 + size
    if JSON not in found:
        raise PenumbraError(f"{path}: no chunk of JSON in this .glb file")
    return found[JSON], found.get(BINARY)

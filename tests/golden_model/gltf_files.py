"""glTF files for tests, put together with pygltflib's classes and packed by hand: nothing of the reader is used."""

import base64
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
from pygltflib import GLTF2, Accessor, Attributes, Buffer, BufferView, Material, Mesh, Node, Primitive, Scene

TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}

FLOOR = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
LAMP = [[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]]
QUAD = [0, 1, 2, 0, 2, 3]


@dataclass
class Writer:
    """A file that grows: every method returns the number of what it adds."""

    gltf: GLTF2 = field(default_factory=lambda: GLTF2(scene=0, scenes=[Scene(nodes=[])]))
    data: bytes = b""

    def view(self, data: bytes, stride: int | None = None, align: int = 4) -> int:
        """A buffer view of its own."""
        self.data += b"\xcc" * (-len(self.data) % align)
        self.gltf.bufferViews.append(
            BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(data), byteStride=stride)
        )
        self.data += data
        return len(self.gltf.bufferViews) - 1

    def accessor(self, view: int | None, count: int, kind: str, width: int, offset: int = 0, **rest: Any) -> int:
        """`kind` as NumPy has it: "f4", "u2", ..."""
        self.gltf.accessors.append(
            Accessor(
                bufferView=view, byteOffset=offset, count=count, componentType=TYPES[kind], type=WIDTHS[width], **rest
            )
        )
        return len(self.gltf.accessors) - 1

    def array(self, values: Any, kind: str = "f4", stride: int | None = None, **rest: Any) -> int:
        """An accessor with a view of its own; `values` (count,) or (count, K) as they are in the file."""
        rows = np.asarray(values).astype(f"<{kind}")
        rows = rows.reshape(len(rows), -1)
        size = rows.shape[1] * rows.dtype.itemsize
        padded = b"".join(row.tobytes() + b"\xee" * ((stride or size) - size) for row in rows)
        return self.accessor(self.view(padded, stride), len(rows), kind, rows.shape[1], **rest)

    def mesh(self, *primitives: Primitive, name: str | None = None) -> int:
        self.gltf.meshes.append(Mesh(primitives=list(primitives), name=name))
        return len(self.gltf.meshes) - 1

    def node(self, below: int | None = None, **what: Any) -> int:
        """A node of the scene, or below another."""
        self.gltf.nodes.append(Node(**what))
        number = len(self.gltf.nodes) - 1
        (self.gltf.scenes[0].nodes if below is None else self.gltf.nodes[below].children).append(number)
        return number

    def material(self, colour: Any = None, emission: Any = (0, 0, 0), **rest: Any) -> int:
        surface = pygltflib.PbrMetallicRoughness(
            baseColorFactor=[*(colour or (1, 1, 1)), 1.0], metallicFactor=rest.pop("metallic", 0.0)
        )
        self.gltf.materials.append(Material(pbrMetallicRoughness=surface, emissiveFactor=list(emission), **rest))
        return len(self.gltf.materials) - 1

    def save(self, path: Path, buffer: str = "binary") -> Path:
        """As .glb or .gltf, its `buffer` "binary" in the file, "data" in the JSON, or "beside" it."""
        self.gltf.buffers = [Buffer(byteLength=len(self.data))]
        if buffer == "data":
            self.gltf.buffers[0].uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        elif buffer == "beside":
            (path.parent / f"{path.stem} data.bin").write_bytes(self.data)
            self.gltf.buffers[0].uri = f"{path.stem}%20data.bin"
        text = self.gltf.to_json().encode()
        if path.suffix == ".glb":
            parts = [b"JSON" + text + b" " * (-len(text) % 4)]
            if buffer == "binary":
                parts.append(b"BIN\0" + self.data + b"\0" * (-len(self.data) % 4))
            chunks = b"".join(struct.pack("<I", len(part) - 4) + part for part in parts)
            text = struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
        path.write_bytes(text)
        return path


def primitive(position: int, indices: int | None = None, material: int | None = None, **rest: Any) -> Primitive:
    """`rest` may hold further attributes, and what else a primitive has."""
    attributes = {name: rest.pop(name) for name in list(rest) if name.isupper() or "_" in name}
    return Primitive(attributes=Attributes(POSITION=position, **attributes), indices=indices, material=material, **rest)


def room(colours: tuple[Any, Any] = ((0.9, 0.1, 0.1), (0.1, 0.1, 0.9)), names: Any = (None, None)) -> Writer:
    """A floor and a lamp above it, a material each."""
    out = Writer()
    order = out.array(QUAD, "u2")
    for points, colour, emission, name, node in zip(
        (FLOOR, LAMP), colours, ((0, 0, 0), (1, 1, 1)), names, ("floor", "lamp"), strict=True
    ):
        material = out.material(colour, emission, name=name)
        out.node(mesh=out.mesh(primitive(out.array(points), order, material)), name=node)
    return out

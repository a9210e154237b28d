"""Random glTF files, written with pygltflib's classes, and what they hold, known from how they were made."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pygltflib import AccessorSparseIndices, AccessorSparseValues, Primitive, Sparse

from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO
from tests.golden_model.gltf_files import TYPES, Writer, primitive

STRENGTH = "KHR_materials_emissive_strength"
NAMES = (None, "", "Material", "Material", "lamp", "geometry_0")
TURNS = [
    (0, 0, 0, 1),
    (0, 0, 1, 0),
    (1, 0, 0, 1),
    (0, 1, 0, -1),
    (0, 0, 1, 1),
    (1, 1, 1, 1),
    (-1, 1, -1, 1),
    (1, 1, 0, 0),
]
"""Quaternions (x, y, z, w) of rotations that only exchange axes: all products with them are exact in float64."""


@dataclass
class Expected:
    """A part as the file means it; all arrays of its triangles."""

    name: str
    corners: np.ndarray
    albedo: np.ndarray
    emission: np.ndarray
    texture_uv: np.ndarray | None
    partly: bool = False
    """Whether some of its primitives have texture coordinates and others have none."""


@dataclass
class _Piece:
    """A primitive: corners and texture coordinates of its triangles, its material."""

    corners: np.ndarray
    uv: np.ndarray | None
    material: int | None


@dataclass
class RandomFile:
    """A file and its parts."""

    rng: np.random.Generator
    out: Writer = field(default_factory=Writer)
    colours: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    meshes: list[tuple[str | None, list[_Piece]]] = field(default_factory=list)
    parts: list[Expected] = field(default_factory=list)

    def chance(self, one_in: int) -> bool:
        return bool(self.rng.integers(one_in) == 0)

    def any(self, values: Any) -> Any:
        return values[self.rng.integers(len(values))]

    def make(self, folder: Path) -> Path:
        """Writes it."""
        rng = self.rng
        path = folder / f"mesh{self.any(['.glb', '.gltf'])}"
        for _ in range(rng.integers(4)):
            self._material()
        for _ in range(rng.integers(1, 4)):
            self._mesh()
        top: list[tuple[int | None, np.ndarray]] = [(None, np.eye(4))]
        for _ in range(rng.integers(1, 7)):
            self._node(top, path.stem)
        if self.chance(8):
            self.out.gltf.scenes, self.out.gltf.scene = [], None
        elif self.chance(8):
            self.out.gltf.scene = None
        self.parts = self._in_order()
        return self.out.save(
            path, self.any(["binary", "data", "beside"] if path.suffix == ".glb" else ["data", "beside"])
        )

    def _material(self) -> None:
        colour, glow = self.rng.random(3), self.rng.random(3) * self.chance(2)
        rest: dict[str, Any] = {"name": self.any(NAMES)}
        factor = 1.0
        if self.chance(3):
            factor = float(self.any([0.0, 0.5, 17.25, 1e4]))
            rest["extensions"] = {STRENGTH: {"emissiveStrength": factor}}
            self.out.gltf.extensionsUsed = [STRENGTH]
        self.out.material(colour.tolist(), glow.tolist(), **rest)
        self.colours.append((colour, glow * factor))

    def _mesh(self) -> None:
        pieces, primitives = [], []
        for _ in range(self.rng.integers(1, 4)):
            made, piece = self._primitive()
            primitives.append(made)
            pieces.append(piece)
        name = self.any([None, "mesh", "other mesh"])
        self.out.mesh(*primitives, name=name)
        self.meshes.append((name, pieces))

    def _primitive(self) -> tuple[Primitive, _Piece]:
        count = int(self.rng.integers(3, 40))
        attributes: dict[str, int] = {}
        points = self._positions(count, attributes)
        uv = self._coordinates(count, attributes) if self.chance(2) else None
        mode = int(self.rng.integers(4, 7))
        if self.chance(4):
            length = 3 * (count // 3) if mode == 4 else count
            order, indices = np.arange(count), None
            if length != count:
                mode = 6
        else:
            length = 3 * int(self.rng.integers(1, 30)) if mode == 4 else int(self.rng.integers(3, 30))
            order = self.rng.integers(count, size=length)
            indices = self.out.array(order, self.any(["u1", "u2", "u4"]))
        material = int(self.rng.integers(len(self.colours))) if self.colours and not self.chance(4) else None
        made = primitive(attributes.pop("POSITION"), indices, material, mode=mode, **attributes)
        triangles = np.array(_triangles(mode, order.tolist()), dtype=int).reshape(-1, 3)
        return made, _Piece(points[triangles], None if uv is None else uv[triangles], material)

    def _positions(self, count: int, attributes: dict[str, int]) -> np.ndarray:
        """Numbers of few bits, or integers that are to be divided."""
        kind = self.any(["f4", "f4", "i1", "u1", "i2", "u2"])
        if kind == "f4":
            raw = self.rng.integers(-(2**20), 2**20, (count, 3)) / 2.0 ** self.rng.integers(0, 24)
        else:
            raw = self.rng.integers(np.iinfo(kind).min, np.iinfo(kind).max, (count, 3), endpoint=True).astype(float)
            self.out.gltf.extensionsRequired = ["KHR_mesh_quantization"]
        normalized = kind != "f4" and self.chance(2)
        size = np.dtype(kind).itemsize
        stride = self.any([None, 4 * -(-3 * size // 4), 4 * -(-3 * size // 4) + 8])
        sparse = None
        shown = raw.copy()
        if self.chance(4):
            some = np.sort(self.rng.permutation(count)[: self.rng.integers(1, count)])
            shown[some] = self.rng.permutation(shown[some])
            index = self.any(["u1", "u2", "u4"])
            sparse = Sparse(
                count=len(some),
                indices=AccessorSparseIndices(
                    bufferView=self.out.view(some.astype(f"<{index}").tobytes()), componentType=TYPES[index]
                ),
                values=AccessorSparseValues(bufferView=self.out.view(shown[some].astype(f"<{kind}").tobytes())),
            )
        attributes["POSITION"] = self.out.array(raw, kind, stride, normalized=normalized, sparse=sparse)
        return np.maximum(shown / np.iinfo(kind).max, -1.0) if normalized else shown

    def _coordinates(self, count: int, attributes: dict[str, int]) -> np.ndarray:
        """As they are shown, v upwards."""
        kind = self.any(["f4", "u1", "u2"])
        raw = (
            self.rng.random((count, 2)).astype(np.float32)
            if kind == "f4"
            else self.rng.integers(np.iinfo(kind).max, size=(count, 2), endpoint=True)
        )
        attributes["TEXCOORD_0"] = self.out.array(raw, kind, None if kind == "f4" else 4, normalized=kind != "f4")
        uv = raw.astype(np.float64) if kind == "f4" else raw / np.iinfo(kind).max
        return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype(np.float32)

    def _node(self, above: list[tuple[int | None, np.ndarray]], stem: str) -> None:
        parent, matrix = self.any(above)
        what: dict[str, Any] = {"name": self.any([None, "", "node", "geometry_0", "chair"])}
        local = np.eye(4)
        shift, scale = (
            self.rng.integers(-64, 64, 3) / 4.0,
            self.any([1, -1, 2, 0.5]) * 2.0 ** self.rng.integers(-2, 3, 3),
        )
        if self.chance(2):
            axes, signs = self.rng.permutation(3), self.rng.choice([-1, 1], 3)
            local[:3, :3] = np.eye(3)[axes] * signs * scale
            local[:3, 3] = shift
            what["matrix"] = local.T.reshape(-1).tolist()
        else:
            if self.chance(2):
                quaternion = self.any(TURNS)
                local[:3, :3] = _rotation(*quaternion)
                what["rotation"] = [float(x) for x in quaternion]
            if self.chance(2):
                local[:3, :3] = local[:3, :3] * scale
                what["scale"] = scale.tolist()
            if self.chance(2):
                local[:3, 3] = shift
                what["translation"] = shift.tolist()
        mesh = None if self.chance(4) else int(self.rng.integers(len(self.meshes)))
        number = self.out.node(below=parent, mesh=mesh, **what)
        world = matrix @ local
        above.append((number, world))
        if mesh is not None:
            self._placed[number] = self._expected(what["name"], mesh, world, stem)

    def __post_init__(self) -> None:
        self._placed: dict[int, Expected] = {}

    def _expected(self, name: str | None, mesh: int, world: np.ndarray, stem: str) -> Expected:
        mesh_name, pieces = self.meshes[mesh]
        corners = np.concatenate([piece.corners for piece in pieces])
        corners = (corners.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]).reshape(corners.shape).astype(np.float32)
        grey = (np.array(DEFAULT_ALBEDO), np.zeros(3))
        colours = [grey if piece.material is None else self.colours[piece.material] for piece in pieces]
        counts = [len(piece.corners) for piece in pieces]
        uv = None
        if all(piece.uv is not None for piece in pieces):
            uv = np.concatenate([piece.uv for piece in pieces if piece.uv is not None])
        if np.linalg.det(world[:3, :3]) < 0:
            corners = corners[:, ::-1]
            uv = None if uv is None else uv[:, ::-1]
        shown = name or mesh_name or stem
        return Expected(
            name=stem if shown == "geometry_0" else shown,
            corners=corners,
            albedo=np.repeat([albedo for albedo, _ in colours], counts, axis=0).astype(np.float32),
            emission=np.repeat([emission for _, emission in colours], counts, axis=0).astype(np.float32),
            texture_uv=uv,
            partly=uv is None and any(piece.uv is not None for piece in pieces),
        )

    def _in_order(self) -> list[Expected]:
        """From the roots down, a node before those below it, which come before its next neighbour."""
        gltf = self.out.gltf
        below = {child for node in gltf.nodes for child in node.children}
        out: list[Expected] = []

        def visit(number: int) -> None:
            if number in self._placed:
                out.append(self._placed[number])
            for child in gltf.nodes[number].children:
                visit(child)

        for number in range(len(gltf.nodes)):
            if number not in below:
                visit(number)
        return out


def _triangles(mode: int, order: list[int]) -> list[list[int]]:
    if mode == 4:
        return [order[k : k + 3] for k in range(0, len(order), 3)]
    rows = []
    for k in range(len(order) - 2):
        a, b, c = (order[0], order[k + 1], order[k + 2]) if mode == 6 else order[k : k + 3]
        if mode == 5 and k % 2:
            b, c = c, b
        if len({a, b, c}) == 3:
            rows.append([a, b, c])
    return rows


def _rotation(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Of a quaternion, by what it does to the axes: v + 2 w (q x v) + 2 q x (q x v), over its square."""
    axis, square = np.array([x, y, z]), x * x + y * y + z * z + w * w
    columns = [square * v + 2 * w * np.cross(axis, v) + 2 * np.cross(axis, np.cross(axis, v)) for v in np.eye(3)]
    # (For a unit quaternion; of any other v is scaled by its square, too.)
    return np.stack(columns, axis=1) / square

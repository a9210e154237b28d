"""glTF 2.0 files, .glb and .gltf, to parts of a scene: a part for each node with a mesh, materials by their numbers.

pygltflib gives the structure of the file (`gltf_document`); what it names is held against what is there.
An extension that the file requires is refused by its name unless it is one of EXTENSIONS; all else that is not read is
said to be left out.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.affine import determinant, product, rotation_matrix, transformed
from lightloom.golden_model.scene.files.gltf.accessors import FLOAT, Accessors
from lightloom.golden_model.scene.files.gltf.document import damaged, gltf_document, not_understood
from lightloom.golden_model.scene.files.gltf.materials import STRENGTH, material_colours
from lightloom.golden_model.scene.files.remarks import Remarks
from lightloom.golden_model.scene.mesh import turned_normals
from lightloom.golden_model.scene.parts import Part

QUANTIZED = "KHR_mesh_quantization"
EXTENSIONS = frozenset((QUANTIZED, STRENGTH))
"""Extensions that are read."""

TRIANGLES, STRIP, FAN = 4, 5, 6
MODES = ("points", "lines", "lines", "lines", "triangles", "triangle strips", "triangle fans")
"""What primitives are made of, by their mode."""

ATTRIBUTES = frozenset(("POSITION", "NORMAL", "TEXCOORD_0"))
"""Attributes of vertices that are read."""

UNSEEN = ("TANGENT", "JOINTS_", "WEIGHTS_", "_")
"""How others begin that are not seen, or not without what is said, textures of normals and skins; `_`: of a program."""

MOST_TRIANGLES = 1 << 25
"""Of all nodes together, which may show one mesh many times."""

INVENTED = frozenset(("geometry_0", "world"))
"""Names that writers give to a node that has none; the file's name says more."""


def load_gltf(path: Path) -> list[Part]:
    """The parts of a file. Raises InputError where it is damaged or needs what is not read."""
    remarks = Remarks(path)
    document = gltf_document(path, remarks)
    try:
        for extension in document.extensionsRequired or []:
            if extension not in EXTENSIONS:
                raise not_understood(path, str(extension))
        parts = list(_Reader(path, document, remarks).parts())
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        # A number, a list or a table where the format has another of them.
        raise damaged(path, error) from error
    remarks.say()
    return parts


class _Reader:
    """Makes parts of a document."""

    def __init__(self, path: Path, document: Any, remarks: Remarks) -> None:
        self.path = path
        self.document = document
        self.remarks = remarks
        self.read = Accessors(path, document)
        self.triangles = 0

    def parts(self) -> Iterator[Part]:
        """In the order of the file's nodes, from its scene's roots down."""
        for name in ("animations", "cameras", "skins"):
            if getattr(self.document, name):
                self.remarks.leave_out(name)
        self._leave_out_extensions([*(self.document.extensionsUsed or []), *(self.document.extensions or {})])
        for node, matrix, shift in self._placed_nodes():
            self._leave_out_extensions(node.extensions or {})
            if node.mesh is not None:
                mesh = self.read.item(self.document.meshes, node.mesh, "mesh")
                pieces = [piece for one in mesh.primitives or [] if (piece := self._primitive(one)) is not None]
                if pieces:
                    name = str(node.name or mesh.name or "")
                    yield self._part(self.path.stem if name in INVENTED or not name else name, pieces, matrix, shift)

    def _leave_out_extensions(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in EXTENSIONS:
                self.remarks.leave_out(str(name))

    def _placed_nodes(self) -> Iterator[tuple[Any, np.ndarray, np.ndarray]]:
        """Every node of the scene with what takes its points to the world."""
        pending = [(number, np.eye(3), np.zeros(3)) for number in reversed(self._roots())]
        seen: set[int] = set()
        while pending:
            number, above, origin = pending.pop()
            node = self.read.item(self.document.nodes, number, "node")
            if number in seen:
                raise self.read.error(f"node {number} is in two places, or below itself")
            seen.add(number)
            matrix, shift = self._local(number, node)
            matrix, shift = product(above, matrix), transformed(shift, above, origin)
            yield node, matrix, shift
            pending += [(child, matrix, shift) for child in reversed(node.children or [])]

    def _roots(self) -> list[int]:
        scenes = self.document.scenes or []
        if not scenes:
            below = {child for node in self.document.nodes or [] for child in node.children or []}
            return [number for number in range(len(self.document.nodes or [])) if number not in below]
        if len(scenes) > 1:
            self.remarks.leave_out(f"{len(scenes) - 1} of {len(scenes)} scenes")
        return self.read.item(scenes, self.document.scene or 0, "scene").nodes or []

    def _local(self, number: int, node: Any) -> tuple[np.ndarray, np.ndarray]:
        """Matrix and shift of a node against the one above."""
        if node.matrix is not None:
            for name in ("translation", "rotation", "scale"):
                if getattr(node, name) is not None:
                    raise self.read.error(f"node {number} has a matrix and a {name}; the format has one of them")
            values = self.read.finite(node.matrix, 16, f"the matrix of node {number}").reshape(4, 4).T
            if np.abs(values[3] - [0, 0, 0, 1]).max() > 1e-6:
                raise self.read.error(f"the matrix of node {number} is not affine")
            return values[:3, :3], values[:3, 3]
        x, y, z, w = self.read.finite(node.rotation, 4, f"the rotation of node {number}", (0, 0, 0, 1)).tolist()
        if not 0 < x * x + y * y + z * z + w * w < np.inf:
            raise self.read.error(f"the rotation of node {number} is {node.rotation}")
        scale = self.read.finite(node.scale, 3, f"the scale of node {number}", (1, 1, 1))
        shift = self.read.finite(node.translation, 3, f"the translation of node {number}", (0, 0, 0))
        return rotation_matrix(w, x, y, z) * scale, shift

    def _primitive(self, primitive: Any) -> "_Piece | None":
        """The triangles of a primitive; None where it has none."""
        if primitive.mode not in range(len(MODES)):
            raise self.read.error(f"a primitive has the mode {primitive.mode}")
        given = vars(primitive.attributes) if primitive.attributes else {}
        attributes = {name: value for name, value in given.items() if value is not None}
        if primitive.mode < TRIANGLES:
            self.remarks.leave_out(MODES[primitive.mode])
            return None
        if "POSITION" not in attributes:
            self.remarks.leave_out("primitives without POSITION")
            return None
        for name in attributes:
            if name not in ATTRIBUTES and not name.startswith(UNSEEN):
                self.remarks.leave_out(name)
        if primitive.targets:
            self.remarks.leave_out("morph targets")
        for extension in primitive.extensions or {}:
            accessor = self.read.item(self.document.accessors, attributes["POSITION"], "accessor")
            if accessor.bufferView is None and accessor.sparse is None:
                raise not_understood(self.path, str(extension))
        self._leave_out_extensions(primitive.extensions or {})
        points = self._positions(attributes["POSITION"])
        order = np.arange(len(points)) if primitive.indices is None else self.read.indices(primitive.indices)
        faces = self._faces(order, primitive.mode)
        outside = (faces >= len(points)).any(axis=1)
        if outside.any():
            raise InputError(
                f"{self.path}: {int(outside.sum())} triangles name a vertex that does not exist (first: triangle "
                f"{int(np.argmax(outside))}); the primitive has {len(points)} vertices"
            )
        self.triangles += len(faces)
        if self.triangles > MOST_TRIANGLES:
            raise InputError(f"{self.path}: more than {MOST_TRIANGLES} triangles in all nodes; make it smaller")
        return _Piece(
            corners=points[faces],
            normals=self._attribute(attributes, "NORMAL", "VEC3", len(points), faces),
            texture_uv=self._attribute(attributes, "TEXCOORD_0", "VEC2", len(points), faces),
            material=primitive.material,
        )

    def _positions(self, accessor: int) -> np.ndarray:
        """Points (count, 3) float64; whole numbers only where the file says that it has such ones."""
        points = self.read.numbers(accessor, "VEC3")
        whole = self.document.accessors[accessor].componentType != FLOAT
        named = [*(self.document.extensionsUsed or []), *(self.document.extensionsRequired or [])]
        if whole and QUANTIZED not in named:
            raise self.read.error(f"POSITION has whole numbers, without `{QUANTIZED}`")
        return points

    def _faces(self, order: np.ndarray, mode: int) -> np.ndarray:
        """Vertices in their order to triangles (F, 3); the first vertex of each is the first of the file."""
        if mode == TRIANGLES:
            if len(order) % 3:
                raise self.read.error(f"{len(order)} indices are not three for each triangle")
            return order.reshape(-1, 3)
        k = np.arange(max(len(order) - 2, 0))
        if mode == STRIP:
            faces = order[np.stack([k, k + 1 + k % 2, k + 2 - k % 2], axis=1)]
        else:
            faces = order[np.stack([0 * k, k + 1, k + 2], axis=1)]
        # Strips go on elsewhere by triangles that name a vertex twice: those are no triangles that someone meant.
        meant = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        return faces[meant]

    def _attribute(
        self, attributes: dict[str, Any], name: str, width: str, count: int, faces: np.ndarray
    ) -> np.ndarray | None:
        """At the corners of the triangles, (F, 3, K) float64; None where there is none, or not for every vertex."""
        if name not in attributes:
            return None
        found = self.read.numbers(attributes[name], width)
        if len(found) != count:
            raise self.read.error(f"a primitive has {count} positions and {len(found)} of {name}")
        if not np.isfinite(found).all():
            self.remarks.leave_out_some(name)
            return None
        return found[faces]

    def _part(self, name: str, pieces: "list[_Piece]", matrix: np.ndarray, shift: np.ndarray) -> Part:
        corners = transformed(np.concatenate([piece.corners for piece in pieces]), matrix, shift)
        mirrored = determinant(matrix) < 0  # turned over, so that the front stays in front
        turn = np.array([2, 1, 0] if mirrored else [0, 1, 2])
        used = list(dict.fromkeys(piece.material for piece in pieces))
        colours = [material_colours(self.read, self.document, self.remarks, number) for number in used]
        normals = self._joined("NORMAL", [piece.normals for piece in pieces])
        uv = self._joined("TEXCOORD_0", [piece.texture_uv for piece in pieces])
        if normals is not None:
            normals = turned_normals(normals[:, turn], matrix, mirrored)
            if normals is None:
                self.remarks.leave_out_some("NORMAL")
        with np.errstate(over="ignore"):
            rounded = corners[:, turn].astype(np.float32)
        return Part(
            name=name,
            corners=rounded,
            normals=normals,
            albedo=np.array([albedo for albedo, _ in colours], dtype=np.float32),
            emission=np.array([emission for _, emission in colours], dtype=np.float32),
            material=np.repeat(
                [used.index(piece.material) for piece in pieces], [len(piece.corners) for piece in pieces]
            ).astype(np.int32),
            # v runs upwards here, downwards in the file.
            texture_uv=None if uv is None else (uv[:, turn] * [1, -1] + [0, 1]).astype(np.float32),
        )

    def _joined(self, name: str, pieces: list[np.ndarray | None]) -> np.ndarray | None:
        """An attribute of all pieces in one array; None where one has none."""
        there = [piece for piece in pieces if piece is not None]
        if len(there) == len(pieces):
            return np.concatenate(there)
        if there:
            self.remarks.leave_out_some(name)
        return None


@dataclass(frozen=True)
class _Piece:
    """The triangles of a primitive: corners, normals and texture coordinates (F, 3, K) float64, and their material."""

    corners: np.ndarray
    normals: np.ndarray | None
    texture_uv: np.ndarray | None
    material: int | None

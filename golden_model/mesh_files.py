"""Mesh files to parts of a scene: OBJ by our own strict reader, PLY and GLB by trimesh."""

import json
import logging
import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

from golden_model.errors import InputError
from golden_model.floats import quiet
from golden_model.obj_file import load_obj
from golden_model.scene import DEFAULT_ALBEDO, Part

Material = tuple[tuple[float, ...], tuple[float, ...]]
"""Albedo and emission."""

DEFAULT: Material = (DEFAULT_ALBEDO, (0.0, 0.0, 0.0))


def load_mesh(path: Path) -> list[Part]:
    """The objects of a mesh file. Raises InputError where the file is missing, damaged or holds no triangles."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    loader = _LOADERS.get(path.suffix.lower())
    if loader is None:
        raise InputError(f"{path}: unknown kind of mesh file; known are {', '.join(MESH_SUFFIXES)}")
    parts = loader(path)
    if not parts:
        raise InputError(f"{path}: no triangles; a mesh needs at least one")
    return parts


def _load_with_trimesh(path: Path) -> list[Part]:
    import trimesh  # slow to import, and only these formats need it

    # trimesh reports what it makes of a damaged file through its log; here it becomes one line.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    data = path.read_bytes()
    kind = path.suffix.lower()[1:]
    try:
        materials = _glb_materials(data) if kind == "glb" else {}
        with np.errstate(all="ignore"), trimesh.util.wrap_as_stream(data) as stream:
            scene = trimesh.load_scene(stream, file_type=kind, process=False)
        parts = []
        for node in scene.graph.nodes_geometry:
            transform, name = scene.graph[node]
            mesh = scene.geometry[name]
            if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
                continue
            parts.append(_part(path, str(node), mesh, np.asarray(transform, dtype=np.float64), materials))
            if kind == "ply" and len(mesh.faces) < _ply_faces(data):
                raise ValueError(f"it holds {len(mesh.faces)} of {_ply_faces(data)} faces")
    except InputError:
        raise
    except Exception as error:
        # Whatever trimesh meets in a damaged file: KeyError, struct.error, IndexError, ...
        reason = " ".join(str(error).split())[:100] or "no reason given"
        raise InputError(f"{path}: cannot be read as {kind.upper()}, damaged or cut off ({reason})") from error
    return parts


def _part(path: Path, name: str, mesh: Any, transform: np.ndarray, materials: dict[str, Material]) -> Part:
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    outside = ((faces < 0) | (faces >= len(vertices))).any(axis=1)
    if outside.any():
        raise InputError(
            f"{path}: {int(outside.sum())} triangles name a vertex that does not exist (first: triangle "
            f"{int(np.argmax(outside))}); the mesh has {len(vertices)} vertices"
        )
    moved = transformed(vertices, transform[:3, :3], transform[:3, 3])
    corners = moved[faces]
    coordinates = _texture_coordinates(mesh, faces)
    if determinant(transform[:3, :3]) < 0:
        corners = corners[:, ::-1]  # a mirror image: keeps the front in front
        coordinates = None if coordinates is None else coordinates[:, ::-1]
    material = getattr(mesh.visual, "material", None)
    albedo, emission = materials.get(str(getattr(material, "name", "")), DEFAULT)
    with np.errstate(over="ignore"):
        corners = corners.astype(np.float32)
    return Part(
        name=path.stem if name in ("geometry_0", "world") else name,
        corners=corners,
        albedo=np.array([albedo], dtype=np.float32),
        emission=np.array([emission], dtype=np.float32),
        material=np.zeros(len(faces), dtype=np.int32),
        texture_uv=coordinates,
    )


def _texture_coordinates(mesh: Any, faces: np.ndarray) -> np.ndarray | None:
    """At the corners, (F, 3, 2) float32, v upwards; None where the mesh has none that can be used."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or np.shape(uv) != (len(mesh.vertices), 2) or not np.isfinite(uv).all():
        return None
    return np.asarray(uv, dtype=np.float64)[faces].astype(np.float32)


@quiet
def transformed(points: np.ndarray, matrix: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(..., 3) float64 points by a 3x3 matrix and a translation, in ordered multiplies and adds."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack(
        [((row[0] * x + row[1] * y) + row[2] * z) + s for row, s in zip(matrix, shift, strict=True)], axis=-1
    )


@quiet
def determinant(m: np.ndarray) -> float:
    """Of a 3x3 matrix; of one that is too large perhaps NaN, but its vertices will be refused."""
    return float(
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )


def _glb_materials(data: bytes) -> dict[str, Material]:
    """Albedo and emission by name, from the file's own JSON: trimesh rounds colours to 8 bits."""
    magic, _, _, length, kind = struct.unpack_from("<4sIII4s", data)
    if magic != b"glTF" or kind != b"JSON" or 20 + length > len(data):
        raise ValueError("not a binary glTF 2 file")
    out: dict[str, Material] = {}
    for number, material in enumerate(json.loads(data[20 : 20 + length]).get("materials", [])):
        base = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))
        glow = material.get("emissiveFactor", (0, 0, 0))
        strength = (
            material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        )
        out[material.get("name", f"material_{number}")] = tuple(base[:3]), tuple(strength * x for x in glow)
    return out


def _ply_faces(data: bytes) -> int:
    """The number of faces that the header announces: trimesh takes an ASCII file that ends early for a smaller one."""
    found = re.search(rb"^element face (\d+)\s*$", data[:8192], flags=re.MULTILINE)
    return int(found[1]) if found else 0


_LOADERS = {".obj": load_obj, ".ply": _load_with_trimesh, ".glb": _load_with_trimesh}
MESH_SUFFIXES = tuple(_LOADERS)

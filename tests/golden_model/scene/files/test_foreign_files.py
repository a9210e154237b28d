"""Random mesh files by writers that nobody here wrote, pygltflib and trimesh, read back equal in all bits.

What is expected comes from how a file was made, never from a reader.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial, SimpleMaterial

from lightloom.golden_model.scene.files.mesh_files import load_mesh
from lightloom.golden_model.scene.parts import DEFAULT_ALBEDO, Part
from tests.golden_model.random_gltf import Expected, RandomFile

SEED = 13_000_000
FILES = 30
"""Of each of the groups below."""

GREY = np.array(DEFAULT_ALBEDO, dtype=np.float32)


def compare(path: Path, expected: list[Expected]) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        parts: list[Part] = load_mesh(path)
    partly = any(part.partly for part in expected)
    left_out = ["left out: TEXCOORD_0 of objects in which one is missing or cannot be used"] if partly else []
    assert [str(warning.message).removeprefix(f"{path}: ") for warning in said] == left_out
    expected = [part for part in expected if len(part.corners)]
    assert [part.name for part in parts] == [part.name for part in expected]
    for part, known in zip(parts, expected, strict=True):
        assert part.corners.dtype == np.float32
        # + 0: of a zero the sign is left open.
        assert (part.corners + 0).tobytes() == (known.corners.astype(np.float32) + 0).tobytes()
        assert part.albedo[part.material].tobytes() == known.albedo.tobytes()
        assert part.emission[part.material].tobytes() == known.emission.tobytes()
        if known.texture_uv is None:
            assert part.texture_uv is None
        else:
            assert part.texture_uv is not None
            assert part.texture_uv.tobytes() == known.texture_uv.tobytes()


def check(seed: int, path: Path, expected: list[Expected]) -> None:
    try:
        compare(path, expected)
    except BaseException:
        print(f"seed {seed}, {path}: {path.read_bytes()!r}")
        raise


@pytest.mark.parametrize("group", range(6))
def test_gltf_by_pygltflib(tmp_path: Path, group: int) -> None:
    """Trees of nodes, materials of one name, all modes; quantized, sparse, strided accessors; all kinds of buffers."""
    for seed in range(SEED + FILES * group, SEED + FILES * (group + 1)):
        made = RandomFile(np.random.default_rng(seed))
        path = made.make(tmp_path)
        if any(len(part.corners) for part in made.parts):
            check(seed, path, made.parts)


def soup(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Vertices whose coordinates have few bits, and faces."""
    count = int(rng.integers(3, 60))
    faces = np.array([rng.permutation(count)[:3] for _ in range(rng.integers(1, 80))])
    return rng.integers(-2000, 2000, (count, 3)) / 256.0, faces


@pytest.mark.parametrize("group", range(2))
def test_glb_by_trimesh(tmp_path: Path, group: int) -> None:
    """Placed by any affine maps: rounded once, from ordered float64 products and sums."""
    for seed in range(SEED + 1000 + FILES * group, SEED + 1000 + FILES * (group + 1)):
        rng = np.random.default_rng(seed)
        scene = trimesh.Scene()
        expected = []
        for number in range(rng.integers(1, 5)):
            points, faces = soup(rng)
            colour, glow = rng.integers(0, 5, 3) / 4, rng.integers(0, 5, 3) / 4
            uv = rng.random((len(points), 2)).astype(np.float32) if rng.integers(2) else None
            material = PBRMaterial(
                name=f"paint {rng.integers(2)}", baseColorFactor=[*colour, 1.0], emissiveFactor=glow, metallicFactor=0.0
            )
            mesh = trimesh.Trimesh(points, faces, process=False)
            mesh.visual = TextureVisuals(uv=uv, material=material)
            place = np.eye(4)
            place[:3] = rng.normal(size=(3, 4)) * 10.0 ** rng.integers(-2, 3)
            scene.add_geometry(mesh, node_name=f"node {number}", transform=place)
            x, y, z = (points.astype(np.float32).astype(np.float64)[faces][..., k] for k in range(3))
            corners = np.stack([((row[0] * x + row[1] * y) + row[2] * z) + row[3] for row in place[:3]], axis=-1)
            turn = slice(None, None, -1 if np.linalg.det(place[:3, :3]) < 0 else 1)
            flipped = None if uv is None else np.stack([uv[:, 0], _twice_flipped(uv[:, 1])], axis=1)
            expected.append(
                Expected(
                    name=f"node {number}",
                    corners=corners[:, turn],
                    albedo=np.repeat([_eight_bits(colour)], len(faces), axis=0),
                    emission=np.repeat([glow.astype(np.float32)], len(faces), axis=0),
                    texture_uv=None if flipped is None else flipped[faces][:, turn],
                )
            )
        path = tmp_path / "mesh.glb"
        data: Any = scene.export(file_type="glb")
        path.write_bytes(data)
        check(seed, path, expected)


def _eight_bits(colour: np.ndarray) -> np.ndarray:
    """What trimesh makes of a colour."""
    return (np.round(colour * 255) / 255).astype(np.float32)


def _twice_flipped(v: np.ndarray) -> np.ndarray:
    """v as trimesh writes it, downwards and rounded, upwards again."""
    return np.float32(1) - (np.float32(1) - v)


@pytest.mark.parametrize("group", range(2))
def test_obj_by_trimesh(tmp_path: Path, group: int) -> None:
    """Several objects in a file, each with its material."""
    for seed in range(SEED + 2000 + FILES * group, SEED + 2000 + FILES * (group + 1)):
        rng = np.random.default_rng(seed)
        scene = trimesh.Scene()
        expected = []
        painted = bool(rng.integers(3))
        for number in range(rng.integers(1, 5)):
            points, faces = soup(rng)
            mesh = trimesh.Trimesh(points, faces, process=False)
            albedo, uv = GREY, None
            if painted:
                colour = rng.integers(0, 256, 3)
                uv = rng.integers(0, 256, (len(points), 2)) / 256
                material = SimpleMaterial(
                    name=f"paint#{number}", diffuse=[*colour, 255], specular=[0, 0, 0, 255], ambient=[0, 0, 0, 255]
                )
                mesh.visual = TextureVisuals(uv=uv, material=material)
                albedo = np.array([float(f"{c / 255:.8f}") for c in colour]).astype(np.float32)
            scene.add_geometry(mesh, geom_name=f"thing {number}")
            expected.append(
                Expected(
                    name=f"thing {number}",
                    corners=points[faces],
                    albedo=np.repeat([albedo], len(faces), axis=0),
                    emission=np.zeros((len(faces), 3), dtype=np.float32),
                    texture_uv=None if uv is None else uv[faces].astype(np.float32),
                )
            )
        text, files = trimesh.exchange.obj.export_obj(scene, return_texture=True, mtl_name="paint.mtl")
        for name, content in files.items():
            (tmp_path / name).write_bytes(content)
        path = tmp_path / "mesh.obj"
        path.write_text(text)
        check(seed, path, expected)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_by_trimesh(tmp_path: Path, encoding: str) -> None:
    for seed in range(SEED + 3000, SEED + 3000 + FILES):
        points, faces = soup(np.random.default_rng(seed))
        data: Any = trimesh.Trimesh(points, faces, process=False).export(file_type="ply", encoding=encoding)
        path = tmp_path / "mesh.ply"
        path.write_bytes(data)
        grey = np.repeat([GREY], len(faces), axis=0)
        check(seed, path, [Expected("mesh", points[faces], grey, np.zeros_like(grey), None)])

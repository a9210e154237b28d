"""glTF files that contradict the format: one line each, and nothing read of them."""

import struct
from pathlib import Path

import pytest

from lightloom.golden_model.scene.files.gltf.file import load_gltf
from tests.golden_model.gltf_files import FLOOR, QUAD, Writer, primitive, room
from tests.golden_model.scene.files.gltf.test_file import refusal


@pytest.mark.parametrize("field", ["scale", "translation", "rotation"])
def test_places_that_are_infinite(tmp_path: Path, field: str) -> None:
    out = room()
    setattr(out.gltf.nodes[0], field, [float("inf"), 1, 1, 1][: 4 if field == "rotation" else 3])
    assert f"the {field} of node 0 is [inf, 1.0, 1.0" in refusal(out.save(tmp_path / "room.glb"))


def test_extensions_that_are_no_list(tmp_path: Path) -> None:
    out = room()
    out.gltf.extensionsRequired = "KHR_draco"
    assert "`extensionsRequired` is 'KHR_draco', not a list" in refusal(out.save(tmp_path / "room.glb"))


@pytest.mark.parametrize("said", [False, True])
def test_whole_numbers_as_positions_need_their_extension(tmp_path: Path, said: bool) -> None:
    out = Writer()
    points = out.array([[1 + x, 1 + y, 1 + z] for x, y, z in FLOOR], "u2", stride=8)
    out.node(mesh=out.mesh(primitive(points, out.array(QUAD, "u1"))))
    out.gltf.extensionsUsed = ["KHR_mesh_quantization"] if said else []
    file = out.save(tmp_path / "floor.glb")
    if not said:
        assert "POSITION has whole numbers, without `KHR_mesh_quantization`" in refusal(file)
    else:
        (part,) = load_gltf(file)
        assert len(part.corners) == 2


def test_two_binary_parts(tmp_path: Path) -> None:
    file = room().save(tmp_path / "room.glb")
    data = file.read_bytes() + struct.pack("<I4s4x", 4, b"BIN\0")
    file.write_bytes(data[:8] + struct.pack("<I", len(data)) + data[12:])
    assert "it has two binary parts" in refusal(file)

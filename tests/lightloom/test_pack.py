"""`lightloom pack`: a file that the golden model takes, or one line that says why not."""

import json
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tracing.wide_bvh.encode import tree_triangles
from lightloom.golden_model.tracing.wide_bvh.memory_image import load_tree

from .conftest import Run, files_below


@pytest.mark.parametrize("width", [4, 8])
def test_pack(cli: Run, tmp_path: Path, width: int) -> None:
    out = tmp_path / "folder" / "scene.bin"
    done = cli("pack", "cornell-box", "--width", width, "--out", out, "--json")
    assert done.code == 0, done
    told = json.loads(done.out)
    tree = load_tree(out)
    triangles = load_scene("cornell-box").triangles
    primitive, held, masks = tree_triangles(tree)
    order = np.argsort(primitive)
    assert held[order].tobytes() == triangles.tobytes()
    assert (masks == 0xFF).all()
    assert told["triangles"] == len(triangles)
    assert told["bytes"] == out.stat().st_size == 64 * (len(tree.blocks) + 2)
    assert told["width"] == tree.header["width"] == width
    assert told["nodes"] + told["triangle_blocks"] + 1 == tree.header["blocks"]
    assert told["levels"] == tree.header["levels"]
    assert told["sah_cost"] == pytest.approx(tree.sah_cost)
    assert files_below(tmp_path) == {"folder", "folder/scene.bin"}


def test_the_table_says_the_same(cli: Run, tmp_path: Path) -> None:
    done = cli("pack", "cornell-box", "--out", tmp_path / "scene.bin")
    assert done.code == 0
    for word in ("Packed", "triangles", "levels", "sah cost", "32"):
        assert word in done.out


def test_the_same_scene_gives_the_same_bytes(cli: Run, room: Path, tmp_path: Path) -> None:
    for name in ("one.bin", "two.bin"):
        assert cli("pack", room, "--out", tmp_path / name).code == 0
    assert (tmp_path / "one.bin").read_bytes() == (tmp_path / "two.bin").read_bytes()


def test_bad_input(cli: Run, tmp_path: Path) -> None:
    out = tmp_path / "folder" / "scene.bin"
    cli("pack", "cornell-box", "--width", 5, "--out", out).refused("--width", "5", "4 or 8")
    cli("pack", "cornel-box", "--out", out).refused("cornell-box")
    cli("pack", tmp_path / "none.obj", "--out", out).refused("none.obj", "no such file")
    cli("pack", "cornell-box").refused("--out")
    (tmp_path / "file").touch()
    cli("pack", "cornell-box", "--out", tmp_path / "file" / "scene.bin").refused("cannot be written")
    assert files_below(tmp_path) == {"file"}

"""Layouts of the suite: scenes that load, the same for the same seed, and frozen."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.layouts.catalogue import BUDGETS, LAYOUTS, SEEDS, write_layout
from lightloom.golden_model.stimuli.layouts.rooms import vase
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID

FROZEN = "78071d82e5d2201016b61ff1fce9606d2daffab68f1ad639accc5d85e6e977e1"
"""SHA-256 of all files of all layouts and seeds, one behind another: figures of two builds are of the same scenes."""


def test_the_suite_is_frozen(tmp_path: Path) -> None:
    for name in LAYOUTS:
        for seed in SEEDS:
            write_layout(name, seed, tmp_path)
    together = b"".join(path.name.encode() + path.read_bytes() for path in sorted(tmp_path.iterdir()))
    assert hashlib.sha256(together).hexdigest() == FROZEN
    assert len(LAYOUTS) >= 16
    assert min(BUDGETS.values()) == 8_000


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_layout_loads(name: str, tmp_path: Path) -> None:
    """Each of its seeds, another scene each; with so many texels that a budget is for a part of them."""
    scenes = [load_scene(write_layout(name, seed, tmp_path)) for seed in SEEDS]
    assert len({scene.triangles.tobytes() for scene in scenes}) == len(SEEDS)
    for scene in scenes:
        assert scene.render.size == (120, 80)
        assert scene.render.frames is not None
        assert scene.last_frame <= scene.render.frames
    lightmaps = unwrap(scenes[0], trace=Structure(scenes[0], "auto").trace)
    assert 3_500 < (lightmaps.texels["state"] == VALID).sum() < 9_000
    assert LAYOUTS[name].about.endswith(".")


def test_a_vase_is_closed() -> None:
    """Every edge is in two faces, once each way."""
    faces = [
        [int(word) for word in line.split()[1:]]
        for line in vase(np.random.default_rng(1)).splitlines()
        if line.startswith("f ")
    ]
    edges = [(a, b) for face in faces for a, b in zip(face, [*face[1:], face[0]], strict=True)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)

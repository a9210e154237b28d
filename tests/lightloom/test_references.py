"""Converged maps that are kept have the bits of those that are not, and are not made twice."""

from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.oracle.converged_maps import Reference
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.policies.references import KeptReference

from .conftest import LAMP, ROOM

DIMMED = """
[[quad.path]]
frame = 2
emission = 1.0
[[quad.path]]
frame = 3
emission = {level}
"""
ASKED: tuple[tuple[int, list[int] | None], ...] = ((0, [3, 5]), (1, [5, 8]), (3, [3]), (4, None), (7, None))


def scene_of(folder: Path, level: float = 0.25) -> tuple[Scene, Lightmaps]:
    path = folder / "dimmed.toml"
    path.write_text(ROOM + LAMP + DIMMED.format(level=level))
    scene = load_scene(path)
    return scene, unwrap(scene)


def reference(scene: Scene, lightmaps: Lightmaps, seed: int = 0) -> Reference:
    return Reference(scene, lightmaps, rays=256, seed=seed)


def test_kept_maps_have_the_same_bits(tmp_path: Path) -> None:
    """All kept, none kept, and those of the beginning: then the others go on from them."""
    scene, lightmaps = scene_of(tmp_path)
    plain = reference(scene, lightmaps)
    wanted = [plain.published(frame, None if some is None else np.array(some)).copy() for frame, some in ASKED]
    assert (wanted[0] != wanted[1]).any(), "more texels are precise"
    assert (wanted[1] != wanted[2]).any(), "another light"
    np.testing.assert_array_equal(wanted[3], wanted[4])
    for count in (3, 5, 5):
        kept = KeptReference(reference(scene, lightmaps), tmp_path / "kept")
        for (frame, some), maps in zip(ASKED[:count], wanted, strict=False):
            found = kept.published(frame, None if some is None else np.array(some))
            np.testing.assert_array_equal(found, maps)


def test_what_is_kept_is_not_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, lightmaps = scene_of(tmp_path)
    KeptReference(reference(scene, lightmaps), tmp_path / "kept").published(3)
    monkeypatch.setattr(Reference, "published", None)
    KeptReference(reference(scene, lightmaps), tmp_path / "kept").published(3)
    KeptReference(reference(scene, lightmaps), tmp_path / "kept").published(4)  # shows the same
    other, maps = scene_of(tmp_path, level=0.5)
    for made, frame in (
        (reference(scene, lightmaps, 1), 3),
        (reference(scene, lightmaps), 0),
        (reference(other, maps), 3),
    ):
        with pytest.raises(TypeError):
            KeptReference(made, tmp_path / "kept").published(frame)

"""Deferred, immediate and tiled immediate rasterization: the same bits, each with the work that it is known for."""

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.frame.rasterizer import MODES, TILE_SIDES, Mesh, Rasterization, draw, rasterize
from lightloom.golden_model.frame.tiles import bin_triangles, by_tile
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.tables.pinhole import View, look_at

UP = np.array([0, 1, 0], dtype=np.float32)


def soup(seed: int, count: int = 80) -> Mesh:
    """Random triangles at random depths, large and small, some twice (equal depth) and some behind the eye."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.5, 1.5, (count, 1, 3)) + rng.normal(scale=0.5, size=(count, 3, 3))
    corners[: count // 8] = corners[-(count // 8) :]
    corners[0, 0, 2] = 9
    triangles = np.zeros(count, dtype=TRIANGLE)
    for k in range(3):
        triangles[f"v{k}"] = corners[:, k]
    return Mesh(
        triangles=triangles,
        normals=rng.normal(size=(count, 3, 3)).astype(np.float32),
        object_id=np.arange(count, dtype=np.int32) // 7,
        lightmap_uv=rng.uniform(0, 64, (count, 3, 2)).astype(np.float32),
        texture_uv=rng.uniform(0, 900, (count, 3, 2)).astype(np.float32),
    )


def view_of(width: int = 75, height: int = 50) -> View:
    return look_at(np.array([0.2, 0.1, 5]), np.zeros(3), UP, 0.4, width, height)


def colour(fragment: np.ndarray) -> np.ndarray:
    """Any function of a fragment."""
    return np.stack([fragment["depth"], flush(fragment["u"] * fragment["v"]), fragment["normal"][:, 0]], axis=1)


@pytest.mark.parametrize("seed", range(4))
def test_all_modes_and_tiles_draw_the_same_bits(seed: int) -> None:
    mesh, view = soup(seed), view_of()
    reference = draw(view, mesh, Rasterization(), colour)
    assert reference.image is not None
    seen = reference.gbuffer["primitive"] >= 0
    assert 500 < seen.sum() < seen.size, f"seed {seed}"
    assert (reference.image[seen] == colour(reference.gbuffer[seen])).all()
    assert not reference.image[~seen].any()
    for mode in MODES:
        for tile in TILE_SIDES[:4]:
            raster = draw(view, mesh, Rasterization(mode=mode, tile=tile), colour)
            assert raster.gbuffer.tobytes() == reference.gbuffer.tobytes(), f"seed {seed}, {mode}, tile {tile}"
            assert raster.image is not None
            assert raster.image.tobytes() == reference.image.tobytes(), f"seed {seed}, {mode}, tile {tile}"


def shaded_one_by_one(mesh: Mesh, view: View) -> tuple[int, int]:
    """Fragments tested and shaded in immediate mode: each triangle drawn on its own, depths compared in their order."""
    nearest = np.full((view.height, view.width), np.inf)
    tested = shaded = 0
    for k in range(len(mesh.triangles)):
        alone = rasterize(
            view,
            mesh.triangles[k : k + 1],
            mesh.normals[k : k + 1],
            mesh.object_id[k : k + 1],
            mesh.lightmap_uv[k : k + 1],
        )
        passes = alone["depth"] < nearest
        nearest[passes] = alone["depth"][passes]
        tested += int((alone["primitive"] >= 0).sum())
        shaded += int(passes.sum())
    return tested, shaded


@pytest.mark.parametrize("seed", range(2))
def test_immediate_modes_shade_what_passes_at_its_turn(seed: int) -> None:
    mesh, view = soup(seed), view_of()
    mesh.triangles[0] = mesh.triangles[1]  # none cut by the near plane: its parts would be several triangles
    tested, shaded = shaded_one_by_one(mesh, view)
    called: list[int] = []

    def counted(fragment: np.ndarray) -> np.ndarray:
        called.append(len(fragment))
        return colour(fragment)

    figures = {}
    for mode in MODES:
        called.clear()
        figures[mode] = draw(view, mesh, Rasterization(mode=mode, tile=16), counted).figures
        assert figures[mode].shaded == sum(called)
        assert figures[mode].tested == tested, f"seed {seed}, {mode}"
    visible = int((draw(view, mesh).gbuffer["primitive"] >= 0).sum())
    assert figures["immediate"].shaded == figures["tiled-immediate"].shaded == shaded > visible * 1.2
    assert figures["tile-deferred"].shaded == visible
    # What goes to memory: every fragment that was shaded, or with tiles each pixel once.
    assert [figures[mode].written for mode in MODES] == [visible, shaded, visible]


def test_order_of_primitives_makes_immediate_mode_dear_or_cheap() -> None:
    """Layers from front to back are shaded once, from back to front all of them, and the picture is the same."""
    layers = 6
    corners = np.array([[-9, -9, 0], [9, -9, 0], [0, 15, 0]], dtype=np.float32)
    triangles = np.zeros(layers, dtype=TRIANGLE)
    for k in range(3):
        triangles[f"v{k}"] = corners[k]
        triangles[f"v{k}"][:, 2] = -np.arange(layers, dtype=np.float32)
    mesh = Mesh(
        triangles=triangles,
        normals=np.ones((layers, 3, 3), dtype=np.float32),
        object_id=np.zeros(layers, dtype=np.int32),
        lightmap_uv=np.zeros((layers, 3, 2), dtype=np.float32),
    )
    away = Mesh(**{**vars(mesh), "triangles": triangles[::-1].copy()})
    view = view_of(32, 32)
    how = Rasterization(mode="immediate")
    near_first, far_first = draw(view, mesh, how, colour), draw(view, away, how, colour)
    assert near_first.figures.shaded == 32 * 32
    assert far_first.figures.shaded == layers * 32 * 32
    assert near_first.image is not None
    assert far_first.image is not None
    assert (near_first.image == far_first.image).all()
    assert draw(view, away, Rasterization(), colour).figures.shaded == 32 * 32


def test_fragments_that_do_not_fit_at_once_are_compared_with_those_before(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh, view = soup(9), view_of()
    expected = [draw(view, mesh, Rasterization(mode=mode), colour) for mode in MODES]
    monkeypatch.setattr("lightloom.golden_model.frame.rasterizer.CHUNK", 300)
    monkeypatch.setattr("lightloom.golden_model.frame.rasterizer.BLOCK", 100)
    for mode, whole in zip(MODES, expected, strict=True):
        parts = draw(view, mesh, Rasterization(mode=mode), colour)
        assert parts.gbuffer.tobytes() == whole.gbuffer.tobytes()
        assert parts.figures == whole.figures, mode


def test_binning_is_that_of_bounding_boxes() -> None:
    rng = np.random.default_rng(3)
    left, top = rng.integers(0, 90, 50), rng.integers(0, 60, 50)
    bounds = np.stack([left, left + rng.integers(1, 40, 50), top, top + rng.integers(1, 30, 50)])
    pairs = set(zip(*(column.tolist() for column in bin_triangles(bounds, 16, 100)), strict=True))
    expected = {
        (y // 16 * 7 + x // 16, k)
        for k, (x0, x1, y0, y1) in enumerate(bounds.T)
        for x in range(x0, x1)
        for y in range(y0, y1)
    }
    assert pairs == expected
    tile, triangle = by_tile(*bin_triangles(bounds, 16, 100))
    assert (np.diff(tile) >= 0).all()
    assert (np.diff(triangle)[np.diff(tile) == 0] > 0).all(), "each tile's triangles in order"


def test_figures_of_the_cornell_box() -> None:
    """A tile that lies inside a triangle's bounding box but beyond one of its edges gets no pair."""
    scene = cornell_box()
    camera = scene.camera_at(0)
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, 128, 128)
    mesh = Mesh(
        triangles=scene.triangles,
        normals=scene.normals,
        object_id=scene.object_id,
        lightmap_uv=np.zeros((32, 3, 2), dtype=np.float32),
    )
    figures = draw(view, mesh, Rasterization(tile=16)).figures
    assert figures.triangles == 32
    assert 20 <= figures.set_up <= 32
    assert 150 < figures.pairs < 260
    assert figures.tested > figures.shaded > 0.9 * 128 * 128
    assert draw(view, mesh, Rasterization(mode="immediate")).figures.pairs == 0


def test_texture_coordinates_and_their_level_of_detail_are_those_of_a_lightmap() -> None:
    """The same coordinates given as lightmap and as texture come out the same; without them the fields are zero."""
    mesh = soup(2)
    same = Mesh(**{**vars(mesh), "texture_uv": mesh.lightmap_uv})
    gbuffer = draw(view_of(), same).gbuffer
    assert (gbuffer["texture"] == gbuffer["lightmap"]).all()
    assert (gbuffer["texture_lod"] == gbuffer["lod"]).all()
    assert gbuffer["texture"].any()
    without = draw(view_of(), Mesh(**{**vars(mesh), "texture_uv": None})).gbuffer
    assert not without["texture"].any()
    assert not without["texture_lod"].any()
    for name in ("primitive", "depth", "lightmap", "lod"):
        assert (without[name] == gbuffer[name]).all()


@pytest.mark.parametrize("option", [{"mode": "scanline"}, {"tile": 24}, {"tile": 4}])
def test_options_that_do_not_exist_are_refused(option: dict) -> None:
    with pytest.raises(InputError, match=str(next(iter(option.values())))):
        Rasterization(**option)

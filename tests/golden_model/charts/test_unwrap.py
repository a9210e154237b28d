"""Lightmaps: charts, texel records, buried texels, and what reads between texels meet."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lightloom.golden_model.charts import curved
from lightloom.golden_model.charts.planar import GAP, pack
from lightloom.golden_model.charts.texels import texel_records
from lightloom.golden_model.charts.unwrap import object_charts, unwrap
from lightloom.golden_model.contract.formats import TEXEL_STATE
from lightloom.golden_model.engine.publishing.publisher import Publisher
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.vectors import interpolate
from lightloom.golden_model.rays.surface_shading import readable
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.flat_pieces import planar_pieces
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import (
    BURIED,
    EMPTY,
    VALID,
    Lightmaps,
    bilinear,
    bilinear_taps,
    filled,
    lightmap_coordinates,
    row_and_column,
    sample,
)
from lightloom.golden_model.tables.ray_offset import lift
from lightloom.golden_model.tracing.bvh import build, traversal
from lightloom.golden_model.tracing.trace_protocol import Trace

SEED = 20250102


def tracer(scene: Scene) -> Trace:
    return partial(traversal.trace, build.build(scene.triangles))


@pytest.fixture(scope="module")
def cornell() -> tuple[Scene, Lightmaps]:
    scene = load_scene("cornell-box")
    return scene, unwrap(scene, trace=tracer(scene))


def scene_of(objects: dict[str, np.ndarray], texel_size: float) -> Scene:
    """Triangles (F, 3, 3) by the names of their objects, grey."""
    parts = [
        Part(
            name=name,
            corners=np.asarray(triangles, dtype=np.float32),
            albedo=np.full((1, 3), 0.5, dtype=np.float32),
            emission=np.zeros((1, 3), dtype=np.float32),
            material=np.zeros(len(triangles), dtype=np.int32),
        )
        for name, triangles in objects.items()
    ]
    return assemble(name="test", parts=parts, where="test", texel_size=texel_size)


def surface_points(scene: Scene, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points on the triangles, their edges and corners: (primitive, u, v, position)."""
    random = np.random.default_rng(SEED)
    primitive = random.integers(len(scene.triangles), size=count)
    u, v = random.random((2, count), dtype=np.float32)
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    kind = random.integers(8, size=count)  # a few on each edge and each corner
    u[kind == 0] = 0
    v[kind == 1] = 0
    u[kind == 2] = 1 - v[kind == 2]
    corner = np.flatnonzero(kind == 3)
    u[corner], v[corner] = np.array([[0, 0], [1, 0], [0, 1]], dtype=np.float32)[corner % 3].T
    triangle = scene.triangles[primitive]
    return primitive, u, v, interpolate(triangle["v0"], triangle["v1"], triangle["v2"], u, v)


CURVED: dict[str, Callable[[], tuple[trimesh.Trimesh, float]]] = {
    "torus": lambda: (trimesh.creation.torus(1, 0.4), 0.1),
    "ball": lambda: (trimesh.creation.icosphere(subdivisions=3), 0.05),
    "coarse ball": lambda: (trimesh.creation.icosphere(subdivisions=3), 1.0),
    "tiny ball": lambda: (trimesh.creation.icosphere(subdivisions=3, radius=1e-6), 1e-7),
    "huge ball": lambda: (trimesh.creation.icosphere(subdivisions=3, radius=1e6), 1e5),
    "box": lambda: (trimesh.creation.box(), 0.07),
    "flat polygons": lambda: (trimesh.creation.cylinder(radius=1, height=2, sections=7), 0.1),
}


@pytest.mark.parametrize("name", CURVED)
def test_reads_meet_only_texels_of_their_own_chart(name: str) -> None:
    """At any point of any triangle, edges and corners included, and what they read is near the point itself."""
    mesh, texel_size = CURVED[name]()
    scene = scene_of({"mesh": mesh.triangles}, texel_size)
    lightmaps = unwrap(scene)
    primitive, u, v, position = surface_points(scene, 40_000)
    uv = lightmap_coordinates(lightmaps, primitive, u, v)
    texel, weight = bilinear_taps(lightmaps, scene.object_id[primitive], uv)
    used = weight > 0
    assert (lightmaps.texels["state"][texel][used] == VALID).all()
    chart = lightmaps.chart[texel]
    assert (np.where(used, chart, -1).max(axis=1) == np.where(used, chart, 2**31 - 1).min(axis=1)).all()
    read = (lightmaps.texels["position"][texel] * (weight / 2**16)[..., None]).sum(axis=1)
    error = np.sqrt(((read - position).astype(np.float64) ** 2).sum(axis=1)) / texel_size
    assert np.median(error) < 0.15, "in texels"
    assert error.max() < 1, "in texels"


@pytest.mark.parametrize("name", CURVED)
def test_texels_lie_just_off_the_surface_with_orthonormal_frames(name: str) -> None:
    mesh, texel_size = CURVED[name]()
    scene = scene_of({"mesh": mesh.triangles}, texel_size)
    texels = unwrap(scene).texels
    texels = texels[texels["state"] == VALID]
    assert len(texels) > 0
    random = np.random.default_rng(SEED)
    texels = texels[random.permutation(len(texels))[:300]]
    area = area_vectors(scene.corners)
    unit = area / np.sqrt((area * area).sum(axis=1))[:, None]
    # Before some triangle it lies, on the front, by what the triangle and rounding ask for, and between its edges.
    rounding = float(np.abs(scene.corners).max()) * 2.0**-20
    corners = scene.corners.astype(np.float64)
    toward = texels["position"].astype(np.float64)[:, None, None] - corners
    edges = np.roll(corners, -1, axis=1) - corners
    edges /= np.sqrt((edges * edges).sum(axis=2))[..., None]
    inward = (np.cross(edges, toward) * unit[:, None]).sum(axis=3).min(axis=2)
    above = (toward[:, :, 0] * unit).sum(axis=2)
    most = lift(scene.corners, unit.astype(np.float32)[:, None], scene.spans[:, None]).max(axis=1) + rounding / 8
    assert ((inward > -rounding) & (above > 0) & (above < most)).any(axis=1).all()
    normal, tangent = texels["normal"].astype(np.float64), texels["tangent"].astype(np.float64)
    assert np.abs((normal * normal).sum(axis=1) - 1).max() < 4e-7
    assert np.abs((tangent * tangent).sum(axis=1) - 1).max() < 4e-7
    assert np.abs((normal * tangent).sum(axis=1)).max() < 4e-7


def test_quads_become_rectangles_sampled_from_edge_to_edge(cornell: tuple[Scene, Lightmaps]) -> None:
    scene, lightmaps = cornell
    for name in ("floor", "ceiling", "back wall", "right wall", "left wall", "light"):
        number = scene.object_names.index(name)
        mine = scene.object_id == number
        uv = lightmaps.uv[mine].reshape(-1, 2)
        size = (lightmaps.width[number], lightmaps.height[number])
        assert sorted({tuple(row) for row in uv.tolist()}) == [
            (0.5, 0.5),
            (0.5, size[1] - 0.5),
            (size[0] - 0.5, 0.5),
            (size[0] - 0.5, size[1] - 0.5),
        ], name
        part = slice(lightmaps.offset[number], lightmaps.offset[number] + size[0] * size[1])
        assert (lightmaps.texels["state"][part] != EMPTY).all()
        # The border texels lie at the edges, but not in the walls that meet there.
        texels = lightmaps.texels[part]
        low, high = scene.corners[mine].min(axis=(0, 1)), scene.corners[mine].max(axis=(0, 1))
        gap = np.minimum(texels["position"] - low, high - texels["position"]).min(axis=0)
        for axis in np.flatnonzero(high - low > 10):
            assert 0.05 < gap[axis] < 1.5, (name, axis)


def test_every_texel_is_where_its_place_in_the_map_says(cornell: tuple[Scene, Lightmaps]) -> None:
    """The floor's texel (i, j): u runs along z or x; its point interpolates the corners within a margin."""
    scene, _ = cornell
    lightmaps = unwrap(scene)  # none is moved where it is not known what stands there
    number = scene.object_names.index("floor")
    width, height = int(lightmaps.width[number]), int(lightmaps.height[number])
    part = slice(int(lightmaps.offset[number]), int(lightmaps.offset[number]) + width * height)
    texels = lightmaps.texels[part].reshape(height, width)
    assert (texels["object"] == number).all()
    step_u = texels["position"][:, 1:] - texels["position"][:, :-1]
    step_v = texels["position"][1:] - texels["position"][:-1]
    assert np.allclose(np.abs(step_u).max(axis=2)[:, 1:-1], 7.99, atol=0.05)
    assert np.allclose(np.abs(step_v).max(axis=2)[1:-1], 7.99, atol=0.05)
    # The tangent points along u, and with the normal's help the bitangent along v.
    assert ((step_u * texels["tangent"][:, 1:]).sum(axis=2) > 6).all()
    bitangent = np.cross(texels["normal"], texels["tangent"])
    assert ((step_v * bitangent[1:]).sum(axis=2) > 6).all()


def test_texels_under_the_blocks_and_behind_the_lamp_are_buried(cornell: tuple[Scene, Lightmaps]) -> None:
    scene, lightmaps = cornell
    position, state = lightmaps.texels["position"].astype(np.float64), lightmaps.texels["state"]

    def on(name: str) -> np.ndarray:
        return lightmaps.texels["object"] == scene.object_names.index(name)

    depth = np.full(len(position), -np.inf)  # within the outline of a block, seen from above
    for block in ("short block", "tall block"):
        for triangle in scene.corners[scene.object_id == scene.object_names.index(block)][:2].astype(np.float64):
            sides = []
            for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
                x, _, z = (b - a) / np.hypot(*(b - a)[[0, 2]])
                sides.append((position[:, 0] - a[0]) * z - (position[:, 2] - a[2]) * x)
            depth = np.maximum(depth, np.min(sides, axis=0))
    # Points within 0.1 mm of an outline (the diagonals of the tops have two) may be either.
    assert (on("floor") & (depth > 0.1)).sum() > 600
    assert (state[on("floor") & (depth > 0.1)] == BURIED).all()
    assert (state[on("floor") & (depth < -0.1)] == VALID).all()

    beyond = np.maximum(np.abs(position[:, 0] - 278) - 65, np.abs(position[:, 2] - 279.5) - 52.5)
    assert (state[on("ceiling") & (beyond < -2)] == BURIED).all()
    assert (state[on("ceiling") & (beyond > 0.5)] == VALID).all()
    for name in ("back wall", "left wall", "right wall", "light", "short block", "tall block"):
        assert (state[on(name)] != BURIED).all(), name


def test_fill_names_the_nearest_valid_texel(cornell: tuple[Scene, Lightmaps]) -> None:
    _, lightmaps = cornell
    state, fill, chart = lightmaps.texels["state"], lightmaps.fill, lightmaps.chart
    own = np.arange(len(fill))
    assert (fill[state == VALID] == own[state == VALID]).all()
    there = fill >= 0
    assert (state[fill[there]] == VALID).all()
    assert (lightmaps.texels["object"][fill[there]] == lightmaps.texels["object"][there]).all()
    buried = np.flatnonzero((state == BURIED) & there)
    assert len(buried) > 500
    assert (chart[fill[buried]] == chart[buried]).all()
    # Nearest: compared with all valid texels of the chart, by distance in texels.
    number = lightmaps.texels["object"]
    row, column = np.divmod(own - lightmaps.offset[number], lightmaps.width[number])
    for index in buried[::7]:
        same = np.flatnonzero((state == VALID) & (chart == chart[index]))
        nearest = np.hypot(column[same] - column[index], row[same] - row[index]).min()
        mine = np.hypot(column[fill[index]] - column[index], row[fill[index]] - row[index])
        # The spreading looks at eight neighbours at a time, so it may be a little off the true nearest.
        assert mine <= nearest + 0.5
    # Of its region or of one of the eight around; whoever has none has the nearest farther away.
    apart = np.maximum(abs(row[fill] // 8 - row // 8), abs(column[fill] // 8 - column // 8))
    assert (apart[there] <= 1).all()
    assert 0 < (~there).sum() < 1000
    for index in np.flatnonzero(~there)[::50]:
        same = np.flatnonzero((state == VALID) & (number == number[index]))
        assert np.maximum(abs(column[same] - column[index]), abs(row[same] - row[index])).min() > 7


def test_no_read_sees_a_texel_without_a_value(cornell: tuple[Scene, Lightmaps]) -> None:
    scene, lightmaps = cornell
    values = np.where(lightmaps.texels["state"] == VALID, 1, -100).astype(np.float32)[:, None]
    shown = filled(lightmaps, values)
    primitive, u, v, _ = surface_points(scene, 100_000)
    uv = lightmap_coordinates(lightmaps, primitive, u, v)
    read = bilinear(lightmaps, shown, scene.object_id[primitive], uv)
    assert np.abs(read - 1).max() < 1e-6


def test_no_level_that_may_be_read_mixes_in_texels_that_show_nothing(cornell: tuple[Scene, Lightmaps]) -> None:
    """All samples are 1; coarse texels beside those without `fill` are darker: `deepest` keeps reads away."""
    _, lightmaps = cornell
    state = np.zeros(len(lightmaps.texels), dtype=TEXEL_STATE)
    state["irradiance"], state["count"] = 1, 1
    values = readable(Publisher(lightmaps).everything(state))
    number = np.flatnonzero(lightmaps.fill >= 0)
    owner = lightmaps.texels["object"][number]
    place = np.stack(row_and_column(lightmaps, number)[::-1], axis=1).astype(np.float32) + np.float32(0.5)
    assert lightmaps.deepest is not None
    free = replace(lightmaps, deepest=np.full(len(state), 9, dtype=np.uint8))
    darker = []
    for level in range(1, 8):
        lod = np.full(len(number), level * 256)
        found, mixed = (sample(maps, values, owner, place, lod) for maps in (lightmaps, free))
        assert (found[lightmaps.deepest[number] > 0] == 1).all(), level
        darker.append(int((mixed < 1).sum()))
    assert max(darker) > 0, "else there is nothing to show"


def test_the_inside_of_an_open_pot_is_not_buried() -> None:
    """Its texels see mostly backs of the pot's outward faces, but they can be seen themselves."""
    box = trimesh.creation.box(extents=(2, 1, 2))
    pot = box.triangles[np.abs(box.face_normals[:, 1]) < 0.5]  # neither lid nor bottom
    a, b, c, d = [-4, -0.5, 4], [4, -0.5, 4], [4, -0.5, -4], [-4, -0.5, -4]
    scene = scene_of({"pot": pot, "floor": np.array([[a, b, c], [a, c, d]])}, 0.1)
    texels = unwrap(scene, trace=tracer(scene)).texels
    inside = (np.abs(texels["position"][:, [0, 2]]) < 0.5).all(axis=1) & (texels["object"] == 1)
    assert inside.sum() > 50
    assert (texels["state"][inside] == VALID).all()


def test_planar_pieces_are_connected_and_flat() -> None:
    box = trimesh.creation.box()
    piece = planar_pieces(np.asarray(box.triangles, dtype=np.float32))
    assert np.bincount(piece).tolist() == [2] * 6
    for k in range(6):
        assert np.ptp(box.face_normals[piece == k], axis=0).max() < 1e-6
    side = box.triangles[piece == 0]
    along = side[0, 1] - side[0, 0]
    apart = np.concatenate([side, side + 5 * along]).astype(np.float32)
    assert np.bincount(planar_pieces(apart)).tolist() == [2, 2], "the same plane, but not connected"


def test_packed_rectangles_keep_their_distance() -> None:
    random = np.random.default_rng(SEED)
    for count in (1, 2, 7, 40):
        sizes = random.integers(1, 30, size=(count, 2))
        place, width, height = pack(sizes)
        map_ = np.zeros((height + GAP, width + GAP), dtype=int)
        for (x, y), (columns, rows) in zip(place, sizes, strict=True):
            assert x + columns <= width
            assert y + rows <= height
            map_[y : y + rows + GAP, x : x + columns + GAP] += 1
        assert map_.max() == 1, "rectangles with their gap do not overlap"
        assert map_.sum() == ((sizes + GAP).prod(axis=1)).sum()


def test_texel_records_by_brute_force() -> None:
    """A chart of one odd triangle: which texels it touches, and nearest points, by dense sampling of the triangle."""
    uv = np.array([[[1.3, 1.1], [7.7, 2.4], [3.2, 6.9]]], dtype=np.float32)
    corners = np.concatenate([uv, np.zeros((1, 3, 1), dtype=np.float32)], axis=2)  # the surface is the map itself
    normals = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), (1, 3, 3))
    width, height, margin = 10, 9, 1.0 / 16
    span = np.zeros(1, dtype=np.float32)
    texels, chart = texel_records(corners, normals, uv, np.zeros(1, dtype=np.int32), width, height, span, margin)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 400), np.linspace(0, 1, 400)), axis=-1).reshape(-1, 2)
    grid = grid[grid.sum(axis=1) <= 1]
    dense = uv[0, 0] + grid[:, :1] * (uv[0, 1] - uv[0, 0]) + grid[:, 1:] * (uv[0, 2] - uv[0, 0])
    for j in range(height):
        for i in range(width):
            centre = np.array([i + 0.5, j + 0.5])
            reach = np.abs(dense - centre).max(axis=1).min()  # the square around the centre that first meets it
            state = texels["state"][j * width + i]
            if abs(reach - 1) > 0.02:
                assert state == (VALID if reach < 1 else EMPTY), (i, j)
            assert chart[j * width + i] == (0 if state == VALID else -1)
            if state == VALID:
                nearest = np.sqrt(((dense - centre) ** 2).sum(axis=1).min())
                mine = np.sqrt(((texels["position"][j * width + i][:2] - centre) ** 2).sum())
                assert nearest - 0.02 <= mine <= nearest + 4 * margin, (i, j)


def test_curved_charts_are_kept_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    corners = np.asarray(trimesh.creation.icosphere(subdivisions=3).triangles, dtype=np.float32)
    made = object_charts(corners, 0.1, tmp_path)
    assert (object_charts(corners, 0.1).uv == made.uv).all(), "xatlas gives the same charts again"
    kept = list((tmp_path / "charts").iterdir())
    assert len(kept) == 1

    with monkeypatch.context() as patch:
        patch.setattr(curved, "_unwrap", None)
        again = object_charts(corners, 0.1, tmp_path)
    assert (again.width, again.height) == (made.width, made.height)
    assert (again.uv == made.uv).all()
    assert (again.chart == made.chart).all()

    kept[0].write_bytes(kept[0].read_bytes()[:1000])
    repaired = object_charts(corners, 0.1, tmp_path)
    assert (repaired.uv == made.uv).all(), "a damaged entry is made again"
    object_charts(corners, 0.2, tmp_path)
    assert len(list((tmp_path / "charts").iterdir())) == 2


def test_texel_sizes_that_cannot_be_used(cornell: tuple[Scene, Lightmaps]) -> None:
    scene, _ = cornell
    for size in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="texel_size must be a positive number"):
            unwrap(scene, size)
    with pytest.raises(InputError, match=r"texel_size 0\.001 needs .* texels, at most .* choose .* or more"):
        unwrap(scene, 0.001)

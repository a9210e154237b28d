"""Flat geometry that is cut: the same surface, without gaps, and no section on both sides of what stands on it."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.cut_polygons import triangulated
from lightloom.golden_model.scene.cuts import cut_parts
from lightloom.golden_model.scene.keyframes import ObjectKey, ObjectPath
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import bilinear, lightmap_coordinates
from tests.golden_model.frame_scenes import part
from tests.golden_model.leak_scenes import block_through_table, box, room, sealed_room, shelf, thin_wall

SEED = 20261130


def areas(corners: np.ndarray) -> np.ndarray:
    return np.sqrt((area_vectors(corners) ** 2).sum(axis=1)) / 2


def points_on(scene: Scene, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Random points of a scene's surface: (triangle, u, v, place)."""
    random = np.random.default_rng(SEED)
    area = areas(scene.corners)
    triangle = random.choice(len(area), count, p=area / area.sum())
    u, v = random.random((2, count), dtype=np.float32)
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    corner = scene.corners[triangle].astype(np.float64)
    place = corner[:, 0] + u[:, None] * (corner[:, 1] - corner[:, 0]) + v[:, None] * (corner[:, 2] - corner[:, 0])
    return triangle, u, v, place


def read(scene: Scene, value: np.ndarray, triangle: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What bilinear reads at points find where each texel (N,) has a value."""
    maps = unwrap(scene, trace=Structure(scene).trace)
    shown = np.where(maps.fill >= 0, value[maps.fill], 0).astype(np.float32)[:, None]
    return bilinear(maps, shown, scene.object_id[triangle], lightmap_coordinates(maps, triangle, u, v))[:, 0]


def test_reads_beside_a_thin_wall_meet_texels_of_their_own_side_alone() -> None:
    for reach in (1.0, 0.7):
        scene = thin_wall(reach=reach)
        right = unwrap(scene).texels["position"][:, 0] > 0.003
        triangle, u, v, place = points_on(scene, 40_000)
        found = read(scene, right, triangle, u, v)
        beside = (place[:, 2] < -1.12 + 2 * reach) & (np.abs(place[:, 0] - 0.003) > 0.0052)
        on_floor = np.isin(scene.object_id[triangle], [scene.object_names.index(n) for n in ("floor", "ceiling")])
        looked_at = beside & on_floor
        assert looked_at.sum() > 5000
        assert (found[looked_at] == (place[looked_at, 0] > 0)).all(), reach


def test_reads_above_and_below_a_shelf_meet_texels_of_their_own_side_alone() -> None:
    scene = shelf()
    above = unwrap(scene).texels["position"][:, 1] > 1.08
    triangle, u, v, place = points_on(scene, 40_000)
    found = read(scene, above, triangle, u, v)
    looked_at = (scene.object_id[triangle] == scene.object_names.index("wall")) & (np.abs(place[:, 1] - 1.08) > 0.0102)
    assert looked_at.sum() > 5000
    assert (found[looked_at] == (place[looked_at, 1] > 1.08)).all()


def test_reads_on_a_block_stop_at_the_plate_that_it_stands_through() -> None:
    scene = block_through_table()
    above = unwrap(scene).texels["position"][:, 1] > 1.1
    triangle, u, v, place = points_on(scene, 60_000)
    found = read(scene, above, triangle, u, v)
    looked_at = (scene.object_id[triangle] == scene.object_names.index("block")) & (np.abs(place[:, 1] - 1.1) > 0.0402)
    assert looked_at.sum() > 4000
    assert (found[looked_at] == (place[looked_at, 1] > 1.1)).all()


def random_parts(seed: int) -> list[Part]:
    """Boxes and plates, turned about the vertical, that stand in each other and in the walls of a room."""
    random = np.random.default_rng(seed)
    parts = room((-2, 0, -2), (2, 2, 2))
    for number in range(int(random.integers(3, 9))):
        size = random.choice([0.03, 0.15, 0.6, 1.2], 3) * random.uniform(0.8, 1.2, 3)
        middle = random.uniform([-2, 0, -2], [2, 1.5, 2])
        corners = box("", tuple(-size / 2), tuple(size / 2)).corners.astype(np.float64)
        t = random.choice([0, 0.2, 0.7])
        cosine, sine = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
        turned = np.stack(
            [
                cosine * corners[..., 0] + sine * corners[..., 2],
                corners[..., 1],
                cosine * corners[..., 2] - sine * corners[..., 0],
            ],
            axis=-1,
        )
        parts.append(part(f"box {number}", turned + middle, 0.5))
    return parts


@pytest.mark.parametrize("seed", range(SEED, SEED + 12))
def test_the_surface_is_the_same_and_has_no_gaps(seed: int) -> None:
    parts = random_parts(seed)
    cut = cut_parts(parts, 0.15)
    assert any(part.section is not None for part in cut), seed
    for old, new in zip(parts, cut, strict=True):
        assert abs(areas(old.corners).sum() - areas(new.corners).sum()) < 1e-5 * areas(old.corners).sum(), seed
        assert areas(new.corners).min() > 0, seed
        if new.section is None:
            continue
        # Every triangle lies in the plane of the one that it is a part of, and faces the same way.
        unit = [area_vectors(each.corners) / (2 * areas(each.corners))[:, None] for each in (old, new)]
        level = [(n * each.corners[:, 0]).sum(axis=1) for n, each in zip(unit, (old, new), strict=True)]
        near = (np.abs(level[1][:, None] - level[0]) < 1e-5) & (unit[1] @ unit[0].T > 1 - 1e-6)
        assert near.any(axis=1).all(), seed
        assert np.abs(new.corners).max() <= np.abs(old.corners).max(), seed
    closed = np.concatenate([new.corners for new in cut])
    assert not _corners_within_edges(closed), seed


def _corners_within_edges(corners: np.ndarray) -> list[np.ndarray]:
    """Corners of triangles that lie inside an edge of a triangle and are no corner there."""
    out = []
    points = np.unique(corners.reshape(-1, 3), axis=0).astype(np.float64)
    begin, end = (
        corners.reshape(-1, 3).astype(np.float64),
        np.roll(corners, -1, axis=1).reshape(-1, 3).astype(np.float64),
    )
    for a, b in zip(begin, end, strict=True):
        length = np.sqrt(((b - a) ** 2).sum())
        step = (points - a) @ (b - a) / length
        away = np.sqrt((((points - a) - step[:, None] * (b - a) / length) ** 2).sum(axis=1))
        out += list(points[(away < 1e-6) & (step > 1e-3) & (step < length - 1e-3)])
    return out


def test_rays_do_not_pass_between_the_triangles_of_a_cut() -> None:
    """From inside a closed room through its cut lines, and through their ends, where they meet other walls."""
    scene = thin_wall()
    assert (scene.section >= 0).sum() > 40
    random = np.random.default_rng(SEED)
    corners = scene.corners[(scene.section >= 0)].astype(np.float64)
    edge = random.integers(len(corners), size=30_000)
    step = random.random((30_000, 1))
    target = corners[edge, 0] + step * (corners[edge, 1] - corners[edge, 0])
    rays = np.zeros(len(target), dtype=RAY)
    rays["origin"] = np.where(target[:, :1] > 0.003, [[0.7, 0.8, 0.1]], [[-0.7, 0.8, 0.1]])
    rays["direction"] = target - rays["origin"]
    rays["t_max"] = np.inf
    assert (Structure(scene).trace(rays)["primitive"] >= 0).all()


def test_what_stands_thick_or_moves_or_hangs_above_cuts_nothing() -> None:
    walls = room((-2, 0, -2), (2, 2, 2))
    thin = box("thin", (-0.01, 0, -1), (0.01, 1, 1))
    moving = ObjectPath(
        keys=tuple(
            ObjectKey(
                frame=frame,
                translate=vector((0, frame, 0)),
                rotate=vector((1, 0, 0, 0)),
                emission=np.float32(1),
                present=True,
            )
            for frame in (0, 1)
        ),
        pivot=vector((0, 0, 0)),
        loop=0,
    )
    for parts in (
        [*walls, box("thick", (-0.5, 0, -0.5), (0.5, 1, 0.5))],
        [*walls, replace(thin, path=moving)],
        [*walls, box("above", (-0.01, 0.1, -1), (0.01, 1, 1))],
        [*walls, box("short", (-0.01, 0, -0.02), (0.01, 1, 0.02))],
    ):
        for old, new in zip(parts, cut_parts(parts, 0.1), strict=True):
            assert new is old, (parts[-1].name, old.name)
    parts = [*walls, thin]
    floor = [part.name for part in parts].index("floor")
    assert cut_parts(parts, 0.1)[floor].section is not None


def test_a_wall_that_ends_leaves_two_sections_and_no_more() -> None:
    """What is cut beyond the end of the wall is put together again with one of the sides."""
    scene = thin_wall(reach=0.7)
    for name in ("floor", "ceiling"):
        section = scene.section[scene.object_id == scene.object_names.index(name)]
        assert section.max() == 2, "left, right, and what is under the wall"


def test_what_corners_and_triangles_have_is_carried_to_their_parts() -> None:
    """Texture coordinates, normals and materials of a floor that a wall stands on."""
    parts = [*room((-2, 0, -2), (2, 2, 2)), box("thin", (-0.01, 0, -1), (0.01, 1, 1))]
    number = [part.name for part in parts].index("floor")
    floor = parts[number]
    along = np.array([[2, 0], [0, 0], [0.5, 3]], dtype=np.float32)
    tilted = np.array([0.28, 0.96, 0], dtype=np.float32)
    parts[number] = replace(
        floor,
        albedo=np.full((2, 3), 0.5, dtype=np.float32),
        emission=np.zeros((2, 3), dtype=np.float32),
        material=np.array([0, 1], dtype=np.int32),
        normals=np.broadcast_to(tilted, (2, 3, 3)).copy(),
        texture_uv=(floor.corners @ along).astype(np.float32),
    )
    made = cut_parts(parts, 0.1)[number]
    assert made.section is not None
    assert made.texture_uv is not None
    assert made.normals is not None
    assert np.abs(made.texture_uv - made.corners @ along).max() < 1e-5
    assert np.abs(made.normals - tilted).max() < 1e-6
    for material in (0, 1):
        whole = areas(floor.corners)[material]
        assert areas(made.corners)[made.material == material].sum() == pytest.approx(whole, rel=1e-6)


def test_cuts_are_the_same_again() -> None:
    one, two = block_through_table(), block_through_table()
    assert (one.triangles == two.triangles).all()
    assert (one.section == two.section).all()
    assert len(sealed_room().triangles) == 6 * 2 + 6 * 12 + 2, "thick walls that meet are not cut"


def test_polygons_with_corners_within_their_edges_become_triangles_of_their_area() -> None:
    random = np.random.default_rng(SEED)
    for _ in range(200):
        base = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * random.uniform(0.01, 1, 2)
        base = base[: random.integers(3, 5)]
        loop = []
        for a, b in zip(base, np.roll(base, -1, axis=0), strict=True):
            loop += [a, *(a + s * (b - a) for s in sorted(random.random(random.integers(0, 3))))]
        place = np.array(loop)
        triangles = place[np.array(triangulated(place, 1e-9))]
        first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
        assert (area > 0).all()
        wanted = (base[2, 0] * base[2, 1]) / (1 if len(base) == 4 else 2)
        assert abs(area.sum() - wanted) < 1e-12

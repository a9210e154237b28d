"""What changed between two frames, its volumes and shadows, and the maps and texels that they reach."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.contract.engine_image import DIFFUSE, MIRROR
from lightloom.golden_model.contract.formats import FOOTPRINT, INFLUENCE, SHADOW, TEXEL, VOLUME, WHOLE_CHANGE
from lightloom.golden_model.driver.changes import bounds, moved_objects, sources, table_of
from lightloom.golden_model.driver.footprints import footprints
from lightloom.golden_model.driver.report import loose_bounds
from lightloom.golden_model.driver.volumes import octaves_of, volumes
from lightloom.golden_model.engine.selection.influence.reach import texel_changes, touched
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.pose import moved_records, scene_at
from lightloom.golden_model.scene.scene import Camera, Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.selection_scenes import Stage, key, path_of, plate, visited

BASE = Policy(
    influence_least=1 / 32, influence_memory=8, influence_shiny=2, influence_hiding=0.5, influence_ahead=4, shadows=True
)
STAGE = visited()
TABLE = table_of(STAGE.scene)
GUEST = STAGE.scene.object_names.index("guest")
LAMP = STAGE.scene.object_names.index("light")


def levels(
    stage: Stage, frame: int, policy: Policy, before: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """INFLUENCE of a frame after another (the one before it), change levels of texels, and which texels are valid."""
    before = frame - 1 if before is None else before
    scene = scene_at(stage.scene, frame)
    maps = moved_records(stage.lightmaps, scene)
    valid = maps.texels["state"] == VALID
    table = table_of(stage.scene)
    records = volumes(table, scene_at(stage.scene, before), scene, policy)
    return records, texel_changes(records, loose_bounds(table, scene, policy), maps, valid)[0], valid


def of_object(stage: Stage, name: str) -> np.ndarray:
    return stage.lightmaps.texels["object"] == stage.scene.object_names.index(name)


def test_what_is_expected_of_what_moves_appears_and_is_switched() -> None:
    """Of bounds of objects an eighth, of slow motion what this frame brings, of a lamp that goes off all."""
    fast, appeared, off = (levels(STAGE, frame, BASE)[0] for frame in (1, 20, 30))
    assert set(fast["octaves"].tolist()) == {3}
    assert set(appeared["octaves"].tolist()) == {3}
    assert off["octaves"][off["object"] == LAMP].tolist() == [0]
    assert [octaves_of(1.0, part, bounds) for part, bounds in ((1 / 8, 3), (1 / 8, -1), (1.0, -1), (0.01, 3))] == [
        *(6, 2, 0, 6)
    ]


def test_expected_changes_fall_by_four_a_level_and_the_largest_counts() -> None:
    scene = scene_at(STAGE.scene, 20)
    valid = STAGE.lightmaps.texels["state"] == VALID
    records, boxes = levels(STAGE, 20, BASE)[0], loose_bounds(TABLE, scene, BASE)
    level, expected = texel_changes(records, boxes, STAGE.lightmaps, valid)
    octaves = int(records["octaves"][0])
    assert set(zip(level.tolist(), expected.tolist(), strict=True)) == {
        (0, 0),
        *((k, WHOLE_CHANGE - octaves - 2 * (3 - k)) for k in (1, 2, 3)),
    }
    both = np.concatenate([records, records[:1]])
    both["octaves"][-1] = 0
    most = texel_changes(both, boxes, STAGE.lightmaps, valid)[1]
    assert most.max() == WHOLE_CHANGE
    assert (most >= expected).all()


def test_changes_between_frames() -> None:
    def moved(frame: int) -> list[tuple[int, float]]:
        pair = scene_at(STAGE.scene, frame - 1), scene_at(STAGE.scene, frame)
        return [(item.object, round(item.motion, 3)) for item in moved_objects(TABLE, *pair)]

    step = 110 / float((TABLE.high[GUEST] - TABLE.low[GUEST]).max())
    assert moved(1) == [(GUEST, round(step, 3))]
    assert moved(15) == []
    assert moved(20) == [(GUEST, 1.0)]
    assert moved(25) == []
    assert moved_objects(TABLE, scene_at(STAGE.scene, 3), scene_at(STAGE.scene, 3)) == []
    lit = sources(TABLE, scene_at(STAGE.scene, 0))
    assert [source.object for source in lit] == [LAMP]
    emission = STAGE.scene.emission.astype(np.float64).max(axis=0)
    grey = (emission[0] + 2 * emission[1] + emission[2]) / 4
    assert lit[0].power == pytest.approx(np.pi * grey * 130 * 105, rel=1e-6)
    assert sources(TABLE, scene_at(STAGE.scene, 30)) == []


@pytest.mark.parametrize("frame", [0, 5, 15])
def test_bounds_hold_every_vertex(frame: int) -> None:
    scene = scene_at(STAGE.scene, frame)
    for number in range(len(scene.object_names)):
        box, corners = bounds(TABLE, scene, number), scene.corners[scene.object_id == number]
        assert (corners >= box.low - 1e-3).all()
        assert (corners <= box.high + 1e-3).all()
    assert (bounds(TABLE, scene_at(STAGE.scene, 25), GUEST).low == np.inf).all()


def test_influence_starts_grows_shrinks_and_stops_with_the_overlap() -> None:
    """Texels of the room that a block reaches while it comes, or goes the same way."""
    policy = replace(BASE, shadows=False, influence_ahead=0)
    room_only = ~of_object(STAGE, "guest")

    def reached(frame: int, before: int) -> int:
        records, found, _ = levels(STAGE, frame, policy, before)
        assert records["kind"].tolist() == [VOLUME]
        return int((found[room_only] > 0).sum())

    coming = [reached(frame, frame - 1) for frame in (1, 6, 7, 8, 9, 10)]
    going = [reached(frame - 1, frame) for frame in (10, 9, 8, 7, 6, 1)]
    assert coming[0] == going[-1] == 0
    assert coming == sorted(coming) == going[::-1]
    assert len(set(coming)) >= 4
    # At rest nothing is influenced, until it vanishes.
    assert len(levels(STAGE, 15, policy)[0]) == 0
    _, gone, _ = levels(STAGE, 20, policy)
    assert (gone[room_only] == 3).any()
    assert not levels(STAGE, 21, policy)[1].any()
    assert not levels(STAGE, 20, replace(policy, influence="off"))[1].any()


def test_levels_are_nested_and_near_is_higher() -> None:
    records, found, valid = levels(STAGE, 20, replace(BASE, shadows=False))
    gap = np.maximum(records["low"][0] - STAGE.lightmaps.texels["position"], 0)
    gap = np.maximum(gap, STAGE.lightmaps.texels["position"] - records["high"][0])
    distance = np.sqrt((gap.astype(np.float64) ** 2).sum(axis=1))
    means = [distance[valid & (found == level)].mean() for level in range(1, 4)]
    assert means[0] > means[1] > means[2]
    # Texels that look away from it are not reached: nothing behind the plane of the left wall, say.
    texels = STAGE.lightmaps.texels[found > 0]
    away = records["low"][0] + (records["high"][0] - records["low"][0]) / 2 - texels["position"]
    half = (records["high"][0] - records["low"][0]) / 2
    towards = (texels["normal"] * away).sum(axis=1) + (np.abs(texels["normal"]) * half).sum(axis=1)
    assert (towards > -1e-2).all()


def test_reach_is_asymmetric_by_what_faces_each_side() -> None:
    """A white plate that looks up reaches higher than low, a mirror farther, a black one only by what it hides."""

    def reach(albedo: float, surface: int, hiding: float = 0.0) -> tuple[float, float, float]:
        flat = replace(plate("flat", albedo), surface=surface, path=path_of(key(0, (0, 0, 0)), key(1, (5, 0, 0))))
        scene = room(flat, lamp())
        record = volumes(
            table_of(scene),
            scene_at(scene, 0),
            scene_at(scene, 1),
            replace(BASE, influence_hiding=hiding, shadows=False),
        )[0]
        assert record["object"] == 0
        return float(record["reach_low"][1]), float(record["reach_high"][1]), float(record["reach_high"][0])

    down, up, side = reach(0.8, DIFFUSE)
    assert down == 0
    # A rho / (pi r**2) is the least part that matters, 1/32: motion counts in full after 8 frames of 5 / 2 of its size.
    assert up == pytest.approx(np.sqrt(4 * 0.8 * 32 / np.pi), rel=1e-6)
    assert side == pytest.approx(4 * 5)  # nothing looks that way, but there it is going
    assert reach(0.8, MIRROR)[1] == pytest.approx(2 * up)
    assert reach(0.0, DIFFUSE)[1] == 0
    hidden = reach(0.0, DIFFUSE, hiding=0.5)
    assert hidden[0] == hidden[1] == pytest.approx(np.sqrt(4 * 0.5 * 32 / np.pi), rel=1e-6)


def test_slow_motion_causes_lower_levels() -> None:
    def level(step: float) -> int:
        scene = room(replace(plate("flat", 0.8), path=path_of(key(0, (0, 0, 0)), key(1, (step, 0, 0)))), lamp())
        return int(
            volumes(table_of(scene), scene_at(scene, 0), scene_at(scene, 1), replace(BASE, shadows=False))[0]["level"]
        )

    # A side is 2 long and motion adds up over 8 frames: levels 2 and 3 begin at 1/8 and 1/2 of the size.
    assert [level(step) for step in (0.01, 0.04, 0.2)] == [1, 2, 3]


def test_shadows_reach_texels_behind_what_moved_and_no_others() -> None:
    policy = replace(BASE, influence_ahead=0)
    records, found, valid = levels(STAGE, 20, policy)
    assert records["kind"].tolist() == [VOLUME, SHADOW]
    boxes = loose_bounds(TABLE, scene_at(STAGE.scene, 20), policy)
    only, _ = texel_changes(records[1:], boxes, STAGE.lightmaps, valid)
    floor = of_object(STAGE, "floor") & valid
    place = STAGE.lightmaps.texels["position"]
    # Straight from the middle of the lamp through the box to the floor: computed point by point along the way.
    low, high = records[1]["low"], records[1]["high"]
    expected = np.zeros(len(found), dtype=bool)
    for texel in np.flatnonzero(floor):
        along = np.linspace(0, 1, 2000)[:, None] * (records[1]["light"] - place[texel]) + place[texel]
        expected[texel] = ((along >= low) & (along <= high)).all(axis=1).any()
    assert 20 < expected.sum() < floor.sum()
    differs = (only > 0) != expected
    assert not (expected & (only == 0)).any()
    assert (differs & floor).sum() <= 3  # segments that touch the box between two of the points
    assert not only[of_object(STAGE, "ceiling")].any()
    assert (found >= only).all()


def test_a_light_that_goes_out_influences_all_that_it_lit() -> None:
    records, found, valid = levels(STAGE, 30, BASE)
    assert records["object"].tolist() == [LAMP]
    assert records["kind"].tolist() == [VOLUME]
    assert (found[valid & of_object(STAGE, "floor")] == 3).all()
    assert (found[valid] > 0).all()


def test_point_lights_that_move_or_change() -> None:
    scene = room(plate("flat", 0.5))
    lights = np.array([((0, 5, 0), (9, 9, 9)), ((1, 1, 1), (0.1, 0.1, 0.1))], dtype=scene.point_lights.dtype)
    scene = replace(scene, point_lights=lights)
    brighter, elsewhere = lights.copy(), lights.copy()
    brighter["intensity"][0] = 18
    elsewhere["position"][0] = (0, 5, 2)
    table, policy = table_of(scene), BASE
    usual = 4 * np.pi * 18.1 / table.total
    record = volumes(table, scene, replace(scene, point_lights=brighter), policy)
    assert record["object"].tolist() == [-1]
    assert record["reach_low"][0] == pytest.approx([np.sqrt(9 * 32 / usual)] * 3, rel=1e-6)
    record = volumes(table, scene, replace(scene, point_lights=elsewhere), policy)
    assert (record["low"][0].tolist(), record["high"][0].tolist()) == ([0, 5, 0], [0, 5, 2])
    assert len(volumes(table, scene, replace(scene, point_lights=lights.copy()), policy)) == 0


def test_records_are_bounded_and_joining_loses_no_texel() -> None:
    """All that were reached still are, and joining gives nobody more than the lowest level: it drops no value."""
    parts = [
        replace(plate(f"p{k}", 0.8), path=path_of(key(0, (6 * k, 1, 0)), key(1, (6 * k, 1.5, 0)))) for k in range(12)
    ]
    scene = room(plate("floor", 0.5, size=100.0), lamp(), *parts)
    maps = np.zeros(400, dtype=TEXEL)
    rng = np.random.default_rng(3)
    maps["position"][:, 0], maps["position"][:, 2] = rng.uniform(-10, 80, 400), rng.uniform(-10, 10, 400)
    maps["normal"], maps["state"] = (0, 1, 0), VALID
    lightmaps = replace(STAGE.lightmaps, texels=maps)
    found = []
    for most in (64, 16, 4, 2):
        policy = replace(BASE, influence_records=most)
        table = table_of(scene)
        records = volumes(table, scene_at(scene, 0), scene_at(scene, 1), policy)
        assert len(records) == min(most, 24)
        assert (records["kind"] == SHADOW).sum() == min(most, 24) // 2
        boxes = loose_bounds(table, scene_at(scene, 1), policy)
        found.append(texel_changes(records, boxes, lightmaps, np.ones(400, dtype=bool))[0])
    assert 0 < (found[0] > 0).sum() < 400
    for fewer in found[1:]:
        assert ((fewer > 0) >= (found[0] > 0)).all()
        assert (fewer <= np.maximum(found[0], 1)).all()
    assert (found[-1] <= 1).all(), "of two records of 24 both are joined"


def test_maps_out_of_reach_are_not_looked_at_texel_by_texel() -> None:
    policy = replace(BASE, influence_slack=0, shadows=False)
    records, found, _ = levels(STAGE, 4, policy)
    reached = touched(records, loose_bounds(TABLE, scene_at(STAGE.scene, 4), policy))[0]
    assert 0 < reached.sum() < len(reached)
    assert not reached[STAGE.scene.object_names.index("back wall")]
    assert set(np.unique(STAGE.lightmaps.texels["object"][found > 0])) <= set(np.flatnonzero(reached).tolist())
    absent = loose_bounds(TABLE, scene_at(STAGE.scene, 25), policy)
    everywhere = np.zeros(1, dtype=INFLUENCE)
    everywhere["low"], everywhere["high"], everywhere["surface"] = -1e6, 1e6, -1
    assert not touched(everywhere, absent)[0, GUEST]


def test_footprints_lie_where_rays_from_the_faces_meet_surfaces() -> None:
    policy = replace(BASE, influence="footprints", shadows=False)
    pair = scene_at(STAGE.scene, 19), scene_at(STAGE.scene, 20)
    trace = Structure(pair[1]).trace
    assert len(volumes(TABLE, *pair, policy)) == 0
    records, rays = footprints(TABLE, *pair, policy, trace, 1000)
    assert rays == 25  # five faces, the bottom is open, of five rays each
    assert 0 < len(records) <= rays
    assert (records["kind"] == FOOTPRINT).all()
    boxes = loose_bounds(TABLE, pair[1], policy)
    valid = STAGE.lightmaps.texels["state"] == VALID
    found, _ = texel_changes(records, boxes, STAGE.lightmaps, valid & ~of_object(STAGE, "guest"))
    assert 0 < (found > 0).sum() < valid.sum() / 2
    for record in records:
        own = found[STAGE.lightmaps.texels["object"] == record["surface"]]
        assert own.max() >= record["level"]
    # Wider spread, larger footprints; fewer rays, fewer of them; nothing moves, nothing is traced.
    wide, _ = footprints(TABLE, *pair, replace(policy, footprint_spread=1.0), trace, 1000)
    assert wide["reach_low"] == pytest.approx(2 * records["reach_low"])
    assert footprints(TABLE, *pair, policy, trace, 7)[1] == 7
    assert footprints(TABLE, *pair, replace(policy, footprint_rays=3), trace, 7)[1] == 3
    assert footprints(TABLE, pair[1], pair[1], policy, trace, 100)[1] == 0


def lamp() -> Part:
    return plate("lamp", 0.8, emission=5.0, height=10.0, up=False)


def room(*parts: Part) -> Scene:
    camera = Camera(
        position=vector((0, 5, 20)), target=vector((0, 0, 0)), up=vector((0, 1, 0)), fov_y_tan=np.float32(0.5)
    )
    return assemble(name="room", parts=parts, where="room", camera=camera, texel_size=0.5)

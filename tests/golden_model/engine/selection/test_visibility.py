"""Which texels can be seen: against what pixels really read, each test alone and all together."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import GBUFFER, HIDDEN, LIKELY, SEEN, UNSEEN
from lightloom.golden_model.driver.predicted_view import extrapolated, predicted_view
from lightloom.golden_model.engine import kernels
from lightloom.golden_model.engine.selection.neighbourhoods import Windows
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.screen_test import Sight, screen_test
from lightloom.golden_model.engine.selection.selector import coarse_to_fine
from lightloom.golden_model.engine.selection.visibility import Visibility, eye_rays
from lightloom.golden_model.numerics.floats import float_to_half, half_to_float
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.scene import Camera
from lightloom.golden_model.tables.lightmap import VALID
from tests.golden_model.selection_scenes import Stage, cornell, read_by_pixels, visited
from tests.needs import needs_numba

STAGE = cornell(24.0)
PLAIN = replace(Policy(), prediction=0)
ONLY = {
    "normal": replace(PLAIN, depth_test=False, ray_test=False),
    "depth": replace(PLAIN, normal_test=False, ray_test=False),
    "ray": replace(PLAIN, normal_test=False, depth_test=False, visibility_rays=65535),
    "normal and depth": replace(PLAIN, ray_test=False),
    "all": replace(PLAIN, visibility_rays=65535),
}


def look(
    stage: Stage, frame: int, policy: Policy, rays: int = 1 << 20, size: int = 128, ahead: int = 0
) -> tuple[Sight, int, np.ndarray]:
    """What visibility says of a frame, the rays it took, and which texels pixels read."""
    context = stage.context(frame, size)
    maps = context.lightmaps
    valid = maps.texels["state"] == VALID
    predicted = None
    if ahead:
        view = predicted_view(stage.scene, frame, size, size, policy)
        assert view is not None
        predicted = stage.draw(stage.scene.camera_at(frame + ahead), frame, view.width, view.height)
    sight, traced = Visibility(Windows(stage.lightmaps), coarse_to_fine(stage.lightmaps), policy).look(
        maps.texels,
        valid,
        context.view,
        context.gbuffer,
        context.report.texel_size,
        predicted=predicted,
        trace=context.trace,
        rays=rays,
    )
    return sight, traced, read_by_pixels(stage.lightmaps, context.gbuffer)


@pytest.mark.parametrize("frame", [0, 20, 60])
@pytest.mark.parametrize(("tests", "precise"), [*zip(ONLY, (0.75, 0.8, 0.8, 0.8, 0.8), strict=True)])
def test_what_pixels_read_is_found(tests: str, precise: float, frame: int) -> None:
    sight, traced, read = look(STAGE, frame, ONLY[tests])
    found = sight.degree >= LIKELY
    recall = (read & found).sum() / read.sum()
    precision = (read & found).sum() / found.sum()
    print(f"{tests}, frame {frame}: recall {recall:.4f}, precision {precision:.3f}, {traced} rays")
    assert recall >= 0.99
    assert precision >= precise
    assert (traced > 0) == ("ray" in tests or tests == "all")


def test_the_cascade_asks_rays_only_about_what_is_in_doubt() -> None:
    without, _, _ = look(STAGE, 20, replace(ONLY["normal and depth"], near_seen=0))
    cascade, traced, read = look(STAGE, 20, replace(ONLY["all"], near_seen=0))
    alone, all_rays, _ = look(STAGE, 20, replace(ONLY["ray"], near_seen=0))
    doubtful = without.degree == LIKELY
    assert traced == doubtful.sum() < all_rays / 10
    assert (cascade.degree[~doubtful] == without.degree[~doubtful]).all()
    assert not (cascade.degree == LIKELY).any()
    # Where rays are asked they decide as rays alone do, and that is right more often than not.
    assert (cascade.degree[doubtful] == alone.degree[doubtful]).all()
    assert ((cascade.degree == SEEN) & read).sum() > ((without.degree == SEEN) & read).sum()


def test_rays_are_capped_and_take_turns() -> None:
    context = STAGE.context(20, 128)
    valid = STAGE.lightmaps.texels["state"] == VALID
    policy = replace(ONLY["all"], near_seen=0)
    visibility = Visibility(Windows(STAGE.lightmaps), coarse_to_fine(STAGE.lightmaps), policy)

    def again(rays: int) -> tuple[np.ndarray, int]:
        sight, traced = visibility.look(
            STAGE.lightmaps.texels,
            valid,
            context.view,
            context.gbuffer,
            STAGE.scene.texel_size,
            trace=context.trace,
            rays=rays,
        )
        return sight.degree, traced

    doubtful = again(0)[0] == LIKELY
    count = int(doubtful.sum())
    assert count > 20
    decided = np.zeros(len(valid), dtype=bool)
    for _ in range(-(-count // 10)):
        degree, traced = again(10)
        assert traced == 10
        assert (doubtful & (degree != LIKELY)).sum() == 10
        decided |= doubtful & (degree != LIKELY)
    assert (decided == doubtful).all()


def test_degrees_of_a_plate_behind_a_plate() -> None:
    """Two squares in view: the far one is hidden behind the near one but for its rim."""
    context = visited(50.0).context(0, 32)
    view = replace(
        context.view,
        position=vector((0, 0, 0)),
        right=vector((1, 0, 0)),
        up=vector((0, 1, 0)),
        forward=vector((0, 0, -1)),
        focal=np.float32(16),
        near=np.float32(0.01),
    )
    gbuffer = np.zeros((32, 32), dtype=GBUFFER)
    gbuffer["depth"], gbuffer["normal"] = 8, (0, 0, 1)
    gbuffer["depth"][8:24, 8:24] = 4
    position = np.array([[0, 0, -4], [0, 0, -8], [7, 0, -8], [0, 0, -8], [20, 0, -8], [0, 0, 3]], dtype=np.float32)
    normal = np.array([[0, 0, 1]] * 3 + [[0, 0, -1]] + [[0, 0, 1]] * 2, dtype=np.float32)
    sight = screen_test(position, normal, view, gbuffer, 0.1, PLAIN)
    assert sight.degree.tolist() == [SEEN, HIDDEN, SEEN, UNSEEN, UNSEEN, UNSEEN]
    # Slightly behind is in doubt, and so is what is nearer than anything that was drawn.
    behind = np.array([[0, 0, -4.1], [0, 0, -4.5], [0, 0, -3]], dtype=np.float32)
    assert screen_test(behind, normal[:3], view, gbuffer, 0.2, PLAIN).degree.tolist() == [LIKELY, HIDDEN, LIKELY]
    tilted = np.array([[0.6, 0, 0.8]], dtype=np.float32)
    assert screen_test(position[:1], tilted, view, gbuffer, 0.1, PLAIN).degree.tolist() == [LIKELY]
    assert screen_test(behind[2:], tilted, view, gbuffer, 0.2, PLAIN).degree.tolist() == [HIDDEN]
    # A surface seen at a slant is as deep as its slope says over one pixel: 0.6 / 0.8 * 4 / 16 = 0.19.
    gbuffer["normal"] = tilted
    shifted = np.array([[0, 0, -4.18], [0, 0, -4.6]], dtype=np.float32)
    loose = replace(PLAIN, depth_texels=0, depth_limit=1.0)
    slanted = screen_test(shifted, tilted.repeat(2, axis=0), view, gbuffer, 0.0, loose)
    assert slanted.degree.tolist() == [SEEN, LIKELY]


NUMBERS = np.array([0, -0.0, 2.0**-140, -(2.0**-126), 1, -1, 3e38, -3e38, np.inf, -np.inf, np.nan], dtype=np.float32)
"""Of operands that no scene has."""


@needs_numba
@pytest.mark.parametrize("seed", range(12))
def test_the_compiled_twin_says_the_same(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Texels in sight and out of it, at borders and depths of pixels; from the eighth seed on also any numbers."""
    monkeypatch.setattr(kernels, "PORTION", 700)
    twin = kernels.Kernels("numba", threads=1 + seed % 2).screen_test
    rng = np.random.default_rng(seed)
    view = STAGE.context(0, 48).view
    gbuffer = np.zeros((view.height, view.width), dtype=GBUFFER)
    gbuffer["depth"] = rng.choice([2, 4, 4.01, 8, np.inf], gbuffer.shape)
    gbuffer["normal"] = rng.choice([(0, 0, 1), (0.6, 0, 0.8), (0, 0.8, 0.6), (-0.3, 0.9, 0.1)], gbuffer.shape)
    gbuffer["lod"] = rng.integers(-(2**9), 2**11, gbuffer.shape)
    # Out from the eye through some place of the picture or beside it, on a pixel's border every other time.
    at = rng.uniform(-0.6, 0.6, (4000, 2)) * (view.width, view.height)
    at[::2] = np.rint(at[::2] * 2) / 2
    depth = rng.choice([2, 4, 4.02, 8], len(at)) * rng.choice([1, 1, 1.001, 0.99, -1], len(at))
    local = np.stack([at[:, 0] / view.focal * depth, at[:, 1] / view.focal * depth, depth], axis=1)
    position = (view.position + local @ np.stack([view.right, view.up, view.forward])).astype(np.float32)
    normal = (gbuffer["normal"].reshape(-1, 3)[rng.integers(gbuffer.size, size=len(at))]).astype(np.float32)
    if seed >= 8:
        for values in (position, normal, gbuffer["depth"], gbuffer["normal"]):
            odd = rng.random(values.shape) < 0.05
            values[odd] = rng.choice(NUMBERS, int(odd.sum()))
    degrees = set()
    for by_normal, by_depth in ((1, 1), (1, 0), (0, 1), (0, 0)):
        rules = replace(
            PLAIN,
            normal_test=bool(by_normal),
            depth_test=bool(by_depth),
            facing_slack=float(rng.choice([0, 0.25, 1])),
            depth_limit=float(rng.choice([0, 0.1, 1])),
        )
        size = float(rng.choice([0, 0.02, 0.5]))
        valid = None if by_normal and by_depth else rng.random(len(at)) < 0.9
        one, two = (test(position, normal, view, gbuffer, size, rules, valid) for test in (screen_test, twin))
        assert valid is None or not (one.degree[~valid].any() or one.lod[~valid].any())
        wrong = np.flatnonzero((one.degree != two.degree) | (one.lod != two.lod))
        assert not len(wrong), f"seed {seed}, {rules}, texel {wrong[0]}: {position[wrong[0]]}, {normal[wrong[0]]}"
        degrees |= set(one.degree.tolist())
    assert degrees == {UNSEEN, HIDDEN, LIKELY, SEEN}


@needs_numba
def test_the_compiled_twin_rounds_to_binary16() -> None:
    """Any pattern, and those beside halves of a unit, from the smallest subnormal to infinity."""
    from lightloom.golden_model.engine.selection.screen_test_numba import half

    seed = 5
    rng = np.random.default_rng(seed)
    halves = np.arange(0x7C00).astype(np.uint16).view(np.float16).astype(np.float32)
    ties = np.concatenate([(halves[1:] + halves[:-1]) / 2, halves, [65519.99, 65520, 65536, 3e38]]).astype(np.float32)
    near = np.concatenate([ties, np.nextafter(ties, np.float32(np.inf)), np.nextafter(ties, np.float32(0))])
    any_number = rng.integers(0, 1 << 32, 20000, dtype=np.uint32).view(np.float32)
    for number in (near, -near, any_number, NUMBERS):
        wanted = half_to_float(float_to_half(number))
        found = np.array([half(value) for value in number], dtype=np.float32)
        same = (found.view(np.uint32) == wanted.view(np.uint32)) | (np.isnan(found) & np.isnan(wanted))
        assert same.all(), f"seed {seed}: {number[~same][:3]}, {found[~same][:3]}, not {wanted[~same][:3]}"


def test_level_of_detail_comes_from_the_gbuffer() -> None:
    """Half the pixels: a level more. What is only near a seen texel has the level of that one."""
    levels = []
    for size in (256, 64, 16):  # at 64 a texel is about half a pixel, at 16 a quarter of that
        sight, _, _ = look(STAGE, 0, PLAIN, size=size)
        levels.append(float(sight.lod[sight.degree == SEEN].mean()))
        assert (sight.lod[sight.degree < LIKELY] == 0).all()
    assert levels[0] == 0
    assert 0.5 < levels[1] < 1.2
    assert 1.7 < levels[2] < 3
    few, _, _ = look(STAGE, 0, replace(PLAIN, lod_levels=1), size=16)
    assert few.lod.max() == 1


def test_texels_about_to_appear_are_likely() -> None:
    policy = replace(PLAIN, prediction=20)
    plain, _, _ = look(STAGE, 60, policy)
    ahead, _, _ = look(STAGE, 60, policy, ahead=20)
    _, _, later = look(STAGE, 80, policy)
    new = later & (plain.degree < LIKELY)
    assert new.sum() > 150
    assert (ahead.degree[new] == LIKELY).all()
    marked = (ahead.degree == LIKELY) & (plain.degree < LIKELY)
    assert later[marked].mean() > 0.35
    assert (ahead.degree >= plain.degree).all()
    assert (ahead.degree == SEEN).sum() == (plain.degree == SEEN).sum()


def test_eye_rays_end_at_the_eye() -> None:
    context = STAGE.context(0)
    texels = STAGE.lightmaps.texels[:5]
    rays = eye_rays(texels["position"], context.view)
    assert (rays["origin"] == texels["position"]).all()
    assert np.allclose(rays["origin"] + rays["direction"], context.view.position)
    assert (rays["t_max"] == 1).all()


def test_viewpoints_to_come() -> None:
    scene = STAGE.scene
    known = predicted_view(scene, 20, 64, 48, Policy(prediction=10))
    assert known is not None
    assert (known.width, known.height) == (16, 12)
    assert (known.position == scene.camera_at(30).position).all()
    guessed = predicted_view(scene, 20, 64, 48, Policy(prediction=10, prediction_known=False))
    assert guessed is not None
    # The path is straight from frame 0 to 30, so the guess is right up to rounding.
    assert np.allclose(guessed.position, known.position, atol=1e-2)
    assert predicted_view(scene, 20, 64, 48, Policy(prediction=0)) is None
    assert predicted_view(replace(scene, camera_path=()), 20, 64, 48, Policy()) is None
    camera = Camera(
        position=vector((0, 0, 0)), target=vector((0, 0, -1)), up=vector((0, 1, 0)), fov_y_tan=np.float32(1)
    )
    moved = replace(camera, position=vector((1, 0, 0)))
    assert extrapolated(camera, moved, 4).position.tolist() == [5, 0, 0]

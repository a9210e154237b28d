"""The rasterizer: exact coverage, depth and attributes, against counting and against rays through pixel centres."""

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.frame import clipping
from lightloom.golden_model.frame.clipping import clip_triangles
from lightloom.golden_model.frame.rasterizer import level_of_detail, rasterize
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.vectors import interpolate, normalize
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.tables.pinhole import View, look_at, pixel_rays, to_view
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests

UP = np.array([0, 1, 0], dtype=np.float32)


def triangles_of(corners: np.ndarray) -> np.ndarray:
    """(T, 3, 3) to TRIANGLE (T,)."""
    out = np.zeros(len(corners), dtype=TRIANGLE)
    for k, name in enumerate(("v0", "v1", "v2")):
        out[name] = corners[:, k]
    return out


def draw(view: View, triangles: np.ndarray) -> np.ndarray:
    """The G-buffer with x and y of the corners as lightmap coordinates and one object a triangle."""
    corners = np.stack([triangles["v0"], triangles["v1"], triangles["v2"]], axis=1)
    normals = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), corners.shape)
    return rasterize(view, triangles, normals, np.arange(len(triangles)), np.ascontiguousarray(corners[..., :2]))


def sheet(rng: np.random.Generator, n: int, rough: float = 0.0) -> np.ndarray:
    """A closed sheet over [-1, 1]^2 of 2 n^2 triangles with random windings and random inner vertices."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    points = np.stack([x, y, rng.uniform(-rough, rough, x.shape)], axis=-1).astype(np.float32)
    points[1:-1, 1:-1, :2] += rng.uniform(-0.3 / n, 0.3 / n, (n - 1, n - 1, 2)).astype(np.float32)
    a, b, c, d = (p.reshape(-1, 3) for p in (points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]))
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    swap = rng.random(len(corners)) < 0.5
    corners[swap] = corners[swap][:, ::-1]
    return triangles_of(corners)


def coverage(view: View, triangles: np.ndarray) -> np.ndarray:
    """How many triangles cover each pixel, each drawn on its own."""
    total = np.zeros((view.height, view.width), dtype=int)
    for k in range(len(triangles)):
        total += draw(view, triangles[k : k + 1])["primitive"] >= 0
    return total


@pytest.mark.parametrize("seed", range(3))
def test_each_pixel_of_a_sheet_is_covered_exactly_once(seed: int) -> None:
    view = look_at(np.array([0.1, -0.2, 2]), np.array([0, 0.1, 0]), UP, 0.3, 61, 47)
    total = coverage(view, sheet(np.random.default_rng(seed), 9, rough=0.02))
    assert (total == 1).all(), f"seed {seed}: pixels {np.argwhere(total != 1)[:4].tolist()}"


def test_vertices_and_edges_on_pixel_centres_belong_to_one_triangle() -> None:
    """Every vertex on a pixel centre, so that the top-left rule decides for all inner ones."""
    view = look_at(np.array([0, 0, 8]), np.zeros(3), UP, 1.0, 16, 16)  # one unit of the plane z = 0 is a pixel
    x, y = np.meshgrid(np.arange(-7.5, 8), np.arange(-7.5, 8), indexing="ij")
    p = np.stack([x, y, np.zeros_like(x)], axis=-1).astype(np.float32)
    a, b, c, d = (q.reshape(-1, 3) for q in (p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]))
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    total = coverage(view, triangles_of(corners))
    # The rule gives a top or left border to the sheet, a bottom or right one to what lies beyond.
    assert (total[:-1, :-1] == 1).all()
    assert (total[-1] == 0).all()
    assert (total[:, -1] == 0).all()


@pytest.mark.parametrize("seed", range(3))
def test_agrees_with_rays_through_pixel_centres(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1, 1, (60, 1, 3))
    triangles = triangles_of((centres + rng.normal(scale=0.4, size=(60, 3, 3))).astype(np.float32))
    view = look_at(np.array([0.3, 0.5, 4]), np.array([0, 0, 0]), UP, 0.4, 96, 80)
    seen = draw(view, triangles).reshape(-1)

    prepared = ray_setup(pixel_rays(view))
    nearest = np.full(len(prepared), np.inf, dtype=np.float32)
    primitive = np.full(len(prepared), -1)
    front = np.zeros(len(prepared), dtype=bool)
    uv = np.zeros((len(prepared), 2), dtype=np.float32)
    for k in range(len(triangles)):
        hit = ray_triangle(triangle_tests(prepared, np.broadcast_to(triangles[k], len(prepared))))
        closer = hit["hit"] & (hit["t"] < nearest)
        nearest[closer], primitive[closer], front[closer] = hit["t"][closer], k, hit["front"][closer]
        uv[closer] = np.stack([hit["u"], hit["v"]], axis=1)[closer]

    same = seen["primitive"] == primitive
    assert same.mean() >= 0.985, f"seed {seed}: {same.mean()}"  # 60 scattered triangles: mostly silhouettes
    image = primitive.reshape(80, 96)
    edge = np.zeros_like(image, dtype=bool)
    for axis in (0, 1):
        change = np.diff(image, axis=axis) != 0
        edge |= np.pad(change, [(0, 1) if a == axis else (0, 0) for a in (0, 1)])
        edge |= np.pad(change, [(1, 0) if a == axis else (0, 0) for a in (0, 1)])
    assert (same | edge.reshape(-1)).mean() >= 0.999, f"seed {seed}"

    both = same & (primitive >= 0)
    assert both.sum() > 1000
    assert (seen["front"] == front)[both].all()
    # Snapping moves a point by 1/512 of a pixel at most, so by little where the triangle is not seen edge-on.
    depth_error = np.abs(seen["depth"][both] - nearest[both]) / nearest[both]
    assert np.median(depth_error) < 2e-5
    assert np.quantile(depth_error, 0.99) < 2e-3
    uv_error = np.abs(np.stack([seen["u"], seen["v"]], axis=1) - uv)[both].max(axis=1)
    assert np.quantile(uv_error, 0.99) < 2e-2
    corner = triangles[primitive[both]]
    u, v = uv[both].T[..., None]
    expected = ((1 - u - v) * corner["v0"] + u * corner["v1"] + v * corner["v2"])[:, :2]
    assert np.quantile(np.abs(seen["lightmap"][both] - expected), 0.99) < 1e-2


@pytest.mark.parametrize("frame", [0, 30, 60])
def test_cornell_box_agrees_with_the_tracer(frame: int) -> None:
    """The same primitive at 99.9 % of the pixels, the others on its border; the same depth, coordinates and normal."""
    scene = cornell_box()
    camera = scene.camera_at(frame)
    view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, 160, 120)
    uv = np.ascontiguousarray(scene.corners[..., [0, 2]])
    seen = rasterize(view, scene.triangles, scene.normals, scene.object_id, uv)
    hits = trace(build(scene.triangles), pixel_rays(view)).reshape(seen.shape)
    same = seen["primitive"] == hits["primitive"]
    assert same.mean() >= 0.999
    for y, x in np.argwhere(~same):
        around = hits["primitive"][max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        assert seen["primitive"][y, x] in around, (frame, y, x)

    both = same & (hits["primitive"] >= 0)
    pixel, hit = seen[both], hits[both]
    assert (pixel["object"] == scene.object_id[hit["primitive"]]).all()
    assert (pixel["front"] == hit["front"]).all()
    assert np.quantile(np.abs(pixel["depth"] / hit["t"] - 1), 0.999) < 1e-3
    corner, normals = scene.corners[hit["primitive"]], scene.normals[hit["primitive"]]
    normal = normalize(interpolate(normals[:, 0], normals[:, 1], normals[:, 2], hit["u"], hit["v"]))
    assert np.abs(pixel["normal"] - normal).max() < 1e-4  # two walls are not quite flat
    place = interpolate(corner[:, 0], corner[:, 1], corner[:, 2], hit["u"], hit["v"])[:, [0, 2]]
    assert np.quantile(np.abs(pixel["lightmap"] - place), 0.999) < 1.0  # of 556; a pixel is about 7


def test_floor_through_the_eye_is_clipped_at_the_near_plane() -> None:
    """A floor from behind the eye to far away: the lower half of the picture sees it, with the depth of geometry."""
    corners = np.array(
        [[[-900, -1, 900], [900, -1, 900], [900, -1, -900]], [[-900, -1, 900], [900, -1, -900], [-900, -1, -900]]]
    )
    view = look_at(np.zeros(3), np.array([0, 0, -1]), UP, 1.0, 64, 64)
    seen = draw(view, triangles_of(corners.astype(np.float32)))
    assert (seen["primitive"][32:] >= 0).all()
    assert (seen["primitive"][:32] == -1).all()
    row = np.arange(32, 64)
    depth = 32 / (row + 0.5 - 32)  # eye height 1 over the slope of the row
    assert np.allclose(seen["depth"][32:], depth[:, None], rtol=2e-3)
    assert (coverage(view, triangles_of(corners.astype(np.float32)))[32:] == 1).all()


def test_triangles_crossing_near_plane_and_guard_band_leave_no_cracks() -> None:
    """A room of many triangles around the eye: every pixel sees exactly one triangle of the wall."""
    rng = np.random.default_rng(7)
    flat = sheet(rng, 4)
    faces = []
    for turn in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        for side in (-1, 1):
            corner = np.stack([flat["v0"], flat["v1"], flat["v2"]], axis=1)
            corner[..., 2] = side
            faces.append(corner[..., turn])
    corners = np.concatenate(faces).astype(np.float32)
    for target in ([0.3, 0.2, -1], [1, 0.9, 0.1], [-0.2, -1, 0.05]):
        # Very near to one wall and looking along it: coordinates far outside the picture.
        view = look_at(np.array([0.98, 0.3, 0.1]), np.array([0.98, 0.3, 0.1]) + target, UP, 0.7, 40, 30)
        total = coverage(view, triangles_of(corners))
        assert (total >= 1).all(), np.argwhere(total < 1)[:4]
        assert (total == 1).mean() > 0.9  # an eye inside a convex room sees each wall once but for shared borders


def plane(half: float, height: float) -> np.ndarray:
    """A square about the origin that looks up, (2, 3, 3) float32."""
    corners = np.array([[-half, height, half], [half, height, half], [half, height, -half], [-half, height, -half]])
    return corners[[[0, 1, 2], [0, 2, 3]]].astype(np.float32)


@pytest.mark.parametrize("half", [1e4, 1e5, 3e5, 1e6, 1e7])
@pytest.mark.parametrize("distance", [4, 0.1])
def test_a_huge_plane_hides_nothing_before_it(half: float, distance: float) -> None:
    """A ground 1 m below a floor: it is where it belongs, but for 2**-22 of how far off its corners are.

    The near plane lies at 2**-10 of the distance; edges through it are up to 2 * 10**11 times as long as it is deep.
    """
    seed = 13
    rng = np.random.default_rng(seed)
    eye = np.array([0, 1.5, 2.8])
    for _ in range(6):
        toward = np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.6, -0.2), -1])
        view = look_at(eye, eye + distance * toward / np.linalg.norm(toward), UP, 0.4, 64, 48)
        floor = triangles_of(plane(3, 0))
        seen = draw(view, np.concatenate([floor, triangles_of(plane(half, -1))]))
        expected = draw(view, floor)["primitive"] >= 0
        assert ((seen["primitive"] < 2) & (seen["primitive"] >= 0))[expected].all(), f"seed {seed}, {toward.tolist()}"
        ground = seen["primitive"] >= 2
        down = -pixel_rays(view)["direction"].reshape(*ground.shape, 3)[..., 1].astype(np.float64)
        assert (down[ground] > 0).all(), f"seed {seed}, {toward.tolist()}: ground above the horizon"
        # Where it is looked at from above: towards the horizon a 512th of a pixel is many metres.
        steep = ground & (down > 0.2)
        height = seen["depth"][steep].astype(np.float64) * down[steep]
        assert np.abs(height - 2.5).max(initial=0) < 0.01 + 2.0**-22 * np.sqrt(2) * half, f"seed {seed}, {toward}"


@pytest.mark.parametrize("half", [1e4, 1e6, 1e8])
def test_clipped_points_stay_within_24_bits(half: float) -> None:
    """Of huge triangles anywhere about the eye too: within 2**15 pixels with 8 bits of a pixel, and a sign."""
    seed = 14
    view = look_at(np.zeros(3), np.array([0.2, -0.1, -1]), UP, 0.4, 8192, 4320)
    corners = (np.random.default_rng(seed).normal(size=(2000, 3, 3)) * [half, 1, half]).astype(np.float32)
    points, _, primitive = clip_triangles(to_view(view, corners), view)
    assert len(np.unique(primitive)) > 500
    x, y, z = np.moveaxis(points.astype(np.float64), -1, 0)
    assert z.min() >= 0.9 * view.near, f"seed {seed}"
    for across, side in ((x, view.width), (y, view.height)):
        assert np.abs(across * view.focal / z).max() + side / 2 < 2**15, f"seed {seed}"


def test_points_of_ordinary_triangles_are_clipped_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is brought back, down to the last bit: a box about the eye, and a floor of 2 km through it."""
    scene = cornell_box()
    eye = scene.camera_at(0).target
    view = look_at(eye, eye + np.array([0.3, 0.1, 0.2], dtype=np.float32), UP, 0.5, 64, 48)
    corners = to_view(view, np.concatenate([scene.corners, plane(1e3, 273)]))
    points, _, primitive = clip_triangles(corners, view)
    assert len(primitive) > len(np.unique(primitive)) > 8, "some are cut"
    monkeypatch.setattr(clipping, "_brought_back", lambda polygons, view, planes: polygons)
    assert clip_triangles(corners, view)[0].tobytes() == points.tobytes()


def test_nothing_is_drawn_of_what_cannot_be_seen() -> None:
    view = look_at(np.array([0, 0, 4]), np.zeros(3), UP, 0.5, 32, 32)
    good = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], dtype=np.float32)
    behind, aside, flat, point = good.copy(), good.copy(), good.copy(), good.copy()
    behind[:, 2] = 9
    aside[:, 0] += 50
    flat[2] = (flat[0] + flat[1]) / 2
    point[:] = point[0]
    broken = [good.copy() for _ in range(3)]
    broken[0][1, 0], broken[1][2, 2], broken[2][0, 1] = np.nan, np.inf, -np.inf
    seen = draw(view, triangles_of(np.stack([behind, aside, flat, point, *broken])))
    assert (seen["primitive"] == -1).all()
    assert (seen["object"] == -1).all()
    assert np.isinf(seen["depth"]).all()
    assert not seen["lod"].any()
    assert (draw(view, triangles_of(good[None]))["primitive"] >= 0).any()
    assert (draw(view, triangles_of(good[None])[:0])["primitive"] == -1).all()


def test_equal_depth_goes_to_the_lower_primitive_and_nearer_wins() -> None:
    view = look_at(np.array([0, 0, 4]), np.zeros(3), UP, 0.5, 32, 32)
    good = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], dtype=np.float32)
    nearer = good + np.array([0, 0, 1], dtype=np.float32)
    seen = draw(view, triangles_of(np.stack([good, good, good[[0, 2, 1]]])))
    assert set(np.unique(seen["primitive"])) == {-1, 0}
    assert seen["front"][seen["primitive"] == 0].all()
    seen = draw(view, triangles_of(np.stack([good, nearer])))
    assert seen["primitive"][16, 16] == 1
    assert seen["depth"][16, 16] == pytest.approx(3, rel=1e-6)
    back = draw(view, triangles_of(good[None, [0, 2, 1]]))
    assert not back["front"].any()


def test_level_of_detail_is_texels_per_pixel() -> None:
    """A plane seen straight on, s texels a unit: 32 pixels a unit at this distance."""
    view = look_at(np.array([0, 0, 2]), np.zeros(3), UP, 0.5, 64, 64)
    corners = np.array([[[-9, -9, 0], [9, -9, 0], [0, 9, 0]]], dtype=np.float32)
    triangle = triangles_of(corners)
    normals = np.broadcast_to(np.array([0, 0, 1], dtype=np.float32), (1, 3, 3))
    for texels in (8, 64, 256):
        uv = corners[..., :2] * np.float32(texels)
        seen = rasterize(view, triangle, normals, np.zeros(1, dtype=np.int32), uv)
        assert (
            np.abs(seen["lod"] / 256 - np.log2(texels / 32)).max() <= 0.01
        )  # powers of two are exact but for snapping


def test_level_of_detail_logarithm() -> None:
    """Against NumPy's logarithm, within the stated bound."""
    rng = np.random.default_rng(3)
    gradient = (rng.normal(size=(2000, 2)) * np.exp2(rng.uniform(-20, 20, (2000, 1)))).astype(np.float32)
    small = gradient * np.float32(0.5)
    exact = np.log2(np.hypot(*gradient.astype(np.float64).T))
    for lod in (level_of_detail(gradient, small), level_of_detail(small, gradient)):
        error = exact - lod / 256
        assert error.min() > -1e-6
        assert error.max() < 0.044 + 1 / 256
    assert level_of_detail(np.zeros((1, 2), np.float32), np.zeros((1, 2), np.float32)) == -16256


def test_a_camera_that_cannot_look_is_refused() -> None:
    with pytest.raises(InputError, match="camera"):
        look_at(np.zeros(3), np.zeros(3), UP, 0.5, 8, 8)
    with pytest.raises(InputError, match="camera"):
        look_at(np.zeros(3), UP, UP, 0.5, 8, 8)
    with pytest.raises(InputError, match="--size"):
        look_at(np.zeros(3), np.array([1, 0, 0]), UP, 0.5, 0, 8)

"""Mirrors and glass against the laws of optics, hits against the maps, direct light against the formula."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.contract.engine_image import GLASS, MIRROR
from lightloom.golden_model.contract.formats import HIT, RAY
from lightloom.golden_model.numerics.vectors import interpolate
from lightloom.golden_model.rays.hit_shading import direct_at_hits, direct_light, fresnel, scatter, shade_rays
from lightloom.golden_model.rays.surface_shading import CoarseSurfaces, diffuse_radiance
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from tests.golden_model.frame_scenes import ball, flat_light, geometry_of, quad, room, scene_of, seen_from

SQUARE = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]  # faces +z


def pane(surface: int, ior: float = 1.5, albedo: float = 1.0) -> Scene:
    return scene_of([quad("pane", SQUARE, albedo, surface=surface, ior=ior)])


def aimed(scene: Scene, origin: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays from `origin` to points `target`, both (N, 3), and their hits."""
    rays = np.zeros(len(target), dtype=RAY)
    rays["origin"], rays["direction"], rays["t_max"] = origin, target - origin, np.inf
    return rays, trace(build(scene.triangles), rays)


def keys(count: int) -> np.ndarray:
    return np.arange(count, dtype=np.uint32)


def exact_fresnel(cosine: np.ndarray, eta: np.ndarray | np.floating) -> np.ndarray:
    """In float64, from the angles' sines: 1 where all is reflected."""
    sine2 = eta**2 * (1 - cosine**2)
    inner = np.sqrt(np.maximum(1 - sine2, 0))
    s = (eta * cosine - inner) / (eta * cosine + inner)
    p = (cosine - eta * inner) / (cosine + eta * inner)
    return np.where(sine2 >= 1, 1.0, (s * s + p * p) / 2)


@pytest.mark.parametrize("side", [1, -1])
def test_a_flat_mirror_reflects_by_the_law_and_tints(side: int) -> None:
    scene = pane(MIRROR, albedo=0.25)
    rng = np.random.default_rng(0)
    target = np.concatenate([rng.uniform(-0.9, 0.9, (200, 2)), np.zeros((200, 1))], axis=1)
    origin = np.concatenate([rng.uniform(-3, 3, (200, 2)), np.full((200, 1), 2.0 * side)], axis=1)
    rays, hits = aimed(scene, origin, target)
    assert (hits["front"] == (side > 0)).all()
    tint = np.full((200, 3), 0.25, dtype=np.float32)
    onward = scatter(geometry_of(scene), rays["direction"], hits, tint, keys(200), both=True)
    assert (onward.parent == np.arange(200)).all()
    assert (onward.weight == 0.25).all()
    expected = (target - origin) * [1, 1, -1]
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    assert np.abs(onward.rays["direction"] - expected).max() < 1e-6
    assert (onward.rays["origin"][:, 2] * side > 0).all(), "the new ray starts on the side that was hit"
    assert np.abs(onward.rays["origin"] - target).max() < 1e-4


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5, 2.4])
def test_fresnel_reflectance_against_the_exact_formula(ior: float) -> None:
    cosine = np.linspace(1e-3, 1, 2001).astype(np.float32)
    for eta in (np.float32(1) / np.float32(ior), np.float32(ior)):
        computed = fresnel(cosine, np.broadcast_to(eta, cosine.shape))
        exact = exact_fresnel(cosine.astype(np.float64), np.float64(eta))
        critical = np.abs(float(eta) ** 2 * (1 - cosine.astype(np.float64) ** 2) - 1) < 1e-3  # infinitely steep there
        assert np.abs(computed - exact)[~critical].max() < 2e-5
        assert (computed >= 0).all()
        assert (computed <= 1).all()
    normal = ((ior - 1) / (ior + 1)) ** 2
    assert fresnel(np.ones(1, np.float32), np.full(1, 1 / ior, np.float32))[0] == pytest.approx(normal, abs=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_glass_bends_by_snell_and_splits_by_fresnel(side: int) -> None:
    scene = pane(GLASS, ior=1.5, albedo=0.5)
    rng = np.random.default_rng(1)
    count = 400
    target = np.concatenate([rng.uniform(-0.9, 0.9, (count, 2)), np.zeros((count, 1))], axis=1)
    origin = np.concatenate([rng.uniform(-4, 4, (count, 2)), np.full((count, 1), 1.0 * side)], axis=1)
    rays, hits = aimed(scene, origin, target)
    tint = np.full((count, 3), 0.5, dtype=np.float32)
    onward = scatter(geometry_of(scene), rays["direction"], hits, tint, keys(count), both=True)
    through = np.sign(onward.rays["direction"][:, 2]) == -side

    d = (target - origin) / np.linalg.norm(target - origin, axis=1)[:, None]
    eta = 1 / 1.5 if side > 0 else 1.5
    sine = np.hypot(d[:, 0], d[:, 1])
    inside = eta * sine < 1 - 1e-4
    assert set(onward.parent[through]) >= set(np.flatnonzero(inside))
    assert (np.bincount(onward.parent, minlength=count) == 1 + inside).mean() > 0.99  # total reflection sends one
    parent = onward.parent[through]
    assert np.abs(onward.rays["direction"][through][:, :2] - eta * d[parent][:, :2]).max() < 1e-5
    assert np.abs(np.linalg.norm(onward.rays["direction"], axis=1) - 1).max() < 1e-5
    reflectance = exact_fresnel(np.abs(d[:, 2]), np.full(count, eta))
    safe = np.abs(eta * sine - 1) > 1e-3
    for rows, expected in ((~through, reflectance), (through, 0.5 * (1 - reflectance))):
        own = onward.parent[rows]
        error = np.abs(onward.weight[rows, 0] - expected[own])[safe[own]]
        assert error.max() < 1e-4


def test_one_ray_of_glass_is_chosen_as_often_as_the_reflectance_says() -> None:
    scene = pane(GLASS)
    count = 20_000
    rays, hits = aimed(scene, np.tile([[3.0, 0, 1]], (count, 1)), np.tile([[0.1, 0.2, 0]], (count, 1)))
    onward = scatter(
        geometry_of(scene), rays["direction"], hits, np.ones((count, 3), np.float32), keys(count), both=False
    )
    assert (onward.parent == np.arange(count)).all()
    assert (onward.weight == 1).all()
    d = rays["direction"][0] / np.linalg.norm(rays["direction"][0])
    expected = exact_fresnel(np.array([abs(d[2])]), np.array([1 / 1.5]))[0]
    share = (onward.rays["direction"][:, 2] > 0).mean()
    assert abs(share - expected) < 4 * np.sqrt(expected * (1 - expected) / count), f"{share} instead of {expected}"


def test_a_slab_of_glass_only_shifts_what_is_behind_it() -> None:
    front = quad("front", [(x, y, 0.2) for x, y, _ in SQUARE], 1.0, surface=GLASS)
    back = quad("back", [(x, y, -0.2) for x, y, _ in SQUARE[::-1]], 1.0, surface=GLASS)
    scene = scene_of([front, back])
    bvh, geometry = build(scene.triangles), geometry_of(scene)
    rng = np.random.default_rng(2)
    target = np.concatenate([rng.uniform(-0.4, 0.4, (100, 2)), np.full((100, 1), 0.2)], axis=1)
    rays, hits = aimed(scene, np.array([[0.3, -0.2, 3.0]]), target)
    start = rays["direction"] / np.linalg.norm(rays["direction"], axis=1)[:, None]
    for wave in range(2):
        onward = scatter(
            geometry, rays["direction"], hits, np.ones((len(hits), 3), np.float32), keys(len(hits)), both=True
        )
        rays = onward.rays[onward.rays["direction"][:, 2] < 0]
        hits = trace(bvh, rays)
        assert (hits["primitive"] >= 0).all() == (wave == 0)
    assert len(rays) == 100
    assert np.abs(rays["direction"] - start).max() < 1e-5


@pytest.mark.parametrize("surface", [MIRROR, GLASS])
@pytest.mark.parametrize("seed", range(3))
def test_new_rays_leave_a_smooth_sphere_on_the_right_side(surface: int, seed: int) -> None:
    """Of 1280 triangles with smooth normals, from outside at all angles: reflected rays go up, refracted ones down."""
    scene = scene_of([ball("ball", (0, 0, 0), 1.0, 1.0, surface)])
    rng = np.random.default_rng(seed)
    origin = rng.normal(size=(4000, 3))
    origin *= 3 / np.linalg.norm(origin, axis=1)[:, None]
    aim = rng.normal(size=(4000, 3))
    aim *= rng.uniform(0.6, 0.999, (4000, 1)) / np.linalg.norm(aim, axis=1)[:, None]
    rays, hits = aimed(scene, origin, aim)
    rays, hits = rays[hits["primitive"] >= 0], hits[hits["primitive"] >= 0]
    assert hits["front"].all()
    onward = scatter(
        geometry_of(scene), rays["direction"], hits, np.ones((len(hits), 3), np.float32), keys(len(hits)), both=True
    )
    triangle = scene.triangles[hits["primitive"][onward.parent]]
    wall = np.cross(triangle["v1"] - triangle["v0"], triangle["v2"] - triangle["v0"]).astype(np.float64)
    wall /= np.linalg.norm(wall, axis=1)[:, None]
    up = (onward.rays["direction"] * wall).sum(axis=1)
    above = ((onward.rays["origin"] - triangle["v0"]) * wall).sum(axis=1)
    assert np.isfinite(onward.rays["direction"]).all()
    assert np.abs(np.linalg.norm(onward.rays["direction"], axis=1) - 1).max() < 1e-4
    assert (np.sign(up) == np.sign(above)).all(), f"seed {seed}: a ray crosses the surface that it starts from"
    assert (up > 0).any()
    assert (up < 0).any() == (surface == GLASS)
    # A smooth sphere is to look smooth: nearly all mirror directions are those of the ideal sphere.
    reflected = np.flatnonzero(up > 0)
    corner = scene.normals[hits["primitive"][onward.parent]][reflected]
    hit = hits[onward.parent[reflected]]
    smooth = interpolate(corner[:, 0], corner[:, 1], corner[:, 2], hit["u"], hit["v"])
    smooth /= np.linalg.norm(smooth, axis=1)[:, None]
    d = rays["direction"][onward.parent[reflected]]
    d = d / np.linalg.norm(d, axis=1)[:, None]
    ideal = d - 2 * (d * smooth).sum(axis=1)[:, None] * smooth
    error = np.abs(ideal - onward.rays["direction"][reflected]).max(axis=1)
    assert (error < 1e-4).mean() > 0.95


def test_a_path_in_white_glass_loses_nothing() -> None:
    """White furnace: in a room of one radiance a ball of clear glass cannot be seen, whatever way a path takes."""
    parts = [replace(p, albedo=np.ones((1, 3), np.float32)) for p in room()]
    scene = scene_of([*parts, ball("ball", (0, 0, 0), 0.6, 1.0, GLASS)])
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, 0), irradiance=flat_light(scene, np.float32(np.pi)))
    rng = np.random.default_rng(3)
    aim = rng.normal(size=(2000, 3)) * 0.2
    rays, hits = aimed(scene, np.array([[0.1, 0.2, 0.9]]), aim)
    key, weight = keys(2000), np.ones((2000, 3), np.float32)
    brought = np.zeros((2000, 3))
    path = np.arange(2000)
    for _ in range(40):
        shaded = shade_rays(frame.surfaces, rays, hits, key, emission=True)
        np.add.at(brought, path, weight * shaded.radiance)
        onward = shaded.onward
        path, key, weight = path[onward.parent], onward.key, weight[onward.parent] * onward.weight
        rays = onward.rays
        if not len(rays):
            break
        hits = frame.structure.trace(rays)
    assert np.abs(brought - 1).max() < 1e-5
    assert len(rays) == 0


def test_emission_counts_where_it_is_asked_for_and_diffuse_hits_are_as_before() -> None:
    scene = scene_of([*room(), quad("lamp", [(x / 4, y / 4, 0.5) for x, y, _ in SQUARE], 0.5, emission=7.0)])
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1))
    rng = np.random.default_rng(4)
    rays, hits = aimed(scene, np.array([[0, 0, 0.9]]), rng.uniform(-1, 1, (500, 3)) * 0.9)
    without = shade_rays(frame.surfaces, rays, hits, keys(500), emission=False)
    including = shade_rays(frame.surfaces, rays, hits, keys(500), emission=True)
    assert not len(without.onward)
    met = hits["primitive"] >= 0
    assert (without.radiance[met] == diffuse_radiance(frame.surfaces, hits[met])).all()
    assert not without.radiance[~met].any()
    lamp = (hits["primitive"] >= 12) & hits["front"]
    assert 10 < lamp.sum() < 490
    assert np.allclose((including.radiance - without.radiance)[lamp], 7)
    assert (including.radiance == without.radiance)[~lamp].all()


def test_direct_light_of_a_point_light_is_intensity_cosine_over_square() -> None:
    scene = scene_of(room(), lights=[((0.2, 0.3, -0.1), 2.0)])
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1))
    rng = np.random.default_rng(6)
    target = rng.normal(size=(300, 3))
    rays, hits = aimed(scene, np.zeros((1, 3)), target)
    hits = np.concatenate([hits, np.zeros(1, dtype=HIT)])
    hits["primitive"][-1] = -1
    lights = lights_of(scene)
    direct = direct_light(geometry_of(scene), lights, hits, keys(301))
    assert (direct.parent == np.arange(300)).all(), "a miss has no light of its own"
    place = rays["origin"] + hits["t"][:300, None] * rays["direction"]
    toward = np.array([0.2, 0.3, -0.1]) - place
    distance = np.linalg.norm(toward, axis=1)
    axis = np.abs(place).argmax(axis=1)
    cosine = np.abs(toward[np.arange(300), axis]) / distance
    expected = 2 * cosine / distance**2
    assert np.allclose(direct.value[:, 0], expected, rtol=1e-4)
    assert (frame.structure.trace(direct.rays, any_hit=True)["primitive"] < 0).all()
    radiance = direct_at_hits(frame.surfaces, lights, hits, keys(301)).value
    albedo = scene.albedo[scene.material[hits["primitive"][:300]]]
    assert np.allclose(radiance, albedo / np.pi * expected[:, None], rtol=1e-4)


def test_coarse_hits_show_the_texels_they_are_linked_to() -> None:
    """Coarse geometry equal to the fine one, linked to constant texels: the same radiance; without links, none."""
    fine = scene_of(room())
    scene = replace(fine, coarse=fine)
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1), irradiance=flat_light(fine, 3.0))
    maps = frame.surfaces.lightmaps
    links = np.repeat(maps.offset[fine.object_id][:, None], 3, axis=1).astype(np.int32)
    rays, hits = aimed(fine, np.zeros((1, 3)), np.random.default_rng(7).normal(size=(100, 3)))
    linked = replace(frame.surfaces, coarse=CoarseSurfaces(geometry=geometry_of(fine, maps), links=links))
    there = shade_rays(linked, rays, hits, keys(100), emission=True, coarse=True).radiance
    here = shade_rays(frame.surfaces, rays, hits, keys(100), emission=True).radiance
    assert np.allclose(there, here, rtol=1e-6)
    assert (here > 0).all()
    assert linked.coarse is not None
    cut = replace(linked, coarse=replace(linked.coarse, links=np.full_like(links, -1)))
    assert not shade_rays(cut, rays, hits, keys(100), emission=True, coarse=True).radiance.any()

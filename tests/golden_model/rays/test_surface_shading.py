"""Shading of fragments and of diffuse hits: what comes from the map, what from emission and texture, what is black."""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.engine_image import GLASS, MIRROR
from lightloom.golden_model.contract.formats import PUBLISHED_TEXEL
from lightloom.golden_model.frame.rasterizer import draw, rasterize
from lightloom.golden_model.rays.surface_shading import (
    Surfaces,
    diffuse_radiance,
    ray_weights,
    readable,
    shade_fragments,
    shade_pixels,
)
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.cornell_box import cornell_box_parts
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import bilinear, levels_of, sample
from lightloom.golden_model.tables.pinhole import look_at, pixel_rays
from lightloom.golden_model.tracing.bvh.build import build
from lightloom.golden_model.tracing.bvh.traversal import trace
from tests.golden_model.frame_scenes import flat_light, geometry_of, mesh_of, quad, room, scene_of, seen_from

UP = np.array([0, 1, 0], dtype=np.float32)


def three_objects() -> Scene:
    return assemble(name="room", parts=cornell_box_parts(["floor", "left wall", "light"]), where="", texel_size=60.0)


def constant(scene: Scene, level: float) -> Surfaces:
    maps = unwrap(scene)
    values = np.full((len(maps.texels), 3), level, dtype=np.float32)
    return Surfaces(geometry=geometry_of(scene, maps), lightmaps=maps, irradiance=values)


def test_constant_map_gives_albedo_times_irradiance_over_pi_plus_emission() -> None:
    scene = three_objects()
    surfaces = constant(scene, 2.0)
    view = look_at(np.array([100, 300, -500]), np.array([300, 250, 280]), UP, 0.7, 48, 48)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, surfaces.lightmaps.uv)
    image = shade_pixels(surfaces, gbuffer)
    assert image.dtype == np.float32
    seen = gbuffer["primitive"] >= 0
    material = scene.material[gbuffer["primitive"][seen]]
    expected = scene.albedo[material] * 2 / np.pi + scene.emission[material]
    assert len(np.unique(material)) == 3
    assert np.allclose(image[seen], expected, rtol=1e-6)
    assert not image[~seen].any()
    assert (~seen).any()


def test_backs_are_black() -> None:
    scene = three_objects()
    surfaces = constant(scene, 2.0)
    view = look_at(np.array([278, -500, 280]), np.array([278, 0, 280]), np.array([0, 0, 1]), 0.5, 16, 16)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, surfaces.lightmaps.uv)
    assert (gbuffer["primitive"] >= 0).any()
    assert not gbuffer["front"].any()
    assert not shade_pixels(surfaces, gbuffer).any()
    assert not ray_weights(surfaces, gbuffer).any()


def test_hits_agree_with_pixels_but_for_emission() -> None:
    scene = three_objects()
    maps = unwrap(scene)
    values = np.random.default_rng(0).uniform(0, 5, (len(maps.texels), 3)).astype(np.float32)
    surfaces = Surfaces(geometry=geometry_of(scene, maps), lightmaps=maps, irradiance=values)
    view = look_at(np.array([100, 300, -500]), np.array([300, 250, 280]), UP, 0.7, 64, 64)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)
    hits = trace(build(scene.triangles), pixel_rays(view))
    image = shade_pixels(surfaces, gbuffer).reshape(-1, 3)
    same = (hits["primitive"] == gbuffer["primitive"].reshape(-1)) & (hits["primitive"] >= 0)
    assert same.sum() > 1000
    radiance = diffuse_radiance(surfaces, hits[same])
    emission = scene.emission[scene.material[hits["primitive"][same]]] * hits["front"][same, None]
    assert np.quantile(np.abs(image[same] - emission - radiance), 0.99) < 0.03  # snapping to 1/256 pixel


def test_the_texture_multiplies_the_albedo_at_pixels_and_at_hits() -> None:
    """A picture of two halves on a wall: its colours are those of the halves, and both ways to see it agree."""
    halves = np.zeros((8, 8, 3), dtype=np.float32)
    halves[:, :4], halves[:, 4:] = (1, 0.5, 0), (0, 0.25, 1)
    wall = quad("wall", [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], 0.8, texture=halves)
    wall = replace(wall, texture_uv=np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], dtype=np.float32))
    plain = quad("plain", [(1, -1, 0), (2, -1, 0), (2, 1, 0), (1, 1, 0)], 0.8)
    scene = scene_of([wall, plain])
    frame = seen_from(
        scene, (0.5, 0, 4), (0.5, 0, 0), tan=0.5, size=96, irradiance=flat_light(scene, np.float32(np.pi))
    )
    gbuffer = draw(frame.view, mesh_of(scene, frame.surfaces.lightmaps)).gbuffer
    image = shade_pixels(frame.surfaces, gbuffer)
    hits = frame.structure.trace(pixel_rays(frame.view)).reshape(gbuffer.shape)
    ray = diffuse_radiance(frame.surfaces, hits[gbuffer["primitive"] >= 0])
    x = gbuffer["texture"][..., 0]
    seen = gbuffer["primitive"] >= 0
    left = (gbuffer["object"] == 0) & (x > 1) & (x < 3)
    right = (gbuffer["object"] == 0) & (x > 5) & (x < 7)
    assert min(left.sum(), right.sum()) > 100
    assert np.allclose(image[left], [0.8, 0.4, 0], atol=1e-5)
    assert np.allclose(image[right], [0, 0.2, 0.8], atol=1e-5)
    assert np.allclose(image[gbuffer["object"] == 1], 0.8, rtol=1e-5)
    assert np.quantile(np.abs(image[seen] - ray), 0.99) < 0.02
    weight = ray_weights(frame.surfaces, gbuffer)
    assert np.allclose(weight[left], np.array([0.8, 0.4, 0]) / np.pi, atol=1e-5)


def test_lightmaps_are_read_with_the_level_of_detail_where_asked_for() -> None:
    """Random maps seen from far away: with their levels pixels are those of `sample` and smoother."""
    scene = scene_of([quad("floor", [(-1, 0, 1), (1, 0, 1), (1, 0, -1), (-1, 0, -1)], 1.0)], texel_size=2 / 64)
    maps = unwrap(scene)
    levels = levels_of(maps)
    rng = np.random.default_rng(1)
    values = np.zeros((levels.total, 3), dtype=np.float32)
    values[: len(maps.texels)] = rng.uniform(0, 2, (len(maps.texels), 3))
    values[len(maps.texels) :] = 1
    frame = seen_from(scene, (0, 4, 4), (0, 0, 0), tan=0.3, size=40, irradiance=values)
    fragment = frame.gbuffer[frame.gbuffer["primitive"] >= 0]
    assert (fragment["lod"] > 128).all()
    owner, place = fragment["object"], fragment["lightmap"]
    inverse_pi = np.float32(0.31830987)
    near = shade_fragments(frame.surfaces, fragment)
    assert (near == bilinear(maps, values, owner, place) * inverse_pi).all()
    far = shade_fragments(replace(frame.surfaces, filtered=True), fragment)
    assert (far == sample(maps, values, owner, place, fragment["lod"]) * inverse_pi).all()
    assert far.std() < 0.7 * near.std()


def test_mirrors_and_glass_leave_their_light_to_rays() -> None:
    parts = room()
    parts[0] = replace(parts[0], surface=MIRROR)
    parts[1] = replace(parts[1], surface=GLASS)
    scene = scene_of(parts)
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1))
    image, weight = shade_pixels(frame.surfaces, frame.gbuffer), ray_weights(frame.surfaces, frame.gbuffer)
    mirror, glass, diffuse = (frame.gbuffer["object"] == k for k in (0, 1, 2))
    assert not image[mirror | glass].any()
    assert (image[diffuse] > 0).all()
    assert (weight[mirror] == scene.albedo[0]).all()
    assert (weight[glass] == 1).all()
    assert np.allclose(weight[diffuse], scene.albedo[2] / np.pi, rtol=1e-6)


def test_halves_are_read_exactly() -> None:
    published = np.zeros(4, dtype=PUBLISHED_TEXEL)
    published["rgba"] = np.random.default_rng(1).uniform(0, 60000, (4, 4)).astype(np.float16)
    assert (readable(published) == published["rgba"][:, :3].astype(np.float32)).all()

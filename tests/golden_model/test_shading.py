"""Shading of pixels and of hits: what comes from the map, what from emission, what is black."""

import numpy as np

from golden_model.bvh import build
from golden_model.camera import look_at, pixel_rays
from golden_model.charts import unwrap
from golden_model.cornell_box import cornell_box_parts
from golden_model.formats import HIT, PUBLISHED_TEXEL
from golden_model.rasterizer import rasterize
from golden_model.scene import Scene, assemble
from golden_model.shading import readable, shade_hits, shade_pixels
from golden_model.traversal import trace

UP = np.array([0, 1, 0], dtype=np.float32)


def room() -> Scene:
    return assemble(name="room", parts=cornell_box_parts(["floor", "left wall", "light"]), where="", texel_size=60.0)


def constant(scene: Scene, level: float) -> tuple:
    maps = unwrap(scene)
    return maps, np.full((len(maps.texels), 3), level, dtype=np.float32)


def test_constant_map_gives_albedo_times_irradiance_over_pi_plus_emission() -> None:
    scene = room()
    maps, values = constant(scene, 2.0)
    view = look_at(np.array([100, 300, -500]), np.array([300, 250, 280]), UP, 0.7, 48, 48)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)
    image = shade_pixels(scene, maps, values, gbuffer)
    assert image.dtype == np.float32
    seen = gbuffer["primitive"] >= 0
    material = scene.material[gbuffer["primitive"][seen]]
    expected = scene.albedo[material] * 2 / np.pi + scene.emission[material]
    assert len(np.unique(material)) == 3
    assert np.allclose(image[seen], expected, rtol=1e-6)
    assert not image[~seen].any()
    assert (~seen).any()


def test_backs_are_black() -> None:
    scene = room()
    maps, values = constant(scene, 2.0)
    view = look_at(np.array([278, -500, 280]), np.array([278, 0, 280]), np.array([0, 0, 1]), 0.5, 16, 16)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv)
    assert (gbuffer["primitive"] >= 0).any()
    assert not gbuffer["front"].any()
    assert not shade_pixels(scene, maps, values, gbuffer).any()


def test_hits_agree_with_pixels_but_for_emission() -> None:
    scene = room()
    maps = unwrap(scene)
    values = np.random.default_rng(0).uniform(0, 5, (len(maps.texels), 3)).astype(np.float32)
    view = look_at(np.array([100, 300, -500]), np.array([300, 250, 280]), UP, 0.7, 64, 64)
    gbuffer = rasterize(view, scene.triangles, scene.normals, scene.object_id, maps.uv).reshape(-1)
    hits = trace(build(scene.triangles), pixel_rays(view))
    radiance = shade_hits(scene, maps, values, hits)
    image = shade_pixels(scene, maps, values, gbuffer.reshape(64, 64)).reshape(-1, 3)
    same = (hits["primitive"] == gbuffer["primitive"]) & (hits["primitive"] >= 0)
    assert same.sum() > 1000
    emission = scene.emission[scene.material[hits["primitive"][same]]] * hits["front"][same, None]
    assert np.quantile(np.abs(image[same] - emission - radiance[same]), 0.99) < 0.03  # snapping to 1/256 pixel
    assert not radiance[hits["primitive"] < 0].any()


def test_misses_bring_nothing_and_halves_are_read_exactly() -> None:
    scene = room()
    maps, values = constant(scene, 1.0)
    hits = np.zeros(3, dtype=HIT)
    hits["primitive"] = -1
    assert not shade_hits(scene, maps, values, hits).any()
    published = np.zeros(4, dtype=PUBLISHED_TEXEL)
    published["rgba"] = np.random.default_rng(1).uniform(0, 60000, (4, 4)).astype(np.float16)
    assert (readable(published) == published["rgba"][:, :3].astype(np.float32)).all()

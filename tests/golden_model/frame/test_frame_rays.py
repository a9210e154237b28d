"""Rays of a frame: mirrors against a mirrored camera, shadows against geometry, glass that must not be seen."""

from dataclasses import replace

import numpy as np
import pytest

from lightloom.golden_model.contract.engine_image import GLASS, MIRROR
from lightloom.golden_model.frame.compositor import blend_frame
from lightloom.golden_model.frame.frame_rays import FrameRays, FrameShading, trace_frame
from lightloom.golden_model.frame.ray_buffer import RayBuffer
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.rays.collector import FRAGMENT_SHADING, FRAME_SHADER, Packing
from lightloom.golden_model.rays.surface_shading import CoarseSurfaces, ray_weights, shade_pixels
from lightloom.golden_model.scene.light_unit import fraction_bits
from lightloom.golden_model.scene.lights import lights_of
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.structures.structure import Structure
from tests.golden_model.frame_scenes import Frame, ball, flat_light, geometry_of, quad, room, scene_of, seen_from

EYE, TARGET = (0.1, 0.2, 0.9), (0, 0, -1)


def rays_of(frame: Frame, options: FrameShading, **more) -> FrameRays:
    scene = frame.scene
    fraction = fraction_bits(scene, False)
    return FrameRays(frame.surfaces, frame.view, frame.gbuffer, lights_of(scene), fraction, options, **more)


def picture(frame: Frame, options: FrameShading | None = None, mode: str = "both") -> np.ndarray:
    buffer = trace_frame(rays_of(frame, options or FrameShading()), frame.collector())
    surfaces = frame.surfaces
    raster = shade_pixels(surfaces, frame.gbuffer)
    return blend_frame(raster, buffer.values(), ray_weights(surfaces, frame.gbuffer), mode)


def lamp(y: float = 0.999) -> Part:
    return quad("lamp", [(-0.2, y, -0.2), (0.2, y, -0.2), (0.2, y, 0.2), (-0.2, y, 0.2)], 0.5, emission=5.0)


def test_a_mirror_wall_shows_what_a_mirrored_eye_sees() -> None:
    """The far wall is a mirror: its pixels are those of a camera behind the wall, looking out, with left for right."""
    walls = [
        replace(p, surface=MIRROR, albedo=np.full((1, 3), 0.5, np.float32)) if p.name == "far" else p for p in room()
    ]
    scene = scene_of([*walls, lamp()])
    irradiance = np.random.default_rng(1).uniform(1, 2, 3).astype(np.float32)
    values = np.broadcast_to(irradiance, (len(flat_light(scene, 1.0)), 3)).copy()
    frame = seen_from(scene, (0, 0.2, 0.9), (0, 0.1, -1), tan=0.5, irradiance=values)
    image = picture(frame)

    # Behind the mirror, at z = -2 - 0.9, seeing through where the wall is: the wall's quad is left out.
    open_room = scene_of([p for p in [*walls, lamp()] if p.name != "far"])
    behind = seen_from(
        open_room, (0, 0.2, -2.9), (0, 0.1, -1), tan=0.5, irradiance=np.broadcast_to(irradiance, (4000, 3))
    )
    direct = shade_pixels(behind.surfaces, behind.gbuffer)[:, ::-1]
    mirror = frame.gbuffer["object"] == [p.name for p in walls].index("far")
    assert mirror.sum() > 500
    error = np.abs(image - direct * np.float32(0.5))[mirror].max(axis=1)
    assert (error < 1e-4).mean() > 0.97, "but for pixels at borders"
    assert (direct[mirror].max(axis=1) > 4).any(), "the lamp is seen in the mirror"


def test_clear_glass_of_the_index_of_air_cannot_be_seen() -> None:
    clear = ball("ball", (0, 0, 0), 0.5, 1.0, GLASS, ior=1.0)
    scene = scene_of([*room(), lamp(), clear])
    maps_light = np.random.default_rng(2).uniform(0.5, 4, (len(flat_light(scene, 1.0)), 3)).astype(np.float32)
    frame = seen_from(scene, EYE, TARGET, irradiance=maps_light)
    empty = scene_of([*room(), lamp()])
    without = seen_from(empty, EYE, TARGET, irradiance=maps_light)
    glass = frame.gbuffer["object"] == 7
    assert glass.sum() > 300
    error = np.abs(picture(frame) - picture(without)).max(axis=-1)
    assert (error[glass] < 0.02).mean() > 0.97
    assert not error[~glass].any()


def test_glass_in_light_from_all_sides_loses_only_what_is_cut_off() -> None:
    """White furnace, both rays traced: no pixel is brighter than the room, and deep enough paths bring nearly all."""
    white = [replace(p, albedo=np.ones((1, 3), np.float32)) for p in room()]
    scene = scene_of([*white, ball("ball", (0, 0, 0), 0.5, 1.0, GLASS)])
    frame = seen_from(scene, EYE, TARGET, size=24, irradiance=flat_light(scene, np.float32(np.pi)))
    glass = frame.gbuffer["object"] == 6
    lost = []
    for bounces in (2, 4, 12):
        image = picture(frame, FrameShading(bounces=bounces, split=8, cutoff=2.0**-12))
        assert image.max() < 1.0001
        lost.append(1 - image[glass].mean())
    assert lost[0] > lost[1] > lost[2]
    assert lost[2] < 0.01
    one_ray = picture(frame, FrameShading(bounces=16, split=0))
    assert abs(one_ray[glass].mean() - 1) < 0.01


def test_shadows_of_a_point_light_are_where_geometry_puts_them() -> None:
    """A square below a point light: floor pixels are dark in its projection, elsewhere I cos / r^2 albedo / pi."""
    square = quad("square", [(-0.2, 0, 0.2), (0.2, 0, 0.2), (0.2, 0, -0.2), (-0.2, 0, -0.2)])
    light = np.array([0, 0.8, 0], dtype=np.float32)
    scene = scene_of([*room(), square], lights=[(tuple(light), 1.5)])
    frame = seen_from(scene, (0, 0.7, 0.9), (0, -1, 0), irradiance=flat_light(scene, 0.0))
    assert not picture(frame).any(), "the maps are black and direct light comes from them"
    image = picture(frame, FrameShading(direct="rays"))
    names = scene.object_names
    floor = frame.gbuffer["object"] == names.index("bottom")
    primitive = frame.gbuffer["primitive"]
    u, v = frame.gbuffer["u"], frame.gbuffer["v"]
    corner = scene.corners[np.maximum(primitive, 0)].astype(np.float64)
    place = (
        corner[..., 0, :] * (1 - u - v)[..., None] + corner[..., 1, :] * u[..., None] + corner[..., 2, :] * v[..., None]
    )
    crossing = light + (place - light) * (0.8 / 1.8)  # at the height of the square
    inside = np.abs(crossing[..., [0, 2]]).max(axis=-1)
    umbra, lit = floor & (inside < 0.195), floor & (inside > 0.205)
    assert umbra.sum() > 20
    assert lit.sum() > 100
    assert not image[umbra].any()
    away = light - place
    distance = np.sqrt((away**2).sum(axis=-1))
    expected = 1.5 * 1.8 / distance**3
    albedo = scene.albedo[scene.material[primitive]]
    assert np.allclose(image[lit], (expected[..., None] * albedo / np.pi)[lit], rtol=1e-3)


def test_direct_light_by_rays_reaches_what_mirrors_show() -> None:
    """Maps without direct light: a mirror shows the lit floor, and the same floor is lit where it is seen directly."""
    walls = [replace(p, surface=MIRROR, albedo=np.ones((1, 3), np.float32)) if p.name == "far" else p for p in room()]
    scene = scene_of(walls, lights=[((0, 0.5, 0), 1.0)])
    frame = seen_from(scene, (0, 0, 0.9), (0, 0, -1), irradiance=flat_light(scene, 0.0))
    mirror = frame.gbuffer["object"] == [p.name for p in walls].index("far")
    assert not picture(frame)[mirror].any()
    rays = rays_of(frame, FrameShading(direct="rays"))
    image = blend_frame(
        np.zeros((48, 48, 3), np.float32),
        trace_frame(rays, frame.collector()).values(),
        ray_weights(frame.surfaces, frame.gbuffer),
    )
    assert (image[mirror].max(axis=1) > 0).mean() > 0.99
    assert rays.figures.hit_shadow > 500
    assert rays.figures.shadow > 500


def test_waves_are_bounded_by_the_bounces() -> None:
    """Two mirrors face each other; each bounce takes a wave, and the last brings what it meets."""
    walls = [
        replace(p, surface=MIRROR, albedo=np.ones((1, 3), np.float32)) if p.name in ("far", "near") else p
        for p in room()
    ]
    scene = scene_of([*walls, lamp()])
    frame = seen_from(scene, (0, 0, 0.5), (0, 0.02, -1), tan=0.2)
    for bounces in (0, 1, 3, 7):
        rays = rays_of(frame, FrameShading(bounces=bounces))
        trace_frame(rays, frame.collector())
        assert rays.figures.waves == bounces
        assert rays.figures.dropped > 0
    tinted = scene_of([replace(p, albedo=np.full((1, 3), 0.1, np.float32)) for p in walls])
    dim = seen_from(tinted, (0, 0, 0.5), (0, 0.02, -1), tan=0.2)
    rays = rays_of(dim, FrameShading(bounces=16, cutoff=0.02))
    trace_frame(rays, dim.collector())
    assert rays.figures.waves == 2, "the blender's tint aside, 0.1 passes and 0.01 does not"


def test_bits_do_not_depend_on_how_rays_are_packed_or_traced() -> None:
    scene = scene_of(
        [*room(), lamp(), ball("glass", (0.3, -0.4, 0), 0.4, 0.9, GLASS), ball("m", (-0.4, 0, 0), 0.3, 0.8, MIRROR)]
    )
    frame = seen_from(scene, EYE, TARGET)
    options = FrameShading(direct="rays", shadow_samples=2)
    expected = trace_frame(rays_of(frame, options), frame.collector()).total
    for packing in (Packing(capacity=1), Packing(definitions=1, cells=2)):
        assert (trace_frame(rays_of(frame, options), frame.collector(packing)).total == expected).all()
    plain = replace(frame, structure=Structure(scene, "numpy"))
    assert (trace_frame(rays_of(plain, options), plain.collector()).total == expected).all()
    other = trace_frame(rays_of(frame, options, seed=1), frame.collector()).total
    assert (other != expected).any()


def test_rays_go_to_the_geometry_that_is_chosen_for_them() -> None:
    """Reduced geometry without the lamp and the ball: reflections lose them, the G-buffer does not."""
    walls = [replace(p, surface=MIRROR, albedo=np.ones((1, 3), np.float32)) if p.name == "far" else p for p in room()]
    scene = scene_of([*walls, lamp(0.9)])
    less = scene_of(walls)
    both = replace(scene, coarse=replace(less, object_names=scene.object_names))
    frame = seen_from(both, (0, 0, 0.9), (0, 0.3, -1), tan=1.0)
    links = np.zeros((len(less.triangles), 3), dtype=np.int32)
    reduced = CoarseSurfaces(geometry=geometry_of(less), links=links)
    frame = replace(frame, surfaces=replace(frame.surfaces, coarse=reduced))
    mirror = frame.gbuffer["object"] == [p.name for p in walls].index("far")
    fine, coarse = (picture(frame, FrameShading(coarse_specular=choice)) for choice in (False, True))
    assert fine[mirror].max() >= 5
    assert coarse[mirror].max() < 5
    collector = frame.collector()
    trace_frame(rays_of(frame, FrameShading(coarse_specular=True)), collector)
    assert collector.figures.kinds["nearest coarse"] == collector.figures.rays[FRAGMENT_SHADING] > 0
    assert collector.figures.rays[FRAME_SHADER] == 0


def test_the_buffer_adds_up_in_any_order() -> None:
    rng = np.random.default_rng(3)
    pixel = rng.integers(0, 12, 500)
    value = rng.exponential(size=(500, 3)).astype(np.float32)
    buffers = []
    for order in (np.arange(500), rng.permutation(500)):
        buffer = RayBuffer(3, 4, 20)
        for part in np.array_split(order, 7):
            buffer.add(pixel[part], value[part])
        buffers.append(buffer.values())
    assert (buffers[0] == buffers[1]).all()
    expected = np.zeros((12, 3))
    np.add.at(expected, pixel, value)
    assert np.allclose(buffers[0].reshape(-1, 3), expected, rtol=1e-4)


def test_modes_of_the_blender() -> None:
    raster, rays, weight = (np.full((2, 3, 3), value, dtype=np.float32) for value in (0.25, 2.0, 0.5))
    assert (blend_frame(raster, rays, weight) == 1.25).all()
    assert (blend_frame(raster, rays, weight, "raster") == 0.25).all()
    assert (blend_frame(raster, rays, weight, "rays") == 1.0).all()
    with pytest.raises(InputError, match="blender mode"):
        blend_frame(raster, rays, weight, "neither")


@pytest.mark.parametrize(
    "option",
    [
        {"direct": "none"},
        {"shadow_samples": 0},
        {"hit_samples": 17},
        {"bounces": -1},
        {"split": 9},
        {"cutoff": 0.6},
    ],
)
def test_options_out_of_range_are_refused(option: dict) -> None:
    with pytest.raises(InputError, match=next(iter(option)).replace("_", " ")):
        FrameShading(**option)

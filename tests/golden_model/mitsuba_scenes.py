"""Scenes and irradiance in Mitsuba 3, which nobody here wrote: what the model's light is compared with."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lightloom.golden_model.contract.engine_image import GLASS, MIRROR
from lightloom.golden_model.scene.scene import Scene
from tests.needs import need_package


def mitsuba() -> Any:
    """The module, in the variant that runs everywhere; skips the test where it is not installed, but not in CI."""
    mi = need_package("mitsuba", "Mitsuba 3 is not installed")
    mi.set_variant("scalar_rgb")
    return mi


Shade = Callable[[np.ndarray], np.ndarray]
"""Directions (..., 3) to radiance (..., 3)."""


def mitsuba_scene(mi: Any, scene: Scene, sky: Shade | None = None, **more: Any) -> Any:
    """The same triangles with their normals, materials, textures and lights: a mesh for each material.

    `sky` is what the scene's sky is a picture of, if it is not the same all over; a sun has no size there. `more` goes
    into Mitsuba's description of the scene.
    """
    content: dict[str, Any] = {"type": "scene", "integrator": {"type": "path", "max_depth": 64, "rr_depth": 8}, **more}
    for material, owner in enumerate(scene.material_object):
        mine = scene.material == material
        if scene.present[owner] and mine.any():
            content[f"material{material}"] = _mesh(mi, scene, material, mine)
    even = scene.environment.sky
    if sky is not None:
        content["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(_picture(sky).astype(np.float32))}
    elif even is not None:
        assert even.radiance.shape == (1, 1, 3), "of a picture of a sky, give what it is a picture of"
        content["sky"] = {"type": "constant", "radiance": _rgb(even.radiance[0, 0])}
    if (sun := scene.environment.sun) is not None:
        irradiance = _rgb(sun.irradiance)
        content["sun"] = {"type": "directional", "direction": (-sun.towards).tolist(), "irradiance": irradiance}
    for number, light in enumerate(scene.point_lights):
        assert not len(scene.cones), "spot lights are not told to Mitsuba"
        place, intensity = light["position"].tolist(), _rgb(light["intensity"])
        content[f"light{number}"] = {"type": "point", "position": place, "intensity": intensity}
    return mi.load_dict(content)


def _rgb(values: np.ndarray) -> dict[str, Any]:
    return {"type": "rgb", "value": np.asarray(values).tolist()}


def _mesh(mi: Any, scene: Scene, material: int, mine: np.ndarray) -> Any:
    """The triangles `mine` (T,) bool, all of one material."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_surface(mi, scene, material))
    if scene.emission[material].any():
        assert scene.emission_texture[material] < 0, "emissive textures are not told to Mitsuba"
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(scene.emission[material])})
    corners = scene.corners[mine]
    mesh = mi.Mesh(
        f"material{material}",
        3 * len(corners),
        len(corners),
        has_vertex_normals=True,
        has_vertex_texcoords=True,
        props=properties,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = corners.reshape(-1)
    parameters["vertex_normals"] = scene.normals[mine].reshape(-1)
    parameters["vertex_texcoords"] = scene.texture_uv[mine].reshape(-1)
    parameters["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    parameters.update()
    return mesh


def _surface(mi: Any, scene: Scene, material: int) -> dict[str, Any]:
    """What light does at a material; the backs of diffuse ones that are not two-sided swallow it."""
    albedo = scene.albedo[material]
    if scene.surface[material] == GLASS:
        return {"type": "dielectric", "int_ior": float(scene.ior[material]), "specular_transmittance": _rgb(albedo)}
    if scene.surface[material] == MIRROR:
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(albedo)}
        return {"type": "twosided", "nested": mirror}
    reflectance = _rgb(albedo)
    if (number := scene.texture[material]) >= 0:
        # Row 0 is at v = 0 in both.
        texels = (scene.textures[number] * albedo).astype(np.float32)
        reflectance = {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True, "wrap_mode": "repeat"}
    diffuse = {"type": "diffuse", "reflectance": reflectance}
    return {"type": "twosided", "nested": diffuse} if scene.two_sided[material] else diffuse


def mitsuba_picture(mi: Any, scene: Scene, size: tuple[int, int], samples: int, seed: int) -> np.ndarray:
    """Radiance (H, W, 3) float32 of a frame's scene as its camera sees it, `samples` paths a pixel."""
    camera = scene.camera
    width, height = size
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    sensor = {
        "type": "perspective",
        "fov_axis": "y",
        "fov": 2 * float(np.degrees(np.arctan(float(camera.fov_y_tan)))),
        "near_clip": 1e-3 * scene.reach,
        "far_clip": 100.0 * scene.reach,
        "to_world": mi.ScalarTransform4f().look_at(
            origin=camera.position.tolist(), target=camera.target.tolist(), up=camera.up.tolist()
        ),
        "film": film,
        "sampler": {"type": "independent", "sample_count": samples},
    }
    loaded = mitsuba_scene(mi, scene, sensor=sensor)
    return np.asarray(mi.render(loaded, spp=samples, seed=seed), dtype=np.float32)


def _picture(sky: Shade, height: int = 128) -> np.ndarray:
    """A sky at the places of an `envmap`'s pixels: from pole to pole, and round from -z over +x."""
    down = np.linspace(0, np.pi, height)[:, None]
    right = np.arange(2 * height) * (np.pi / height)
    flat = np.broadcast_to(np.cos(down), (height, 2 * height))
    return sky(np.stack([np.sin(down) * np.sin(right), flat, -np.sin(down) * np.cos(right)], axis=-1))


def mitsuba_irradiance(
    mi: Any,
    scene: Scene,
    position: np.ndarray,
    normal: np.ndarray,
    material: np.ndarray,
    samples: int,
    seed: int,
    sky: Shade | None = None,
) -> np.ndarray:
    """Irradiance (N, 3) float64 at points (N, 3) with unit normals (N, 3), on surfaces of `material` (N,).

    It is pi / albedo times the radiance that leaves the surface, less what it emits, along a ray from just above,
    straight down; so Mitsuba samples the light at the point itself, where rays from the point would have to meet it by
    chance.
    """
    loaded = mitsuba_scene(mi, scene, sky)
    integrator = loaded.integrator()
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed)
    start = position.astype(np.float64) + 1e-4 * scene.reach * normal.astype(np.float64)
    out = np.zeros((len(position), 3))
    for row, place, facing in zip(out, start.tolist(), normal.astype(np.float64).tolist(), strict=True):
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(place), mi.Vector3f([-x for x in facing])))
        red = green = blue = 0.0
        for _ in range(samples):
            radiance, _, _ = integrator.sample(loaded, sampler, ray)
            red, green, blue = red + radiance[0], green + radiance[1], blue + radiance[2]
        row[:] = red, green, blue
    reflected = out / samples - scene.emission[material].astype(np.float64)
    return reflected * np.pi / scene.albedo[material].astype(np.float64)

"""Scenes and irradiance in Mitsuba 3, which nobody here wrote: what the model's light is compared with."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lightloom.golden_model.scene.scene import Scene
from tests.needs import need_package


def mitsuba() -> Any:
    """The module, in the variant that runs everywhere; skips the test where it is not installed, but not in CI."""
    mi = need_package("mitsuba", "Mitsuba 3 is not installed")
    mi.set_variant("scalar_rgb")
    return mi


Shade = Callable[[np.ndarray], np.ndarray]
"""Directions (..., 3) to radiance (..., 3)."""


def mitsuba_scene(mi: Any, scene: Scene, sky: Shade | None = None) -> Any:
    """The same triangles with their normals, materials and lights, objects as meshes.

    `sky` is what the scene's sky is a picture of; a sun has no size there.
    """
    content: dict[str, Any] = {"type": "scene", "integrator": {"type": "path", "max_depth": 64, "rr_depth": 8}}
    for number in range(len(scene.object_names)):
        mine = scene.object_id == number
        (material,) = np.unique(scene.material[mine])
        properties = mi.Properties()
        reflectance = {"type": "rgb", "value": scene.albedo[material].tolist()}
        diffuse = {"type": "diffuse", "reflectance": reflectance}
        properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": diffuse})
        if scene.emission[material].any():
            radiance = {"type": "rgb", "value": scene.emission[material].tolist()}
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        corners = scene.corners[mine]
        mesh = mi.Mesh(f"object{number}", 3 * len(corners), len(corners), has_vertex_normals=True, props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = corners.reshape(-1)
        parameters["vertex_normals"] = scene.normals[mine].reshape(-1)
        parameters["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
        parameters.update()
        content[f"object{number}"] = mesh
    if sky is not None:
        content["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(_picture(sky).astype(np.float32))}
    if (sun := scene.environment.sun) is not None:
        irradiance = {"type": "rgb", "value": sun.irradiance.tolist()}
        content["sun"] = {"type": "directional", "direction": (-sun.towards).tolist(), "irradiance": irradiance}
    return mi.load_dict(content)


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

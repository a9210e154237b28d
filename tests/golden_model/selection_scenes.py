"""Small scenes with lightmaps, G-buffers and contexts for the tests of selection."""

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lightloom.golden_model.charts.unwrap import unwrap
from lightloom.golden_model.contract.formats import ONE_SAMPLE, TEXEL_STATE
from lightloom.golden_model.driver.report import Reporter
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.engine.selection.selector import FrameContext
from lightloom.golden_model.frame.rasterizer import rasterize
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.cornell_box import cornell_box, cornell_box_parts
from lightloom.golden_model.scene.keyframes import ObjectKey, ObjectPath
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.pose import moved_records, scene_at
from lightloom.golden_model.scene.scene import Camera, Scene
from lightloom.golden_model.structures.structure import Structure
from lightloom.golden_model.tables.lightmap import Lightmaps, bilinear_taps
from lightloom.golden_model.tables.pinhole import View, look_at

IDENTITY = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Stage:
    """A scene at rest, its lightmaps and its structure."""

    scene: Scene
    lightmaps: Lightmaps
    structure: Structure

    def draw(self, camera: Camera, frame: int, width: int, height: int) -> tuple[View, np.ndarray]:
        scene = scene_at(self.scene, frame)
        view = look_at(camera.position, camera.target, camera.up, camera.fov_y_tan, width, height)
        return view, rasterize(view, scene.triangles, scene.normals, scene.object_id, self.lightmaps.uv)

    def context(
        self,
        frame: int = 0,
        size: int = 64,
        state: np.ndarray | None = None,
        policy: Policy | None = None,
        rays: int = 0,
        **more: Any,
    ) -> FrameContext:
        """Of a frame; changes are reported by a policy, within so many rays."""
        scene = scene_at(self.scene, frame)
        self.structure.update(scene)
        view, gbuffer = self.draw(scene.camera, frame, size, size)
        fields: dict[str, Any] = {
            "frame": frame,
            "lightmaps": moved_records(self.lightmaps, scene),
            "state": self.state() if state is None else state,
            "view": view,
            "gbuffer": gbuffer,
            "trace": self.structure.trace,
        }
        fields |= more
        before = scene_at(self.scene, max(frame - 1, 0))
        report = Reporter(self.scene, policy or Policy()).report(before, scene, fields["trace"], rays)
        return FrameContext(report=report, **fields)

    def state(self, count: int = 0) -> np.ndarray:
        """TEXEL_STATE of texels that all have so many samples."""
        state = np.zeros(len(self.lightmaps.texels), dtype=TEXEL_STATE)
        state["count"] = count * ONE_SAMPLE
        return state


def stage(scene: Scene) -> Stage:
    structure = Structure(scene_at(scene, 0))
    return Stage(scene=scene, lightmaps=unwrap(scene, trace=Structure(scene).trace), structure=structure)


@functools.cache
def cornell(texel_size: float) -> Stage:
    """The Cornell box, whose camera moves."""
    return stage(replace(cornell_box(), texel_size=texel_size))


def key(frame: int, translate: tuple[float, ...], emission: float = 1.0, present: bool = True) -> ObjectKey:
    return ObjectKey(
        frame=frame,
        translate=vector(translate),
        rotate=np.array(IDENTITY, dtype=np.float32),
        emission=np.float32(emission),
        present=present,
    )


@functools.cache
def visited(texel_size: float = 40.0, surface: int = 0) -> Stage:
    """The Cornell box with a third block that comes from outside, frames 0 to 10, and vanishes in frame 20.

    It stays where it is from frame 10 on. The lamp goes out in frame 30.
    """
    parts = cornell_box_parts()
    for k, part in enumerate(parts):
        if part.name == "light":
            parts[k] = replace(part, path=path_of(key(29, (0, 0, 0)), key(30, (0, 0, 0), emission=0)))
    guest = replace(
        cornell_box_parts(["short block"])[0],
        name="guest",
        surface=surface,
        path=path_of(key(0, (0, 150, -1200)), key(10, (-40, 150, -100)), key(20, (-40, 150, -100), present=False)),
    )
    box = cornell_box()
    return stage(
        assemble(name="visited", parts=[*parts, guest], where="visited", camera=box.camera, texel_size=texel_size)
    )


def path_of(*keys: ObjectKey) -> ObjectPath:
    return ObjectPath(keys=keys, pivot=vector((0, 0, 0)))


def read_by_pixels(lightmaps: Lightmaps, gbuffer: np.ndarray) -> np.ndarray:
    """Which texels (N,) the pixels of a G-buffer read between texels, with what is shown in place of others."""
    pixel = gbuffer[(gbuffer["primitive"] >= 0) & gbuffer["front"]]
    texel, weight = bilinear_taps(lightmaps, pixel["object"], pixel["lightmap"])
    shown = lightmaps.fill[texel[weight > 0]]
    out = np.zeros(len(lightmaps.texels), dtype=bool)
    out[shown[shown >= 0]] = True
    return out


def plate(
    name: str, albedo: float, emission: float = 0.0, size: float = 2.0, height: float = 0.0, up: bool = True
) -> Part:
    """A square in the plane y = `height` around the y axis, that looks up or down."""
    half = size / 2
    square = [(-half, height, -half), (-half, height, half), (half, height, half), (half, height, -half)]
    if not up:
        square.reverse()
    return Part(
        name=name,
        corners=np.array([[square[k] for k in face] for face in ((0, 1, 2), (0, 2, 3))], dtype=np.float32),
        albedo=np.full((1, 3), albedo, dtype=np.float32),
        emission=np.full((1, 3), emission, dtype=np.float32),
        material=np.zeros(2, dtype=np.int32),
    )

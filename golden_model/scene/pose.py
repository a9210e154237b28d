"""The scene of a frame: objects, lights and camera moved along their paths, and the lightmap records with them."""

from dataclasses import replace

import numpy as np

from lightloom.golden_model.contract.formats import TRIANGLE
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.numerics.vectors import add, scale
from lightloom.golden_model.scene.keyframes import REST, light_at, object_pose, rotated
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.tables.lightmap import EMPTY, VALID, Lightmaps

NOWHERE = np.float32(np.nan)
"""Coordinates of an absent object's vertices."""


KEPT_FRAMES = 4
"""Scenes of frames that a scene at rest keeps: a frame, those in flight beside it, and the one before."""


def scene_at(scene: Scene, frame: int) -> Scene:
    """The scene of a frame, 0 or more; of any scene of the sequence, at rest or not, the same.

    Arrays that do not change are shared with the scene at rest; where nothing ever changes it is that very scene.
    The last few frames asked for are kept.
    """
    rest = scene if scene.rest is None else scene.rest
    if frame not in rest.frames:
        while len(rest.frames) >= KEPT_FRAMES:
            del rest.frames[next(iter(rest.frames))]
        rest.frames[frame] = posed(rest, frame)
    return rest.frames[frame]


def state_of(scene: Scene) -> tuple[bytes, ...]:
    """All that can change from frame to frame but the camera, as bytes: frames with the same have the same light."""
    arrays = (scene.rotation, scene.translation, scene.glow, scene.present, scene.point_lights)
    return tuple(array.tobytes() for array in arrays)


def entrances(scene: Scene) -> list[int]:
    """The frames, rising, in which an object that the first frame lacks is there for the first time."""
    paths = [path.keys for path in scene.object_path if path is not None and not path.keys[0].present]
    first = [next((key.frame for key in keys if key.present), None) for keys in paths]
    return sorted({frame for frame in first if frame is not None})


def posed(rest: Scene, frame: int) -> Scene:
    """The scene of a frame, made anew from the scene at rest."""
    camera = rest.camera_at(frame)
    if not rest.dynamic:
        still = not rest.camera_path
        return rest if still else replace(rest, camera=camera, rest=rest, frame=frame)
    poses = [REST if path is None else object_pose(path, frame) for path in rest.object_path]
    glow = np.array([pose.emission for pose in poses], dtype=np.float32)
    moved = replace(
        rest,
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
        glow=glow,
        present=np.array([pose.present for pose in poses]),
        emission=scale(rest.emission, glow[rest.material_object]),
        point_lights=_moved_lights(rest, frame),
        camera=camera,
        rest=rest,
        frame=frame,
    )
    fine = _moved_triangles(rest, moved)
    return replace(fine, coarse=None if rest.coarse is None else _moved_triangles(rest.coarse, moved))


def _moved_triangles(rest: Scene, moved: Scene) -> Scene:
    """`moved` with the triangles of `rest` carried to its poses."""
    triangles, normals = rest.triangles.copy(), rest.normals.copy()
    for number in _going(rest):
        part = slice(*np.searchsorted(rest.object_id, [number, number + 1]))
        if not moved.present[number]:
            for name in TRIANGLE.names or ():
                triangles[name][part] = NOWHERE
            continue
        rotation, translation = moved.rotation[number], moved.translation[number]
        for name in TRIANGLE.names or ():
            triangles[name][part] = add(rotated(rotation, rest.triangles[name][part]), translation)
        normals[part] = rotated(rotation, rest.normals[part])
    return replace(
        moved,
        triangles=triangles,
        normals=normals,
        object_id=rest.object_id,
        material=rest.material,
        texture_uv=rest.texture_uv,
        coarse=None,
        rest=rest,
    )


def _going(scene: Scene) -> list[int]:
    """The objects that ever leave their rest place."""
    return [number for number, path in enumerate(scene.object_path) if path is not None and not path.stays]


def _moved_lights(rest: Scene, frame: int) -> np.ndarray:
    """POINT_LIGHT (P,) of a frame."""
    lights = rest.point_lights.copy()
    for number, path in enumerate(rest.light_path):
        if path is not None:
            lights["position"][number], lights["intensity"][number] = light_at(path, frame)
    return lights


@quiet
def moved_records(lightmaps: Lightmaps, scene: Scene) -> Lightmaps:
    """The lightmaps of a scene at rest with their records carried to the pose of `scene`.

    Texels of absent objects and of objects without lightmaps are not VALID; `fill` stays as it was at rest.
    """
    if not scene.dynamic:
        return lightmaps
    texels = lightmaps.texels.copy()
    for number in _going(scene):
        first = int(lightmaps.offset[number])
        part = texels[first : first + int(lightmaps.width[number]) * int(lightmaps.height[number])]
        if not scene.present[number]:
            part["state"][part["state"] == VALID] = EMPTY
            continue
        rotation, used = scene.rotation[number], part["state"] != EMPTY
        part["position"][used] = add(rotated(rotation, part["position"][used]), scene.translation[number])
        part["normal"][used] = rotated(rotation, part["normal"][used])
        part["tangent"][used] = rotated(rotation, part["tangent"][used])
    return replace(lightmaps, texels=texels)


def back_rows_of(lightmaps: Lightmaps, scene: Scene) -> np.ndarray | None:
    """`Lightmaps.back_rows` of a scene's two-sided triangles, 0 for others: (T,) float32; None where there are none."""
    if lightmaps.back_rows is None:
        return None
    rows = lightmaps.back_rows[scene.object_id].astype(np.float32)
    return np.where(scene.two_sided[scene.material], rows, np.float32(0))

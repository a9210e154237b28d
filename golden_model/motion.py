"""The scene of a frame: objects, lights and camera moved along their paths, the lightmap records with them, and what
has changed from one frame to another.
"""

import enum
from dataclasses import dataclass, replace

import numpy as np

from golden_model.floats import quiet
from golden_model.formats import TRIANGLE
from golden_model.lightmap import EMPTY, VALID, Lightmaps
from golden_model.paths import REST, light_at, object_pose, rotated
from golden_model.scene import Scene
from golden_model.vectors import add, scale

NOWHERE = np.float32(np.nan)
"""Coordinates of an absent object's vertices."""


def posed(rest: Scene, frame: int) -> Scene:
    """The scene of a frame, made from the scene at rest; `Scene.at` is the way to call it."""
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


class Kind(enum.Flag):
    """What has happened to an object or a point light; several may have."""

    MOVED = enum.auto()
    APPEARED = enum.auto()
    VANISHED = enum.auto()
    RELIT = enum.auto()
    """It shines more, less or in another colour, or it shone before it vanished or shines now that it has appeared."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """One object or point light that two frames show differently."""

    kind: Kind
    object: int
    """Number of the object, -1 for a point light."""
    light: int
    """Number of the point light, -1 for an object."""
    before: np.ndarray | None
    """Least and greatest coordinates in the frame before, (2, 3) float32; None where it was not there."""
    after: np.ndarray | None
    """The same in the frame after, None where it is not there."""
    albedo: float
    """Largest reflectance of its materials, of any colour; 0 for a point light."""
    emission: float
    """Largest radiance, of a point light radiant intensity, of any colour, in either frame."""
    difference: float
    """Largest difference of that between the two frames, of any colour; all of it where it appeared or vanished."""


def changes(before: Scene, after: Scene) -> list[Change]:
    """What differs between two frames of one scene: objects in their order, then point lights."""
    if before is after or not after.dynamic:
        return []
    objects = [_object_change(before, after, number) for number in range(len(after.object_names))]
    lights = [_light_change(before, after, number) for number in range(len(after.point_lights))]
    return [change for change in (*objects, *lights) if change is not None]


def _object_change(before: Scene, after: Scene, number: int) -> Change | None:
    was, now = bool(before.present[number]), bool(after.present[number])
    moved = (
        before.rotation[number].tobytes() != after.rotation[number].tobytes()
        or before.translation[number].tobytes() != after.translation[number].tobytes()
    )
    mine = after.material_object == number
    old, new = before.emission[mine], after.emission[mine]
    kind = Kind.MOVED if moved and was and now else Kind(0)
    if was != now:
        kind |= Kind.APPEARED if now else Kind.VANISHED
    if (old != new).any():
        kind |= Kind.RELIT
    if not kind:
        return None
    return Change(
        kind=kind,
        object=number,
        light=-1,
        before=_bounds(before, number) if was else None,
        after=_bounds(after, number) if now else None,
        albedo=float(after.albedo[mine].max(initial=0)),
        emission=float(max(old.max(initial=0), new.max(initial=0))),
        difference=float(np.abs(old - new).max(initial=0)),
    )


def _light_change(before: Scene, after: Scene, number: int) -> Change | None:
    old, new = before.point_lights[number], after.point_lights[number]
    kind = Kind.MOVED if (old["position"] != new["position"]).any() else Kind(0)
    if (old["intensity"] != new["intensity"]).any():
        kind |= Kind.RELIT
    if not kind:
        return None
    return Change(
        kind=kind,
        object=-1,
        light=number,
        before=np.stack([old["position"], old["position"]]),
        after=np.stack([new["position"], new["position"]]),
        albedo=0.0,
        emission=float(max(old["intensity"].max(), new["intensity"].max())),
        difference=float(np.abs(old["intensity"] - new["intensity"]).max()),
    )


def _bounds(scene: Scene, number: int) -> np.ndarray | None:
    """Least and greatest coordinates of an object, (2, 3) float32; None where it has no triangles."""
    first, end = np.searchsorted(scene.object_id, [number, number + 1])
    if first == end:
        return None
    corners = [scene.triangles[name][first:end] for name in TRIANGLE.names or ()]
    low = np.min([corner.min(axis=0) for corner in corners], axis=0)
    return np.stack([low, np.max([corner.max(axis=0) for corner in corners], axis=0)])


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

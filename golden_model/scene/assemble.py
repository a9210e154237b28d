"""Parts to a scene at rest, and the camera of a scene that has none."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import POINT_LIGHT, TRIANGLE
from lightloom.golden_model.host.errors import InputError, warn
from lightloom.golden_model.numerics.vectors import vector
from lightloom.golden_model.scene.cuts import cut_parts
from lightloom.golden_model.scene.keyframes import REST, LightPath
from lightloom.golden_model.scene.mesh import closed, shading_normals, usable_parts
from lightloom.golden_model.scene.parts import Part
from lightloom.golden_model.scene.scene import Camera, Keyframe, Scene
from lightloom.golden_model.tables.ray_offset import SPAN, longest_edges

LARGEST, SMALLEST = 2.0**40, 2.0**-40
"""Coordinates lie within +-LARGEST and the scene is larger than SMALLEST: squares of lengths stay normal float32."""

MOST_LIFT = 1 / 32
"""Of a texel, by which a larger triangle that one touches may lift its rays without a word."""


def assemble(
    *,
    name: str,
    parts: Sequence[Part],
    where: str,
    camera: Camera | None = None,
    camera_path: tuple[Keyframe, ...] = (),
    point_lights: np.ndarray | None = None,
    light_path: tuple[LightPath | None, ...] = (),
    texel_size: float | None = None,
) -> Scene:
    """Parts to a scene at rest, each part one object. `where` (a file, an option) begins every InputError.

    Without `camera` the scene gets one that frames it, without `texel_size` a 64th of its longest side. Triangles
    without area are left out, with an InputWarning; another one tells of triangles whose rays start far off them.
    """
    if not any(len(part.corners) for part in parts):
        raise InputError(f"{where}: no triangles; a scene needs at least one")
    parts = usable_parts(parts, where)
    corners = np.concatenate([part.corners for part in parts]).astype(np.float32)
    low, high = corners.min(axis=(0, 1)).astype(np.float64), corners.max(axis=(0, 1)).astype(np.float64)
    if np.abs(corners).max() > LARGEST or (high - low).max() < SMALLEST:
        raise InputError(
            f"{where}: coordinates must lie within +-{LARGEST:.0e} and span {SMALLEST:.0e}; scale the scene"
        )

    size = float((high - low).max()) / 64 if texel_size is None else texel_size
    parts = cut_parts(parts, size)
    fine = _assembled(
        parts,
        name=name,
        point_lights=np.zeros(0, dtype=POINT_LIGHT) if point_lights is None else point_lights,
        camera=framing_camera(low, high) if camera is None else camera,
        camera_path=camera_path,
        light_path=light_path,
        texel_size=size,
    )
    if fine.reach > LARGEST:
        raise InputError(f"{where}: a path leads beyond +-{LARGEST:.0e}; shorten it")
    _warn_of_large_neighbours(fine, where)
    if all(part.coarse is None for part in parts):
        return fine
    return replace(fine, coarse=_with_triangles(fine, [part.coarse or part for part in parts]))


def _warn_of_large_neighbours(scene: Scene, where: str) -> None:
    """Says which triangles have light from far above them, because another one that they touch is so large."""
    lift = scene.spans * SPAN
    lifted = np.flatnonzero(lift > MOST_LIFT * scene.texel_size)
    lifted = lifted[scene.spans[lifted] > 2 * longest_edges(scene.corners[lifted])]
    if len(lifted):
        first = scene.object_names[scene.object_id[lifted[0]]]
        warn(
            f"{where}: {len(lifted)} triangles touch so large ones that rays start up to {lift[lifted].max():.2g} off "
            f"them, more than {MOST_LIFT:g} of a texel (first: of {first}); split the large ones"
        )


def _assembled(parts: Sequence[Part], **rest: Any) -> Scene:
    """Checked parts to a scene; `rest` are the fields that no part has."""
    names: list[str] = []
    for part in parts:
        same = sum(part.name == other.name for other in parts[: len(names)])
        names.append(part.name if same == 0 else f"{part.name}.{same + 1}")
    materials = [len(part.albedo) for part in parts]
    textures: list[np.ndarray] = []
    texture = [_index(textures, part.texture) for part in parts]
    emission_texture = [_index(textures, part.emission_texture) for part in parts]
    return Scene(
        object_names=names,
        albedo=np.concatenate([p.albedo for p in parts]),
        emission=np.concatenate([p.emission for p in parts]),
        surface=np.repeat([p.surface for p in parts], materials).astype(np.uint8),
        two_sided=np.repeat([p.two_sided and not closed(p.corners) for p in parts], materials).astype(bool),
        ior=np.repeat([p.ior for p in parts], materials).astype(np.float32),
        texture=np.repeat(texture, materials).astype(np.int32),
        emission_texture=np.repeat(emission_texture, materials).astype(np.int32),
        textures=tuple(textures),
        material_object=np.repeat(np.arange(len(parts)), materials).astype(np.int32),
        object_path=tuple(part.path for part in parts),
        rotation=np.repeat(REST.rotation[None], len(parts), axis=0),
        translation=np.repeat(REST.translation[None], len(parts), axis=0),
        glow=np.ones(len(parts), dtype=np.float32),
        present=np.ones(len(parts), dtype=bool),
        **_triangles(parts),
        **rest,
    )


def _with_triangles(scene: Scene, parts: Sequence[Part]) -> Scene:
    """The scene with the triangles of other parts for the same objects."""
    return replace(scene, **_triangles(parts))


def _triangles(parts: Sequence[Part]) -> dict[str, Any]:
    """What a scene has for each triangle."""
    first_material = np.cumsum([0, *(len(part.albedo) for part in parts)])
    triangles = np.zeros(sum(len(p.corners) for p in parts), dtype=TRIANGLE)
    corners = np.concatenate([p.corners for p in parts]).astype(np.float32)
    for k in range(3):
        triangles[f"v{k}"] = corners[:, k]
    whole = [np.full(len(p.corners), -1, dtype=np.int32) for p in parts]
    none = [np.zeros((len(p.corners), 3, 2), dtype=np.float32) for p in parts]
    return {
        "triangles": triangles,
        "normals": np.concatenate([shading_normals(p.corners) if p.normals is None else p.normals for p in parts]),
        "object_id": np.repeat(np.arange(len(parts)), [len(p.corners) for p in parts]).astype(np.int32),
        "material": np.concatenate(
            [p.material + first for p, first in zip(parts, first_material, strict=False)]
        ).astype(np.int32),
        "section": np.concatenate(
            [empty if p.section is None else p.section for p, empty in zip(parts, whole, strict=True)]
        ),
        "texture_uv": np.concatenate(
            [empty if p.texture_uv is None else p.texture_uv for p, empty in zip(parts, none, strict=True)]
        ),
    }


def _index(textures: list[np.ndarray], texture: np.ndarray | None) -> int:
    """The number of a texture in the list, where it is put if it is not there; -1 for None."""
    if texture is None:
        return -1
    for number, known in enumerate(textures):
        if known is texture:
            return number
    textures.append(texture)
    return len(textures) - 1


def framing_camera(low: np.ndarray, high: np.ndarray) -> Camera:
    """A camera that looks at the box between the corners `low` and `high` ((3,) float64 each), from the front above."""
    half_tan = 0.4
    middle = (low + high) * 0.5
    half = (high - low) * 0.5
    radius = np.sqrt(half[0] * half[0] + half[1] * half[1] + half[2] * half[2])
    # The sphere around the box touches the field of view at radius / sin; a little more leaves a margin.
    distance = radius * np.sqrt(1 + half_tan * half_tan) / half_tan * 1.05
    toward = np.array([4.0, 4.0, 7.0]) / 9.0  # a Pythagorean quadruple: unit length
    return Camera(
        position=vector(middle + distance * toward),
        target=vector(middle),
        up=vector((0, 1, 0)),
        fov_y_tan=np.float32(half_tan),
    )

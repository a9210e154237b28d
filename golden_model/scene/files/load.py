"""Scenes by what a user calls them: the name of a built-in one, or a file."""

from collections.abc import Callable
from pathlib import Path

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.assemble import assemble
from lightloom.golden_model.scene.files.cornell_box import cornell_box
from lightloom.golden_model.scene.files.mesh_files import MESH_SUFFIXES, load_mesh
from lightloom.golden_model.scene.files.toml.scene import load_toml
from lightloom.golden_model.scene.scene import Scene

BUILT_IN: dict[str, Callable[[], Scene]] = {"cornell-box": cornell_box}
"""Scenes that need no file."""


def load_scene(name_or_path: str | Path) -> Scene:
    """A built-in scene by its name, a scene description (.toml) or a mesh file (.obj, .ply, .glb, .gltf).

    A mesh file gets a camera that frames it. Raises InputError, one line, for everything that cannot be used.
    """
    if str(name_or_path) in BUILT_IN:
        return BUILT_IN[str(name_or_path)]()
    path = Path(name_or_path)
    suffix = path.suffix.lower()
    if suffix != ".toml" and suffix not in MESH_SUFFIXES:
        raise InputError(
            f"{name_or_path}: not a scene; known are the built-in {', '.join(BUILT_IN)} "
            f"and files ending in .toml, {', '.join(MESH_SUFFIXES)}"
        )
    if suffix == ".toml":
        return load_toml(path)
    return assemble(name=path.stem, parts=load_mesh(path), where=str(path))

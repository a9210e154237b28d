"""Mesh files to parts of a scene, whatever their kind."""

from pathlib import Path

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.gltf.file import load_gltf
from lightloom.golden_model.scene.files.named_files import lack
from lightloom.golden_model.scene.files.ply import load_ply
from lightloom.golden_model.scene.files.wavefront.obj import load_obj
from lightloom.golden_model.scene.parts import Part


def load_mesh(path: Path) -> list[Part]:
    """The objects of a mesh file. What is left out or changed is said (InputWarning).

    Raises InputError where the file is missing, damaged or holds no triangles.
    """
    if lack(path):
        raise InputError(f"{path}: no such file")
    loader = _LOADERS.get(path.suffix.lower())
    if loader is None:
        raise InputError(f"{path}: unknown kind of mesh file; known are {', '.join(MESH_SUFFIXES)}")
    parts = loader(path)
    if not parts:
        raise InputError(f"{path}: no triangles; a mesh needs at least one")
    return parts


_LOADERS = {".obj": load_obj, ".ply": load_ply, ".glb": load_gltf, ".gltf": load_gltf}
MESH_SUFFIXES = tuple(_LOADERS)

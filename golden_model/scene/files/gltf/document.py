"""The structure of a glTF file: its JSON, by pygltflib, and the binary part of a .glb file."""

import json
import struct
import warnings
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.remarks import Remarks

KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "int": ((int,), "a whole number"),
    "float": ((int, float), "a number"),
    "bool": ((bool,), "true or false"),
}
"""What values of the format may be, by how pygltflib declares them."""

LONGEST_KEY = 20
"""Characters that are shown of a key."""


def gltf_document(path: Path, remarks: Remarks) -> Any:
    """The file's structure, a GLTF2 of pygltflib, with its binary part. Raises InputError."""
    import pygltflib  # takes a while, and only these formats need it

    data = path.read_bytes()
    text, blob = _chunks(path, data) if path.suffix.lower() == ".glb" else (data, None)
    try:
        values = json.loads(text)
        version, least = str(values["asset"]["version"]), str(values["asset"].get("minVersion") or "2.0")
        newer = [int(part) for part in least.split(".")] > [2, 0]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise damaged(path, error) from error
    if not version.startswith("2."):
        raise InputError(f"{path}: is of glTF {version[:20]}; only 2.0 is read")
    if newer:
        raise InputError(f"{path}: needs glTF {least[:20]}; only 2.0 is read")
    try:
        _check(values, pygltflib, remarks)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pygltflib, about fields that may be left out
            document = pygltflib.GLTF2.from_json(text.decode("utf-8-sig"), infer_missing=True)
    except Exception as error:  # whatever it meets where the structure is another one
        raise damaged(path, error) from error
    document.set_binary_blob(blob)
    return document


def _entries(values: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of the JSON with its key, those of a list one by one, without `extras` and `extensions`."""
    if isinstance(values, list):
        for value in values:
            yield from _entries(value, key)
        return
    yield key, values
    if isinstance(values, dict):
        for name, value in values.items():
            if name not in ("extras", "extensions"):
                yield from _entries(value, name)


def _check(values: Any, library: Any, remarks: Remarks) -> None:
    """What pygltflib would change or drop: says which keys the format does not have.

    Raises ValueError for a value of another kind than the format has.
    """
    tables = [item for item in vars(library).values() if isinstance(item, type) and is_dataclass(item)]
    every = [(field.name, str(field.type)) for table in tables for field in fields(table)]
    known = {name for name, _ in every}
    kinds = {name: kind for name, declared in every for kind in KINDS if kind in declared}
    for key in ("extensionsRequired", "extensionsUsed"):
        if not isinstance(values.get(key) or [], list):
            raise ValueError(f"`{key}` is {values[key]!r:.40}, not a list")
    for key, value in _entries(values):
        if key in kinds and isinstance(value, str | bool | int | float):
            types, what = KINDS[kinds[key]]
            if type(value) not in types:
                raise ValueError(f"`{key}` is {value!r}, not {what}")
        # Attributes of primitives, which may be of any name, have capital letters or a low line before them.
        if key and key not in known and not key.isupper() and not key.startswith("_"):
            remarks.leave_out(f"`{key[:LONGEST_KEY]}`")


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """JSON and binary part of a .glb file."""
    try:
        magic, version, length, first, kind = struct.unpack_from("<4sIII4s", data)
    except struct.error as error:
        raise damaged(path, error) from error
    if magic != b"glTF" or kind != b"JSON":
        raise InputError(f"{path}: not a binary glTF file; damaged, or of another kind")
    if version != 2:
        raise InputError(f"{path}: is of glTF {version}; only 2.0 is read")
    if not 20 + first <= length <= len(data):
        raise damaged(path, f"it has {len(data)} of {length} bytes")
    place, blob = 20 + first, None
    while place + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, place)
        if place + 8 + size > length:
            raise damaged(path, "a part leads beyond its end")
        if kind == b"BIN\0":
            if blob is not None:
                raise damaged(path, "it has two binary parts")
            blob = data[place + 8 : place + 8 + size]
        place += 8 + size
    return data[20 : 20 + first], blob


def damaged(path: Path, reason: object) -> InputError:
    """A file that contradicts itself or the format."""
    line = " ".join(str(reason).split())[:100] or type(reason).__name__
    return InputError(f"{path}: cannot be read as glTF, damaged or cut off ({line})")


def not_understood(path: Path, extension: str) -> InputError:
    """A file that cannot be read without an extension that is not read."""
    return InputError(f"{path}: needs the glTF extension {extension}, which is not read; save the file without it")

"""Arrays of a glTF file: accessors into views of buffers, which lie in the file itself, in its JSON or beside it.

Nothing that the file says about itself is believed: every number is held against what is there.
"""

import base64
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.gltf.document import damaged, not_understood
from lightloom.golden_model.scene.files.named_files import lack

FLOAT = 5126
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", FLOAT: "<f4"}
"""Types of an accessor's numbers."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
"""Numbers in an element; matrices are for animations."""

MOST_ELEMENTS = 1 << 26
"""Of an accessor, which need not have data for them: those that are not given are zero."""

MOST_PADDING = 7
"""Bytes by which the binary part of a .glb file may be longer than its buffer: 3 of the format's own, 7 in tiles of 3D
maps, which align to eight."""

ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://", re.IGNORECASE)
"""How a `uri` begins that is not the name of a file."""


class Accessors:
    """Reads the accessors of a document of pygltflib; whatever does not fit raises InputError."""

    def __init__(self, path: Path, document: Any) -> None:
        self.path = path
        self._document = document
        self._buffers: dict[int, bytes] = {}

    def item(self, items: list[Any] | None, number: Any, what: str) -> Any:
        """The item of a list that a number in the file names."""
        if type(number) is not int or not 0 <= number < len(items or []):
            raise self.error(f"{what} {number} does not exist; the file has {len(items or [])}")
        return (items or [])[number]

    def error(self, reason: str) -> InputError:
        """What the file says about itself is wrong."""
        return damaged(self.path, reason)

    def whole(self, value: Any, what: str, least: int = 0) -> int:
        """A whole number of the file; None stands for 0."""
        if value is None:
            value = 0
        if type(value) is not int or value < least:
            raise self.error(f"{what} is {value}")
        return value

    def numbers(self, accessor: int, width: str) -> np.ndarray:
        """Elements as float64, (count, K), exactly; `normalized` ones divided as the format says."""
        found, normalized = self._elements(accessor, width)
        wide = found.astype(np.float64)
        if not normalized:
            return wide
        if found.dtype.kind == "f" or found.dtype.itemsize > 2:
            raise self.error(f"accessor {accessor} is normalized {found.dtype.name}")
        return np.maximum(wide / float(np.iinfo(found.dtype).max), -1.0)

    def floats(self, values: Any, count: int, what: str, default: tuple[float, ...] = ()) -> np.ndarray:
        """Numbers in the file's JSON, (count,) float64; None stands for the default."""
        values = list(default) if values is None else values
        numbers = isinstance(values, list) and all(type(value) in (int, float) for value in values)
        if not numbers or len(values) != count:
            raise self.error(f"{what} is not {count} numbers")
        return np.array(values, dtype=np.float64)

    def finite(self, values: Any, count: int, what: str, default: tuple[float, ...] = ()) -> np.ndarray:
        """As `floats`, and each of them a number as large as may be."""
        found = self.floats(values, count, what, default)
        if not np.isfinite(found).all():
            raise self.error(f"{what} is {found.tolist()}")
        return found

    def indices(self, accessor: int) -> np.ndarray:
        """Numbers of vertices, (count,) int64."""
        found, _ = self._elements(accessor, "SCALAR")
        if found.dtype.kind != "u":
            raise self.error(f"accessor {accessor} holds {found.dtype.name} as indices")
        return found[:, 0].astype(np.int64)

    def _elements(self, number: int, width: str) -> tuple[np.ndarray, bool]:
        """(count, K) in the type of the file, and whether they are normalized."""
        accessor = self.item(self._document.accessors, number, "accessor")
        if accessor.type != width:
            raise self.error(f"accessor {number} is {accessor.type}, not {width}")
        count = self.whole(accessor.count, f"the count of accessor {number}", 1)
        dtype = self._dtype(accessor.componentType, f"accessor {number}")
        if accessor.bufferView is not None:
            found = self._strided(accessor.bufferView, accessor.byteOffset, count, dtype, WIDTHS[width])
        elif count > MOST_ELEMENTS:
            raise self.error(f"accessor {number} has {count} elements, and no data for them")
        else:
            found = np.zeros((count, WIDTHS[width]), dtype=dtype)
        if accessor.sparse is not None:
            found = self._with_sparse(number, found, accessor.sparse)
        return found, bool(accessor.normalized)

    def _with_sparse(self, number: int, elements: np.ndarray, sparse: Any) -> np.ndarray:
        """Elements with some of them replaced."""
        count = self.whole(sparse.count, f"the sparse count of accessor {number}", 1)
        if sparse.indices is None or sparse.values is None:
            raise self.error(f"accessor {number} is sparse without indices or values")
        kind = self._dtype(sparse.indices.componentType, f"accessor {number}")
        place = self._strided(sparse.indices.bufferView, sparse.indices.byteOffset, count, kind, 1)[:, 0]
        if kind.kind != "u" or place.max() >= len(elements):
            raise self.error(f"accessor {number} is sparse where it has no element")
        values = self._strided(
            sparse.values.bufferView, sparse.values.byteOffset, count, elements.dtype, elements.shape[1]
        )
        elements = elements.copy()
        elements[place.astype(np.int64)] = values
        return elements

    def _dtype(self, component: Any, where: str) -> np.dtype:
        if component not in COMPONENTS:
            raise self.error(f"{where} has numbers of an unknown type, {component}")
        return np.dtype(COMPONENTS[component])

    def _strided(self, view_number: Any, offset: Any, count: int, dtype: np.dtype, width: int) -> np.ndarray:
        """(count, width) elements of a buffer view, `byteStride` apart."""
        view = self.item(self._document.bufferViews, view_number, "buffer view")
        what = f"of buffer view {view_number}"
        start, length = (
            self.whole(view.byteOffset, f"the offset {what}"),
            self.whole(view.byteLength, f"the length {what}"),
        )
        offset = self.whole(offset, "the offset of an accessor")
        size = width * dtype.itemsize
        stride = size if view.byteStride is None else self.whole(view.byteStride, f"the stride {what}", size)
        data = self._buffer(view)
        end = offset + (count - 1) * stride + size
        if end > length or start + length > len(data):
            raise self.error(f"{count} elements need {start + end} bytes {what}, whose buffer has {len(data)}")
        return np.ndarray((count, width), dtype, data, start + offset, (stride, dtype.itemsize))

    def _buffer(self, view: Any) -> bytes:
        number = view.buffer
        buffer = self.item(self._document.buffers, number, "buffer")
        if number not in self._buffers:
            compressed = [name for name in view.extensions or {} if "meshopt" in name]
            self._buffers[number] = self._content(number, buffer, compressed)
        return self._buffers[number]

    def _content(self, number: int, buffer: Any, compressed: list[str]) -> bytes:
        length = self.whole(buffer.byteLength, f"the length of buffer {number}", 1)
        uri = buffer.uri
        if uri is None:
            data = self._document.binary_blob() if number == 0 else None
            if data is None and compressed:
                raise not_understood(self.path, compressed[0])
            if data is not None and len(data) > length + MOST_PADDING:
                raise self.error(f"buffer 0 has {len(data)} bytes in the file's binary part, and says {length}")
        elif isinstance(uri, str) and uri[:5].lower() == "data:":
            try:
                data = base64.b64decode(uri.partition(",")[2], validate=True)
            except ValueError as error:
                raise self.error(f"buffer {number} is no base64") from error
        else:
            data = self._beside(uri, length)
        if data is None or len(data) < length:
            raise self.error(f"buffer {number} has {len(data or b'')} of {length} bytes")
        return data[:length]

    def _beside(self, uri: Any, length: int) -> bytes:
        """The first bytes of a file beside this one."""
        if ADDRESS.match(str(uri)):
            raise InputError(f"{self.path}: its data are at an address, {uri}; put the file beside it, and name that")
        file = self.path.parent / unquote(str(uri))
        if state := lack(file):
            raise InputError(f"{self.path}: its file {file} is {state}; put it there")
        try:
            with file.open("rb") as stream:
                return stream.read(min(length, file.stat().st_size))
        except OSError as error:
            raise InputError(f"{self.path}: its file {file} cannot be read ({error.strerror or error})") from error

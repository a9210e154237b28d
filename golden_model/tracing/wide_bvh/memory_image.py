"""The memory image: one file of blocks with everything that the hardware reads, in sections (docs/memory_image.md).

So far there is one kind of section, the tree with the triangles. Every byte is covered by a check, and a file that is
cut, damaged or not an image is refused.
"""

import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lightloom.golden_model.contract.formats import (
    BLOCK_BYTES,
    IMAGE_HEADER,
    IMAGE_MAGIC,
    IMAGE_VERSION,
    SECTION,
    SECTION_KINDS,
)
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh
from lightloom.golden_model.tracing.wide_bvh.validate import validate_tree

ENTRIES = BLOCK_BYTES // SECTION.itemsize
"""Entries of the table of sections in a block."""


def pack_image(sections: Mapping[str, np.ndarray]) -> bytes:
    """Sections by kind (`formats.SECTION_KINDS`), blocks (B, 16) uint32 each, to the bytes of the image."""
    bodies = [np.ascontiguousarray(blocks, dtype="<u4").tobytes() for blocks in sections.values()]
    begin = 1 + _table_blocks(len(bodies))
    table = np.zeros((begin - 1) * ENTRIES, dtype=SECTION)
    for entry, kind, body in zip(table, sections, bodies, strict=False):
        blocks = len(body) // BLOCK_BYTES
        entry["kind"], entry["first"], entry["blocks"] = SECTION_KINDS[kind], begin, blocks
        entry["check"] = zlib.crc32(body)
        begin += blocks
    header = np.zeros(1, dtype=IMAGE_HEADER)
    header["magic"], header["version"], header["sections"], header["blocks"] = (
        IMAGE_MAGIC,
        IMAGE_VERSION,
        len(bodies),
        begin,
    )
    header["check"] = zlib.crc32(header.tobytes() + table.tobytes())
    return b"".join([header.tobytes(), table.tobytes(), *bodies])


def unpack_image(data: bytes, name: str) -> dict[str, np.ndarray]:
    """The bytes of an image to its sections by kind, blocks (B, 16) uint32 each. `name`, the file, is for errors.

    Raises InputError for anything that `pack_image` would not have made, and for a tree that cannot be traced.
    """
    if data[:8] != np.array(IMAGE_MAGIC, dtype="<u4").tobytes():
        raise InputError(f"{name}: not a memory image; make one with `lightloom pack`")
    if len(data) < BLOCK_BYTES:
        raise _damaged(name, "it ends in its header")
    header = np.frombuffer(data, dtype=IMAGE_HEADER, count=1).copy()
    version, count, blocks = (int(header[field][0]) for field in ("version", "sections", "blocks"))
    if version != IMAGE_VERSION:
        raise InputError(f"{name}: a memory image of version {version}, not {IMAGE_VERSION}; pack the scene again")
    if len(data) != blocks * BLOCK_BYTES:
        raise _damaged(name, f"it has {len(data)} bytes, not {blocks * BLOCK_BYTES}")
    begin = 1 + _table_blocks(count)
    table = data[BLOCK_BYTES : begin * BLOCK_BYTES]
    expected, header["check"] = int(header["check"][0]), 0
    if begin > blocks or zlib.crc32(header.tobytes() + table) != expected:
        raise _damaged(name, "the check of its header is wrong")

    kinds = {number: kind for kind, number in SECTION_KINDS.items()}
    sections: dict[str, np.ndarray] = {}
    for entry in np.frombuffer(table, dtype=SECTION)[:count]:
        first, length = int(entry["first"]), int(entry["blocks"])
        kind = kinds.get(int(entry["kind"]), "")
        if not kind or kind in sections:
            raise _damaged(name, f"a section of kind {entry['kind']} is not known or there twice")
        if first != begin or first + length > blocks:
            raise _damaged(name, f"section {kind} does not begin where the one before ends, or leaves the image")
        body = data[first * BLOCK_BYTES : (first + length) * BLOCK_BYTES]
        if zlib.crc32(body) != entry["check"]:
            raise _damaged(name, f"the check of section {kind} is wrong")
        sections[kind] = np.frombuffer(body, dtype="<u4").reshape(-1, BLOCK_BYTES // 4).astype(np.uint32)
        begin += length
    if begin != blocks:
        raise _damaged(name, "it goes on after its last section")
    if "bvh" in sections:
        validate_tree(sections["bvh"], name)
    return sections


def load_tree(path: Path | str) -> WideBvh:
    """The tree of an image file. Raises InputError where there is none."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; make one with `lightloom pack`") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); choose another file") from error
    sections = unpack_image(data, str(path))
    if "bvh" not in sections:
        raise InputError(f"{path}: has no tree; pack the scene again")
    return WideBvh(sections["bvh"])


def _table_blocks(sections: int) -> int:
    return -(-sections // ENTRIES)


def _damaged(name: str, how: str) -> InputError:
    return InputError(f"{name}: a damaged memory image: {how}; pack the scene again")

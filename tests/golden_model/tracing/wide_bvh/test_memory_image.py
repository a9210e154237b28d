"""The memory image: what is packed comes back, whatever is damaged is refused; the documentation is right."""

import re
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack, formats
from lightloom.golden_model.contract.formats import (
    BLOCK_BYTES,
    BVH_HEADER,
    IMAGE_HEADER,
    NODE_BLOCK,
    SECTION,
    TRIANGLE_BLOCK,
)
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, build_wide
from lightloom.golden_model.tracing.wide_bvh.memory_image import load_tree, pack_image, unpack_image
from lightloom.golden_model.tracing.wide_bvh.validate import validate_tree
from tests import ROOT
from tests.golden_model.tracing_cases import random_soup

PAGE = ROOT / "docs" / "memory_image.md"
BLOCKS = ("IMAGE_HEADER", "SECTION", "BVH_HEADER", "NODE_BLOCK", "TRIANGLE_BLOCK")


@pytest.fixture(scope="module")
def tree() -> WideBvh:
    return build_wide(random_soup(np.random.default_rng(1), 120))


@pytest.fixture(scope="module")
def image(tree: WideBvh) -> bytes:
    return pack_image({"bvh": tree.blocks})


def refusal(data: bytes) -> str:
    """The error of an image, which must be one line that begins with its name."""
    with pytest.raises(InputError) as caught:
        unpack_image(data, "scene.bin")
    message = str(caught.value)
    assert message.startswith("scene.bin: ")
    assert "\n" not in message
    return message


# --- the file ---------------------------------------------------------------------------------------------------------


def test_what_is_packed_comes_back(tree: WideBvh, image: bytes) -> None:
    sections = unpack_image(image, "scene.bin")
    assert list(sections) == ["bvh"]
    assert sections["bvh"].dtype == np.uint32
    assert np.array_equal(sections["bvh"], tree.blocks)
    assert unpack_image(pack_image({}), "scene.bin") == {}


def test_bytes_of_a_file(tree: WideBvh, image: bytes) -> None:
    """As docs/memory_image.md has them, read without the formats."""
    assert image[:8] == b"LLIMAGE\0"
    words = np.frombuffer(image, dtype="<u4")
    assert words[2:5].tolist() == [1, 1, len(image) // 64]
    assert words[15] == zlib.crc32(image[:60] + bytes(4) + image[64:128])
    assert words[16:20].tolist() == [1, 2, len(tree.blocks), zlib.crc32(image[128:])]
    assert image[128:132] == b"LLBV"
    assert image[134] == 8
    root = words[48:64]
    base, count = int(root[1]), int(root[0] >> 4 & 15)
    assert root[0] & 15 == 1
    assert base == 2
    leaf = next(k for k in range(count) if root[0] >> 8 + k & 1) if root[0] >> 8 & 255 else None
    assert leaf is None or words[32 + 16 * (base + leaf)] & 15 == 2
    assert max(image[192 + 40 : 192 + 40 + count]) in range(128, 256), "8 bits are used"


def test_image_of_a_file(tree: WideBvh, image: bytes, tmp_path: Path) -> None:
    path = tmp_path / "scene.bin"
    path.write_bytes(image)
    assert np.array_equal(load_tree(path).blocks, tree.blocks)
    path.write_bytes(pack_image({}))
    for wrong, word in ((path, "no tree"), (tmp_path / "none.bin", "no such file"), (tmp_path, "cannot be read")):
        with pytest.raises(InputError, match=word):
            load_tree(wrong)


def test_any_changed_byte_is_noticed(image: bytes) -> None:
    rng = np.random.default_rng(2)
    places = [*range(2 * BLOCK_BYTES), *rng.integers(2 * BLOCK_BYTES, len(image), 400)]
    for place in places:
        changed = bytearray(image)
        changed[place] ^= int(rng.integers(1, 256))
        refusal(bytes(changed))


def test_any_cut_is_noticed(image: bytes) -> None:
    for end in [*range(0, 260, 7), *range(300, len(image), 1001), len(image) - 64, len(image) - 1]:
        refusal(image[:end])
    refusal(image + bytes(64))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not a memory image"),
        (b"\x7fELF" + bytes(100), "not a memory image"),
        (b"LLIMAGE\0", "ends in its header"),
    ],
)
def test_other_files_are_refused(data: bytes, words: str) -> None:
    assert words in refusal(data)


def resealed(image: bytes, field: str, value: int, section: int | None = None) -> bytes:
    """The image with a field of its header or of an entry of its table changed, and checks that are right."""
    data = bytearray(image)
    header = np.frombuffer(data, dtype=IMAGE_HEADER, count=1)
    if section is None:
        header[field] = value
    else:
        np.frombuffer(data, dtype=SECTION, offset=BLOCK_BYTES)[field][section] = value
    header["check"] = 0
    header["check"] = zlib.crc32(data[: 2 * BLOCK_BYTES])
    return bytes(data)


@pytest.mark.parametrize(
    ("field", "value", "section", "words"),
    [
        ("version", 2, None, "version 2"),
        ("sections", 0, None, "check"),  # the table is shorter then
        ("sections", 2, None, "kind 0"),
        ("sections", 2**32 - 1, None, "check"),
        ("blocks", 3, None, "bytes"),
        ("kind", 9, 0, "kind 9"),
        ("first", 1, 0, "does not begin"),
        ("first", 3, 0, "does not begin"),
        ("blocks", 2**32 - 1, 0, "leaves the image"),
        ("blocks", 5, 0, "check of section bvh"),
        ("check", 5, 0, "check of section bvh"),
    ],
)
def test_files_with_right_checks_but_wrong_content(
    image: bytes, field: str, value: int, section: int | None, words: str
) -> None:
    assert words in refusal(resealed(image, field, value, section))


def test_bytes_after_the_last_section_are_refused(image: bytes) -> None:
    longer = resealed(image + bytes(64), "blocks", len(image) // 64 + 1)
    assert "goes on" in refusal(longer)


def test_a_section_twice_is_refused(tree: WideBvh, image: bytes) -> None:
    twice = bytearray(image + tree.blocks.tobytes())
    entries = np.frombuffer(twice, dtype=SECTION, offset=BLOCK_BYTES, count=2)
    entries[1] = entries[0]
    entries["first"][1] += len(tree.blocks)
    data = resealed(resealed(bytes(twice), "sections", 2), "blocks", len(twice) // 64)
    assert "twice" in refusal(data)


# --- the tree ---------------------------------------------------------------------------------------------------------


def sealed(blocks: np.ndarray) -> np.ndarray:
    """Blocks whose header has a right check word."""
    blocks[0, -1] = 0
    blocks[0, -1] = np.bitwise_xor.reduce(blocks[0])
    return blocks


def with_block(blocks: np.ndarray, address: int, dtype: np.dtype, change: Callable[[np.ndarray], None]) -> np.ndarray:
    """The blocks with one changed as a record."""
    out = blocks.copy()
    record = bitpack.unpack(out[address : address + 1], dtype)
    change(record)
    out[address] = bitpack.pack(record)[0]
    return sealed(out)


def put(field: str, value: object, *index: int) -> Callable[[np.ndarray], None]:
    def change(record: np.ndarray) -> None:
        record[field][(0, *index)] = value

    return change


def leaf_of(tree: WideBvh, count: int = 1) -> int:
    """The first block with so many triangles."""
    held = bitpack.unpack(tree.blocks, TRIANGLE_BLOCK)["count"]
    return int(np.flatnonzero(tree.triangle_blocks & (held == count))[0])


HEADER_FAULTS = [
    ("magic", 5, "LLBV"),
    ("version", 7, "version"),
    ("width", 9, "width"),
    ("width", 0, "width"),
    ("width", 3, "more children"),
    ("levels", 9, "levels"),
    ("blocks", 5, "blocks"),
    ("root", 2, "root"),
    ("nodes", 3, "number of nodes"),
    ("triangle_blocks", 3, "number of nodes or triangles"),
    ("triangles", 3, "3 triangles"),
    ("lattice_exponent", 111, "exponent"),
    ("lattice_exponent", -127, "exponent"),
    ("lattice_exponent", -30, "reaches out of its box"),
    ("lattice_origin", np.nan, "finite"),
    ("lattice_origin", 1e30, "reaches out of its box"),
]


@pytest.mark.parametrize(("field", "value", "words"), HEADER_FAULTS)
def test_wrong_headers_are_refused(tree: WideBvh, field: str, value: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        validate_tree(with_block(tree.blocks, 0, BVH_HEADER, put(field, value)))


def test_a_wrong_check_word_is_refused(tree: WideBvh) -> None:
    for bit in range(0, 512, 7):
        blocks = tree.blocks.copy()
        blocks[0, bit // 32] ^= np.uint32(1 << bit % 32)
        with pytest.raises(InputError, match="the tree is damaged"):
            validate_tree(blocks)
    with pytest.raises(InputError, match="no blocks"):
        validate_tree(tree.blocks[:1])


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("kind", 3, "block 1 is neither"),
        ("kind", 2, "root"),
        ("base", 1, "do not lie behind"),
        ("base", 2**32 - 1, "do not lie behind"),
        ("base", 3, "a node for triangles|parents"),
        ("count", 0, "parents"),  # of what were its children
        ("count", 7, "parents"),
        ("count", 15, "more children"),
        ("origin", 1000, "reaches out of its box"),
        ("exponent", 0, "reaches out of its box"),
        ("lower_y", 255, "reaches out of its box"),
        ("upper_z", 0, "reaches out of its box"),
    ],
)
def test_wrong_nodes_are_refused(tree: WideBvh, field: str, value: int, words: str) -> None:
    with pytest.raises(InputError, match=words):
        validate_tree(with_block(tree.blocks, 1, NODE_BLOCK, put(field, value)))


def test_a_node_without_children_is_refused_unless_it_is_the_root(tree: WideBvh) -> None:
    validate_tree(build_wide(random_soup(np.random.default_rng(4), 0)).blocks)
    below = int(np.flatnonzero(tree.node_blocks)[-1])
    with pytest.raises(InputError, match=f"node {below} has no children"):
        validate_tree(with_block(tree.blocks, below, NODE_BLOCK, put("count", 0)))


def test_a_slot_of_the_wrong_kind_is_refused(tree: WideBvh) -> None:
    root = bitpack.unpack(tree.blocks[1:2], NODE_BLOCK)
    with pytest.raises(InputError, match="node 1 takes triangles for a node"):
        validate_tree(with_block(tree.blocks, 1, NODE_BLOCK, put("leaf", root["leaf"][0] ^ 1)))


@pytest.mark.parametrize(
    ("field", "value", "index", "words"),
    [
        ("count", 0, (), "has 0 triangles"),
        ("count", 3, (), "has 3 triangles"),
        ("primitive", -1, (0,), "below 0"),
        ("vertices", np.inf, (4,), "not finite"),
        ("vertices", -1e9, (8,), "reaches out of its box"),
        ("vertices", 3e38, (8,), "reaches out of its box"),
    ],
)
def test_wrong_leaves_are_refused(tree: WideBvh, field: str, value: float, index: tuple[int, ...], words: str) -> None:
    with pytest.raises(InputError, match=words):
        validate_tree(with_block(tree.blocks, leaf_of(tree), TRIANGLE_BLOCK, put(field, value, *index)))


def test_a_triangle_twice_is_refused(tree: WideBvh) -> None:
    first, second = np.flatnonzero(tree.triangle_blocks)[:2]
    number = bitpack.unpack(tree.blocks[first : first + 1], TRIANGLE_BLOCK)["primitive"][0, 0]
    with pytest.raises(InputError, match="twice"):
        validate_tree(with_block(tree.blocks, int(second), TRIANGLE_BLOCK, put("primitive", number, 0)))


def test_an_image_with_a_damaged_tree_is_refused(tree: WideBvh) -> None:
    """A tree that was damaged before it was packed: the checks of the file are right."""
    blocks = with_block(tree.blocks, 1, NODE_BLOCK, put("base", 1))
    assert "children of node 1" in refusal(pack_image({"bvh": blocks}))


# --- documentation ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("block", BLOCKS)
def test_tables_are_those_of_the_formats(block: str) -> None:
    dtype: np.dtype = getattr(formats, block)
    section = PAGE.read_text(encoding="utf-8").split(f"### {block}\n")[1].split("\n#")[0]
    said = re.findall(r"^\| `(\w+)` \| (\d+):(\d+) \| (\d+)(?:-(\d+))? \|", section, re.MULTILINE)
    spans: dict[str, tuple[int, int]] = {}
    for name, _, _, offset, width in bitpack.fields(dtype):
        spans[name] = offset + width - 1, spans.get(name, (0, offset))[1]
    assert [(name, int(high), int(low)) for name, high, low, _, _ in said] == [
        (name, *span) for name, span in spans.items()
    ]
    assert [(int(first), int(last or first)) for _, _, _, first, last in said] == [
        (low // 8, high // 8) for high, low in spans.values()
    ]
    assert bitpack.width(dtype) == 8 * (SECTION.itemsize if block == "SECTION" else BLOCK_BYTES)


@pytest.mark.parametrize("block", ["IMAGE_HEADER", "SECTION", "BVH_HEADER"])
def test_numpy_reads_headers_as_they_are(block: str) -> None:
    """Their fields are whole bytes, so a dtype is the layout in the file too."""
    dtype: np.dtype = getattr(formats, block)
    assert 8 * dtype.itemsize == bitpack.width(dtype)
    words = np.random.default_rng(3).integers(0, 1 << 32, (50, bitpack.words(dtype)), dtype=np.uint32)
    assert bitpack.unpack(words, dtype).tobytes() == np.frombuffer(words.tobytes(), dtype=dtype).tobytes()

"""The tables in docs/renderer.md say what the formats say: fields, and bytes read and written."""

import re

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack, formats
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.classes import class_table
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.frame.rasterizer import Rasterization
from lightloom.golden_model.numerics.directions import COUNT, ROTATIONS
from lightloom.golden_model.rays.collector import Packing
from lightloom.golden_model.tables.lightmap import SIDE, SIDE_LEVELS
from tests import ROOT

AMOUNT = re.compile(r"(?:(\d[\d,]*) )?`([A-Z_]+)(?:\.(\w+))?`|(\d[\d,]*) (float32|bits?)")
"""So many records of a format or fields of it; or plain bits and float32."""

PAGE = (ROOT / "docs" / "renderer.md").read_text(encoding="utf-8")


def described(dtype: np.dtype) -> list[tuple[str, str]]:
    """(field, type) as the page writes them."""
    out = []
    for name in dtype.names or ():
        base, shape = dtype[name].base, dtype[name].shape
        width = formats.field_width(base)
        kind = f"{base.kind}{base.itemsize}" if width == 8 * base.itemsize else f"{width} bits"
        kind = "bool" if base == np.bool_ else kind
        out.append((name, f"{shape[0]} {kind}" if shape else kind))
    return out


@pytest.mark.parametrize("name", ["GBUFFER", "TEXEL_STATE", "PUBLISHED_TEXEL"])
def test_format_tables(name: str) -> None:
    section = PAGE.split(f"### {name}\n")[1].split("\n#")[0].strip().split("\n\n")[0]
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", section, re.MULTILINE)
    assert rows == described(getattr(formats, name))


def test_sizes_that_the_page_states() -> None:
    assert bitpack.width(formats.TEXEL_STATE) == 173
    assert bitpack.width(formats.PUBLISHED_TEXEL) == 8 * 8


def number(text: str) -> int:
    return int(text.replace(",", "").replace("*", ""))


def bytes_of(cell: str) -> int:
    """What a cell of a table names, together, in bytes rounded up."""
    total = 0
    for count, name, field, plain, unit in AMOUNT.findall(cell):
        if unit:
            total += number(plain) * (32 if unit == "float32" else 1)
            continue
        dtype = getattr(formats, name)
        width = bitpack.width(np.dtype([(field, dtype[field])]) if field else dtype)
        total += width * (number(count) if count else 1)
    return -(-total // 8)


def table(heading: str) -> list[list[str]]:
    """The cells of the rows of the first table below a heading, without its head."""
    section = PAGE.split(f"### {heading}\n")[1].split("\n#")[0]
    rows = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def test_bytes_that_a_frame_reads_and_writes() -> None:
    for name, _, read, read_bytes, written, written_bytes in table("Passes over a frame"):
        assert (bytes_of(read), bytes_of(written)) == (number(read_bytes), number(written_bytes)), name


def test_bytes_that_an_update_reads_and_writes() -> None:
    *steps, together = table("A texel update")
    totals = [0, 0]
    for name, times, read, read_bytes, written, written_bytes in steps:
        found = bytes_of(read), bytes_of(written)
        assert found == (number(read_bytes), number(written_bytes)), name
        totals = [total + number(times) * part for total, part in zip(totals, found, strict=True)]
    assert totals == [number(together[3]), number(together[5])]


def test_bytes_on_the_chip() -> None:
    for name, holds, size in table("On the chip"):
        assert bytes_of(holds) == number(size), name


def test_sizes_that_are_those_of_the_model() -> None:
    """Numbers of records in the tables that are defaults or constants elsewhere."""
    assert len(table("On the chip")) == 11
    assert Policy().influence_records == 16
    assert class_table(Policy()).size * 4 == 4096
    assert (Packing().definitions, Packing().capacity) == (1024, 64)
    assert COUNT // 4 * 3 + ROTATIONS * 2 == 5120
    assert Rasterization().tile ** 2 * 64 == 65536
    assert sum((SIDE >> level) ** 2 for level in range(SIDE_LEVELS + 1)) == 85
    assert (Sampling().directions, Sampling().light_samples) == (16, 4)

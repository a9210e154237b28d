"""The tables of formats in docs/renderer.md say what the formats say."""

import re
from pathlib import Path

import numpy as np
import pytest

from golden_model import bitpack, formats

PAGE = (Path(__file__).parents[2] / "docs" / "renderer.md").read_text(encoding="utf-8")


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
    assert bitpack.width(formats.TEXEL_STATE) == 8 * 20
    assert bitpack.width(formats.PUBLISHED_TEXEL) == 8 * 8

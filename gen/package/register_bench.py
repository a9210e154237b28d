"""Testbench of a unit behind AXI4-Lite: as `stream_bench`, with operands and results through registers alone."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lightloom.gen.package.files import render
from lightloom.gen.package.memory import Case, memory_port
from lightloom.gen.package.stream_bench import shared, vectors
from lightloom.golden_model.models import model_results
from lightloom.rtl.config import Config

MOST = 200
"""Operations: each takes some hundred cycles."""


def register_bench(unit: Mapping[str, Any], config: Config, asked: np.ndarray | Case) -> dict[str, bytes]:
    """Testbench and vectors of a unit behind AXI4-Lite, and its memory image where it has a memory: name to content.

    `unit` is its manifest; `asked` are operands (N,) of its input's dtype, of a unit with a memory its case.
    """
    module, files = unit["module"], {}
    more: dict[str, Any] = {"memory": None}
    if isinstance(asked, Case):
        operands, results = asked.operands, asked.results
        files[f"{module}.bin"] = asked.image
        more = {"memory": memory_port(unit), "base": asked.base, "memory_bits": asked.memory_bits}
    else:
        operands = asked[:MOST]
        results = model_results(unit["unit"], operands, config.flat())
    last = unit["registers"][-1]
    bench = render(
        "package_register_testbench.v",
        **shared(unit, operands, results),
        address_bits=next(port["width"] for port in unit["ports"] if port["name"] == "s_axi_awaddr"),
        end=last["offset"] + last["width"] // 8,
        at={register["name"]: register["offset"] for register in unit["registers"]},
        fields={field["name"]: field for register in unit["registers"] for field in register["fields"]},
        operands=words(unit, "operand"),
        results=words(unit, "result"),
        **more,
    )
    return files | {f"{module}_tb.v": bench.encode(), f"{module}.hex": vectors(operands, results)}


def words(unit: Mapping[str, Any], kind: str) -> list[tuple[int, list[tuple[int, int, int]]]]:
    """The words that carry the payload of "operand" or "result": byte offset, and of each scalar in it, or part of one,
    its lowest bit in the word and in the payload, and its width. The tag is in none of them."""
    payload = {port["name"]: port for port in unit["ports"]}["i__payload" if kind == "operand" else "o__payload"]
    bits = {
        "_".join([kind, field["name"], *map(str, field["index"])]): field["offset"]
        for field in payload["fields"]
        if field["name"] != "tag"
    }
    found: dict[int, list[tuple[int, int, int]]] = {}
    for register in unit["registers"]:
        for field in register["fields"]:
            name, skipped = field["name"], 0
            if name.removesuffix("_high") in bits and name not in bits:
                name, skipped = name.removesuffix("_high"), 32
            offset = bits.get(name, bits.get(name.removesuffix("_low")))
            if offset is None:
                continue
            for first in range(0, field["width"], 32):  # a field of 64 bits is in two words
                word = register["offset"] + (field["low"] + first) // 32 * 4
                part = (field["low"] % 32, offset + skipped + first, min(field["width"] - first, 32))
                found.setdefault(word, []).append(part)
    return sorted(found.items())

"""Testbenches of a package: Verilog that needs a simulator alone, with vectors of the golden model."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lightloom.gen.package.files import render
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BLOCK_BYTES, SECTION, TRIANGLE
from lightloom.golden_model.models import model_results
from lightloom.golden_model.stimuli.ray_families import adversarial_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.memory_image import pack_image
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.rtl.config import Config

SEED = 2013
TRIANGLES, RAYS = 100, 96
"""Of the scene that the traversal unit is tested on."""


def stream_bench(unit: Mapping[str, Any], config: Config, operands: np.ndarray) -> dict[str, bytes]:
    """Testbench and vectors of a unit with results in order: file name to content.

    `unit` is its manifest, `operands` (N,) are of its input's dtype; a multiple of four of them is used.
    """
    name = unit["unit"]
    operands = operands[: len(operands) // 4 * 4]
    results = model_results(name, operands, config.tree.width)
    bench = render(
        "package_testbench.v",
        **_shared(unit, operands, results),
        latency=unit["latency"],
        interval=unit["initiation_interval"],
    )
    return {f"{name}_tb.v": bench.encode(), f"{name}.hex": _vectors(operands, results)}


def traversal_bench(unit: Mapping[str, Any], config: Config) -> dict[str, bytes]:
    """Testbench, vectors and memory image of a traversal unit: file name to content."""
    name, rng = unit["unit"], np.random.default_rng(SEED)
    triangles = _soup(rng)
    tree = build_wide(triangles, width=config.tree.width, max_levels=config.traversal.stack).blocks
    queries = queries_of(
        adversarial_rays(triangles, RAYS, SEED),
        any_hit=rng.random(RAYS) < 0.4,
        cull=rng.random(RAYS) < 0.25,
        mask=rng.choice(np.array([0xFF, 0x01, 0], dtype=np.uint8), RAYS, p=[0.85, 0.1, 0.05]),
    )
    results, counts = trace_tree(tree, queries, width=config.tree.width, stack=config.traversal.stack, backend="numpy")
    image = pack_image({"bvh": tree})
    first = int(np.frombuffer(image, dtype=SECTION, count=1, offset=BLOCK_BYTES)["first"][0])
    ports = {port["name"]: port["width"] for port in unit["ports"]}
    bench = render(
        "package_traversal_testbench.v",
        **_shared(unit, queries, results),
        widths=ports,
        counters=[port.removeprefix("count_") for port in ports if port.startswith("count_") and port != "count_clear"],
        axi=[port for port in unit["ports"] if port["name"].startswith("m_axi_")],
        base=first * BLOCK_BYTES,
        memory_bits=max(len(image) - 1, 1 << 12).bit_length(),
        overlap=config.traversal.overlap,
        golden_counts={count: int(counts[count].sum()) for count in COUNTS.names or ()},
        errors=int((results["error"] != 0).sum()),
    )
    return {f"{name}_tb.v": bench.encode(), f"{name}.hex": _vectors(queries, results), f"{name}.bin": image}


def _shared(unit: Mapping[str, Any], operands: np.ndarray, results: np.ndarray) -> dict[str, Any]:
    return {
        "unit": unit["unit"],
        "count": len(operands),
        "input_bits": bitpack.width(operands.dtype),
        "output_bits": bitpack.width(results.dtype),
        "tag_bits": unit["config"]["tag_width"],
        "seed": SEED,
    }


def _vectors(operands: np.ndarray, results: np.ndarray) -> bytes:
    """A line of hexadecimal digits an operand: its result's bits above its own, for $readmemh."""
    shift = bitpack.width(operands.dtype)
    digits = -(-(shift + bitpack.width(results.dtype)) // 4)
    lines = [result << shift | operand for operand, result in zip(_whole(operands), _whole(results), strict=True)]
    return "".join(f"{line:0{digits}x}\n" for line in lines).encode()


def _whole(records: np.ndarray) -> list[int]:
    """Records (N,) to payloads."""
    return [int.from_bytes(row.tobytes(), "little") for row in bitpack.pack(records).astype("<u4")]


def _soup(rng: np.random.Generator) -> np.ndarray:
    """Triangles of all sizes, TRIANGLE (TRIANGLES,)."""
    out = np.zeros(TRIANGLES, dtype=TRIANGLE)
    centre, size = rng.normal(size=(TRIANGLES, 3)), np.exp2(rng.uniform(-6, 0, (TRIANGLES, 1)))
    for vertex in TRIANGLE.names or ():
        out[vertex] = centre + size * rng.normal(size=(TRIANGLES, 3))
    return out

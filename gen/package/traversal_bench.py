"""Testbench of the traversal unit: as `stream_bench`, with a scene, a memory and results in any order."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightloom.gen.package.files import render
from lightloom.gen.package.memory import Case, memory_port
from lightloom.gen.package.stream_bench import SEED, shared, vectors
from lightloom.golden_model.contract.formats import BLOCK_BYTES, SECTION, TRIANGLE
from lightloom.golden_model.stimuli.ray_families import adversarial_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.memory_image import pack_image
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.rtl.config import Config

TRIANGLES, RAYS = 100, 96
"""Of the scene."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene(Case):
    """Rays through a tree in a memory image, and what the golden model says of them."""

    counts: np.ndarray


def scene(config: Config) -> Scene:
    """That of the testbenches of a traversal unit."""
    rng = np.random.default_rng(SEED)
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
    return Scene(operands=queries, results=results, counts=counts, image=image, base=first * BLOCK_BYTES)


def traversal_bench(unit: Mapping[str, Any], config: Config) -> dict[str, bytes]:
    """Testbench, vectors and memory image of a traversal unit: file name to content."""
    module, traced = unit["module"], scene(config)
    ports = {port["name"]: port["width"] for port in unit["ports"]}
    bench = render(
        "package_traversal_testbench.v",
        **shared(unit, traced.operands, traced.results),
        widths=ports,
        counters=[port["name"].removeprefix("count_") for port in unit["ports"] if port["role"] == "counter"],
        memory=memory_port(unit),
        base=traced.base,
        memory_bits=traced.memory_bits,
        overlap=config.traversal.overlap,
        golden_counts={count: int(traced.counts[count].sum()) for count in COUNTS.names or ()},
        errors=int((traced.results["error"] != 0).sum()),
    )
    return {
        f"{module}_tb.v": bench.encode(),
        f"{module}.hex": vectors(traced.operands, traced.results),
        f"{module}.bin": traced.image,
    }


def _soup(rng: np.random.Generator) -> np.ndarray:
    """Triangles of all sizes, TRIANGLE (TRIANGLES,)."""
    out = np.zeros(TRIANGLES, dtype=TRIANGLE)
    centre, size = rng.normal(size=(TRIANGLES, 3)), np.exp2(rng.uniform(-6, 0, (TRIANGLES, 1)))
    for vertex in TRIANGLE.names or ():
        out[vertex] = centre + size * rng.normal(size=(TRIANGLES, 3))
    return out

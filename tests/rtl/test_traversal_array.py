# amaranth: UnusedElaboratable=no
# (an array is also made only to ask for its ports)
"""Several traversal units on one memory port: the hits are the model's, and all units share the work."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from lightloom.gen.verilog import ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import RAY_QUERY, TRIANGLE
from lightloom.golden_model.stimuli.ray_families import adversarial_rays, diffuse_rays
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of, trace_tree
from lightloom.rtl.config import PRESETS
from lightloom.rtl.traversal.array import TraversalArray, traversal
from lightloom.rtl.traversal.unit import Traversal
from lightloom.sim.emitted import emitted
from lightloom.sim.traversal import TraversalUnit

SEED = 1989
UNITS = 3
RAYS = 1500
CONFIG = PRESETS["tiny"].but(
    tag_width=6,
    width=8,
    contexts=4,
    node_sets=4,
    node_ways=2,
    triangle_sets=4,
    triangle_ways=2,
    units=UNITS,
)


@cache
def verilog() -> str:
    return emitted("traversal", CONFIG)


@cache
def unit() -> TraversalUnit:
    return TraversalUnit(CONFIG, memory_bits=18, verilog=verilog(), level=1)


@cache
def scene() -> tuple[WideBvh, np.ndarray]:
    """A tree over small triangles in a cube, and RAY_QUERY (RAYS,) of every kind."""
    rng = np.random.default_rng(SEED)
    triangles = np.zeros(400, TRIANGLE)
    centre = rng.random((400, 3), np.float32)
    for name in ("v0", "v1", "v2"):
        triangles[name] = centre + rng.normal(scale=0.05, size=(400, 3)).astype(np.float32)
    rays = np.concatenate(
        [diffuse_rays(triangles, RAYS // 2, SEED), adversarial_rays(triangles, RAYS - RAYS // 2, SEED)]
    )
    masks = rng.choice(np.array([0xFF, 0x0F, 0x30], np.uint8), 400)
    queries = queries_of(
        rays,
        any_hit=rng.random(RAYS) < 0.3,
        cull=rng.random(RAYS) < 0.3,
        mask=rng.choice(np.array([0xFF, 0x10]), RAYS),
    )
    assert queries.dtype == RAY_QUERY
    return build_wide(triangles, masks=masks), queries


@pytest.mark.parametrize(
    "options",
    [
        {"latency": 100},
        {"latency": 0, "overlap": 1},
        {"latency": 30, "reorder": 100, "interleave": True, "memory_stall": 64, "stall_seed": SEED},
    ],
    ids=["overlapped", "in order", "stalled"],
)
def test_hits_are_the_models(options: dict[str, Any]) -> None:
    tree, queries = scene()
    run = unit().run(tree.blocks, queries, seed=SEED, **options)
    wanted, counts = trace_tree(tree.blocks, queries, stack=CONFIG.traversal.stack)
    wrong = np.flatnonzero(~bitpack.equal(wanted, run.results))
    assert not len(wrong), f"seed {SEED}: ray {wrong[0]}: {queries[wrong[0]]}: {run.results[wrong[0]]}"
    assert run.counters["rays"] == RAYS
    if options.get("overlap") == 1:
        for name in counts.dtype.names or ():
            assert run.counters[name] == counts[name].sum(), name
    assert run.beats == run.counters["beats"] == run.bursts * 512 // CONFIG.memory.axi_width


def test_all_units_work_all_the_time() -> None:
    """Also beside a ray that takes most of the run: it meets every box. Rays of many visits go first; in the end such a
    ray would have the array to itself."""
    tree, queries = scene()
    _, counts = trace_tree(tree.blocks, queries, stack=CONFIG.traversal.stack)
    visits = counts["node_tests"] + counts["revisits"] + counts["leaf_visits"]
    assert visits.max() > len(tree.blocks)
    run = unit().run(tree.blocks, queries[np.argsort(visits)[::-1]])
    assert run.most_in_flight >= UNITS * CONFIG.traversal.contexts
    assert run.counters["cycles"] > 0.95 * UNITS * run.cycles


def test_a_tree_that_is_refused() -> None:
    tree, queries = scene()
    broken = tree.blocks.copy()
    broken[0, 0] ^= 1
    run = unit().run(broken, queries[:50])
    assert run.load_error
    assert (run.results["primitive"] == -1).all()
    assert run.results["error"].all()


def test_a_unit_is_written_once() -> None:
    assert verilog().count("\nmodule traversal_unit(") == 1
    assert verilog().count("  traversal_unit unit") == UNITS


def test_the_ports_are_those_of_one_unit() -> None:
    one, several = Traversal(CONFIG.but(units=1)), traversal(CONFIG)
    assert isinstance(several, TraversalArray)
    assert isinstance(traversal(CONFIG.but(units=1)), Traversal)
    widths = [{name: (member.flow, len(value)) for name, member, value in ports_of(each)} for each in (one, several)]
    wider = {name for name in widths[1] if widths[0].get(name) != widths[1][name]}
    assert wider == {"m_axi_arid", "m_axi_rid"}
    assert set(widths[0]) == set(widths[1])
    with pytest.raises(ValueError, match="at least two units, not 1"):
        TraversalArray(CONFIG.but(units=1))

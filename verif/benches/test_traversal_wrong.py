"""The traversal unit and trees, memories and rays that are wrong: those fail that meet what is wrong, and no others."""

from collections.abc import Callable, Iterator
from typing import Any

import cocotb
import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BLOCK_BYTES, TRACE_ERRORS
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh
from lightloom.verif.benches.traversal_bench import BASES, RENDERED, TraversalBench, rays_of
from lightloom.verif.drivers.axi_slave import DECERR, SLVERR
from lightloom.verif.vectors.edited_trees import inner_nodes, leaf_bits, leaves_with, nodes_with, with_header

# --- trees that are wrong ---------------------------------------------------------------------------------------------

DAMAGES: dict[str, tuple[str, Callable[[WideBvh, int], Iterator[tuple[np.ndarray, int]]]]] = {
    "just outside": (
        "outside",
        lambda tree, _: nodes_with(tree, base=lambda address, count: len(tree.blocks) - count + 1),
    ),
    "far outside": ("outside", lambda tree, _: nodes_with(tree, base=lambda address, count: 2**32 - 1)),
    "its own child": ("order", lambda tree, _: nodes_with(tree, base=lambda address, count: address)),
    "back to the root": ("order", lambda tree, _: nodes_with(tree, base=lambda address, count: 1)),
    "triangles as a node": ("kind", lambda tree, _: leaf_bits(tree, True)),
    "a node as triangles": ("kind", lambda tree, _: leaf_bits(tree, False)),
    "too many children": ("kind", lambda tree, width: nodes_with(tree, count=lambda address, count: width + 1)),
    "no kind of node": ("kind", lambda tree, _: nodes_with(tree, kind=lambda address, count: 0)),
    "no triangle": ("kind", lambda tree, _: leaves_with(tree, count=0)),
    "three triangles": ("kind", lambda tree, _: leaves_with(tree, count=3)),
}
"""Name of a damage: the error that it gives, and trees with one block of it."""


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def damaged_blocks(dut: Any, overlap: str) -> None:
    """A block that is wrong fails the rays that meet it, with its address, and no others; before and after, none."""
    bench = TraversalBench(dut)
    await bench.begin(overlap=overlap)
    tree = bench.tree("handful")
    for name, (error, trees) in DAMAGES.items():
        await bench.check_sound(tree, f"before {name}")
        queries = rays_of("handful", bench.few, bench.rng.getrandbits(16), RENDERED)
        queries = bench.some_cut_short(queries, tree)
        blocks, bad, rays = bench.met_by_some(queries, tree, ((*wrong, ()) for wrong in trees(tree, bench.width)))
        await bench.load(blocks)
        await bench.check_failing(rays, tree, TRACE_ERRORS[error], bad, name)
    await bench.check_sound(tree, "after all")


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def memory_errors(dut: Any, overlap: str) -> None:
    """SLVERR and DECERR for one block: as above; and when the memory is whole again, so is the tree, as it is."""
    bench = TraversalBench(dut)
    await bench.begin(overlap=overlap)
    tree = bench.tree("handful")
    kinds = {"nodes": inner_nodes(tree), "triangles": np.flatnonzero(tree.triangle_blocks).tolist(), "root": [1]}
    for called, response in (("SLVERR", SLVERR), ("DECERR", DECERR)):
        for name, addresses in kinds.items():
            await bench.check_sound(tree, f"before {name}")
            queries = rays_of("handful", bench.few, bench.rng.getrandbits(16), RENDERED)
            queries = bench.some_cut_short(queries, tree)
            wrong = ((tree.blocks, address, (address,)) for address in addresses)
            _, bad, rays = bench.met_by_some(queries, tree, wrong)
            await bench.load(tree.blocks)  # what was read before is forgotten
            bench.memory.fails(BASES[0] + BLOCK_BYTES * bad, response)
            await bench.check_failing(rays, tree, TRACE_ERRORS["memory"], bad, f"{called} for {name}")
            bench.memory.errors = {}
            await bench.check(bench.traced(tree.blocks, rays.queries), f"{name}: a memory that is whole again")


@cocotb.test()
async def a_tree_that_is_cut_short(dut: Any) -> None:
    """A header that promises more blocks than there are, and a node whose children would be there: memory errors."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one")
    tree = bench.tree("handful")
    await bench.check_sound(tree, "before")
    count = len(tree.blocks)
    longer = WideBvh(with_header(tree.blocks, blocks=count + 100))
    queries = rays_of("handful", bench.few, bench.seed, RENDERED)
    wrong = nodes_with(longer, base=lambda address, _: count + 5)
    blocks, _, rays = bench.met_by_some(queries, tree, ((*each, ()) for each in wrong))
    for number in range(count, count + 100):
        bench.memory.fails(BASES[0] + BLOCK_BYTES * number, DECERR)
    await bench.load(blocks)
    assert set(rays.results["error"]) == {0, TRACE_ERRORS["memory"]}
    await bench.check(rays, "children beyond the end")
    await bench.check_sound(tree, "after")


@cocotb.test()
@cocotb.parametrize(overlap=["one", "most"])
async def too_few_levels(dut: Any, overlap: str) -> None:
    """A tree deeper than its header says may fill the stack: such rays fail, the others are right."""
    bench = TraversalBench(dut)
    await bench.begin(overlap=overlap)
    tree = bench.tree("soup")
    await bench.load(with_header(tree.blocks, levels=1))
    rays = bench.traced(with_header(tree.blocks, levels=1), rays_of("soup", 4 * bench.few, bench.seed))
    failed = (rays.results["error"] == TRACE_ERRORS["header"]).mean()
    assert failed < 0.9
    assert failed > 0 or bench.stack > 10, "no ray fills the stack"
    if overlap == "one":
        await bench.check(rays, "levels 1")
    else:
        got = await bench.trace(rays)
        whole = bench.traced(tree.blocks, rays.queries)
        sound = got["error"] == 0
        bench.assert_same(got[sound], whole.only(sound), "levels 1")
        assert set(got["error"]) <= {0, TRACE_ERRORS["header"]}
    await bench.check_sound(tree, "after")


HEADERS: dict[str, tuple[str, Callable[[TraversalBench], dict[str, int]]]] = {
    "magic": ("magic", lambda bench: {"magic": 1}),
    "version": ("version", lambda bench: {"version": 2}),
    "check": ("check", lambda bench: {"check": bench.rng.getrandbits(32) | 1}),
    "too wide": ("width", lambda bench: {"width": bench.width + 1}),
    "no levels": ("levels", lambda bench: {"levels": 0}),
    "too many levels": ("levels", lambda bench: {"levels": bench.stack + 1}),
    "root is the header": ("blocks", lambda bench: {"root": 0}),
    "root outside": ("blocks", lambda bench: {"root": int(bench.tree("handful").header["blocks"])}),
    "root far outside": ("blocks", lambda bench: {"root": 2**32 - 1}),
}
"""Name of a damage to a header: the load error that it gives, and the fields with their wrong values."""


@cocotb.test()
async def unusable_headers(dut: Any) -> None:
    """Without a tree, and with one that is refused, all rays fail, until a good one is loaded; then none."""
    bench = TraversalBench(dut)
    await bench.begin()
    tree = bench.tree("handful")
    queries = rays_of("handful", bench.few, bench.seed)
    queries["direction"][0] = 0
    queries["t_max"][1] = queries["t_min"][1]
    none = bench.traced(tree.blocks, queries, bad_blocks=[0])
    assert (none.results["error"] == TRACE_ERRORS["header"]).all()
    assert none.results["invalid"][0]
    assert (int(dut.loaded.value), int(dut.load_error.value)) == (0, 0)
    await bench.check(none, "no tree yet")
    assert bench.memory.bursts == 0
    for name, (error, fields) in HEADERS.items():
        await bench.check_sound(tree, f"before {name}")
        blocks = with_header(tree.blocks, **fields(bench))
        await bench.load(blocks, error=error)
        bursts = bench.memory.bursts
        rays = bench.traced(blocks, queries)
        assert bitpack.equal(rays.results, none.results).all()
        await bench.check(rays, name)
        assert bench.memory.bursts == bursts, "the memory was read for rays without a tree"
    for called, response in (("SLVERR", SLVERR), ("DECERR", DECERR)):
        await bench.check_sound(tree, f"before {called}")
        bench.memory.fails(BASES[0], response)
        await bench.load(tree.blocks, error="memory")
        await bench.check(none, f"response {response} for the header")
        bench.memory.errors = {}
    await bench.check_sound(tree, "after all")


@cocotb.test()
async def root_of_another_kind(dut: Any) -> None:
    """A root that is a block of triangles: every ray that is traversed fails there."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one")
    tree = bench.tree("handful")
    root = int(np.flatnonzero(tree.triangle_blocks)[0])
    blocks = with_header(tree.blocks, root=root)
    await bench.load(blocks)
    rays = bench.traced(blocks, rays_of("handful", bench.few, bench.seed))
    failed = rays.results["error"] == TRACE_ERRORS["kind"]
    assert failed.any()
    assert (rays.results["block"][failed] == root).all()
    await bench.check(rays, "root")
    await bench.check_sound(tree, "after")


# --- rays that are wrong ----------------------------------------------------------------------------------------------

NAN, INFINITE, TINY = (np.float32(value) for value in (np.nan, np.inf, 1e-40))
FAULTS: dict[str, tuple[bool, dict[str, Any]]] = {
    "zero direction": (True, {"direction": (0, -0.0, 0)}),
    "subnormal direction": (True, {"direction": (TINY, -TINY, 0)}),
    "NaN direction": (True, {"direction": (1, NAN, 0)}),
    "infinite direction": (True, {"direction": (0, 1, INFINITE)}),
    "huge direction": (True, {"direction": (1, -(2.0**127), 0)}),
    "NaN origin": (True, {"origin": (NAN, 0, 0)}),
    "infinite origin": (True, {"origin": (0, 0, -INFINITE)}),
    "NaN t_min": (True, {"t_min": NAN}),
    "NaN t_max": (True, {"t_max": NAN}),
    "both NaN": (True, {"t_min": NAN, "t_max": NAN, "direction": (NAN, NAN, NAN)}),
    "empty range": (False, {"t_min": 1, "t_max": 1}),
    "backward range": (False, {"t_min": 2, "t_max": 1}),
    "range of zeros": (False, {"t_min": -0.0, "t_max": 0}),
    "range of subnormals": (False, {"t_min": -TINY, "t_max": TINY}),
    "range at infinity": (False, {"t_min": INFINITE, "t_max": INFINITE}),
}
"""Name of a fault: whether the ray is then invalid, and the fields with their values."""


@cocotb.test()
async def rays_that_cannot_hit(dut: Any) -> None:
    """Each among good rays: a miss without a visit, flagged where it is invalid; the others are right."""
    bench = TraversalBench(dut)
    await bench.begin(overlap="one")
    tree = bench.tree("handful")
    await bench.load(tree.blocks)
    queries = rays_of("handful", 2 * len(FAULTS), bench.seed, RENDERED)
    wrong = np.arange(len(FAULTS)) * 2 + 1
    for k, (_, fields) in zip(wrong, FAULTS.values(), strict=True):
        for name, value in fields.items():
            queries[name][k] = value
    rays = bench.traced(tree.blocks, queries)
    for k, (name, (invalid, _)) in zip(wrong, FAULTS.items(), strict=True):
        result = rays.results[k]
        assert (result["primitive"], result["invalid"], result["error"]) == (-1, invalid, 0), f"{name}: {result}"
        assert sum(rays.counts[k].item()) == 0, name
    assert (rays.results["primitive"][~np.isin(np.arange(len(queries)), wrong)] >= 0).any()
    await bench.check(rays, "good and bad")
    await bench.check(rays.only(wrong), "bad ones alone")

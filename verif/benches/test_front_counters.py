"""Counters behind AXI4-Lite are read in halves while they run: none is ever torn."""

from typing import Any

import cocotb
import numpy as np

from lightloom.verif.benches.front_bench import FrontBench
from lightloom.verif.benches.test_stream_unit import payloads
from lightloom.verif.benches.traversal_bench import RENDERED, rays_of
from lightloom.verif.drivers.register_model import WORD

RAYS = 6000
"""Of the streams: enough that they never end while counters are read."""


@cocotb.test()
@cocotb.parametrize(willing=["always", "half", "bursts"])
async def counters_are_read_whole(dut: Any, willing: str) -> None:
    """Counters that begin just below a carry (`sim.run_traversal_front_bench`) are read while they run, until
    enough of them have carried between the reads of their halves: none is ever torn."""
    bench = FrontBench(dut)
    await bench.begin(willing=willing)
    tree = bench.tree("soup")
    await bench.load_tree(tree.blocks)
    queries = rays_of("soup", RAYS, bench.seed, RENDERED)
    offered = payloads(queries, np.arange(RAYS) % (1 << bench.tag_width))
    running = cocotb.start_soon(bench.exchange(offered, "always", "always"))
    begins, torn = bench.run["near_carry"], 0
    while torn < bench.torn:
        cleared = (await bench.write(count_clear=1)).done_at
        last = {"count_cycles": begins, "count_beats": begins}
        while last["count_cycles"] < (1 << 32) + 10:
            name = bench.rng.choice(["count_cycles", "count_cycles", "count_beats"])
            low = await bench.lite.read(bench.offsets[name])
            if bench.rng.random() < 0.5:  # what is read between the halves, and has none
                await bench.word(bench.rng.choice(["status", "overlap", "events"]))
            high = await bench.lite.read(bench.offsets[name] + WORD)
            assert low.word is not None
            assert high.word is not None
            value = high.word << 32 | low.word
            passed = low.done_at - cleared
            assert last[name] <= value <= begins + passed, (
                f"seed {bench.seed}: {name} {value:#x} behind {last[name]:#x}, {passed} cycles after {begins:#x}"
            )
            torn += name == "count_cycles" and low.word + high.done_at - low.done_at >= 1 << 32 > low.word
            last[name] = value
            assert not running.done(), "too few rays for so many rounds"
    running.cancel()

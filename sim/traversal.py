"""The traversal unit at speed: a C++ loop around the Verilated unit and the memory of the simulations.

Rays in, results in the order of the rays out, and what the unit and the memory have counted.
"""

from dataclasses import dataclass

import numpy as np

from lightloom.golden_model.contract.formats import BLOCK_BYTES, RAY_QUERY, RAY_RESULT
from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.emitted import emitted
from lightloom.sim.system import Content, Manner, RunError, System, strobe, until

BASE = 4096
"""Byte address of the tree: not zero, so that a unit which leaves it out is found out."""
MEMORY_BITS = 27
"""The memory has room for trees over two and a half million triangles."""
GREATEST_MEMORY_BITS = 30
WORKING = ("node_tests", "leaf_visits")
"""Counters that move as long as the unit works on a ray."""
STEPS = (
    strobe("load"),
    until(["loaded", "load_error"], "the unit hangs: it does not load the tree"),
    strobe("count_clear"),
)
"""Before the first ray."""


TraversalError = RunError
"""The unit broke the rules of its streams or of AXI: a tag that is not a ray's, a lost result, a hang."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TraversalRun:
    """What came out of a run."""

    results: np.ndarray
    """RAY_RESULT (N,), in the order of the rays."""
    cycles: int
    """From the first ray that entered the unit to the last result."""
    counters: dict[str, int]
    """The unit's, without "count_"."""
    bursts: int
    """Read bursts that the memory accepted, in these cycles; the header's, read before, is not among them."""
    beats: int
    """Beats of data that the unit took."""
    load_error: int
    """Why the unit refused the tree; 0: it did not."""
    most_in_flight: int
    """Rays that were in the unit at a time, at most."""
    throughput: float
    """Cycles/s of the simulation, on one core."""


def memory_bits(blocks: np.ndarray) -> int:
    """The `memory_bits` of a `TraversalUnit` that has room for the tree: as a rule the same for all scenes."""
    return min(max(MEMORY_BITS, (BASE + blocks.nbytes - 1).bit_length()), GREATEST_MEMORY_BITS)


class TraversalUnit:
    """The Verilated traversal unit with its memory.

    Parameters: `config`, the hardware's, with `units` of them; `memory_bits`, the memory holds 2**memory_bits bytes;
    `verilog`, the text of module `traversal` instead of the unit's own; `level`, that of `sim.verilated.build`. Builds
    the simulator, or finds it in the cache. Raises InputError for a missing tool.
    """

    def __init__(
        self,
        config: Config = PRESETS["base"],
        *,
        memory_bits: int = MEMORY_BITS,
        verilog: str | None = None,
        level: int = 2,
    ):
        self.config = config
        self.system = System(
            "traversal",
            emitted("traversal", config) if verilog is None else verilog,
            input=RAY_QUERY,
            output=RAY_RESULT,
            tag_width=config.streams.tag_width,
            memory_bits=memory_bits,
            level=level,
        )

    def run(
        self,
        blocks: np.ndarray,
        queries: np.ndarray,
        *,
        overlap: int | None = None,
        latency: int = 100,
        bandwidth: int = 256,
        reorder: int = 0,
        interleave: bool = False,
        memory_stall: int = 0,
        seed: int = 1,
        stall_seed: int | None = None,
        bad_blocks: tuple[int, int] | None = None,
        base: int = BASE,
        read_timeout: int = 0,
    ) -> TraversalRun:
        """A tree, uint32 (B, 16), block after block, and RAY_QUERY (N,) to what comes out.

        `overlap`: visits of a ray under way, else as many as the unit can. `latency` to `seed` are the memory's inputs
        (docs/axi_memory.md). `stall_seed` (1 to 2**63 - 1): the harness stalls both sides at random. `bad_blocks`: for
        the first to the last of them the memory answers with an error. `base`: byte address of the tree.
        `read_timeout`: the unit's port. Raises TraversalError where the unit breaks a rule, InputError where the tree
        is larger than the memory.
        """
        if queries.dtype != RAY_QUERY:
            raise TypeError(f"queries are of dtype RAY_QUERY, not {queries.dtype}")
        run = self.system.run(
            queries,
            controls={
                "overlap": self.config.traversal.overlap if overlap is None else overlap,
                "base": base,
                "read_timeout": read_timeout,
            },
            steps=STEPS,
            manner=Manner(
                latency=latency,
                bandwidth=bandwidth,
                reorder=reorder,
                interleave=int(interleave),
                stall=memory_stall,
                seed=seed,
                **_errors(base, bad_blocks),
            ),
            content=self._content(base, blocks),
            stall_seed=stall_seed,
            # A ray may visit every block several times, one after the other.
            patience=1_000_000 + 8 * len(blocks) * (1000 + latency),
            working=WORKING,
        )
        return TraversalRun(
            results=run.results,
            cycles=run.cycles,
            counters=run.counters,
            bursts=run.figures["read_bursts"],
            beats=run.figures["read_beats"],
            load_error=run.statuses["load_error"],
            most_in_flight=run.most_in_flight,
            throughput=run.throughput,
        )

    def _content(self, base: int, blocks: np.ndarray) -> Content:
        """A tree from `base` on. Raises InputError where it is larger than the memory."""
        image = np.ascontiguousarray(blocks, dtype="<u4").tobytes()
        if base + len(image) > self.system.memory_bytes:
            raise InputError(
                f"a tree of {len(image):,} bytes at {base:,} is more than the simulated memory holds, "
                f"{self.system.memory_bytes:,}; use a smaller scene"
            )
        return Content(base=base, image=image)


def _errors(base: int, blocks: tuple[int, int] | None) -> dict[str, int]:
    """The memory's inputs with which it answers with an error for the first to the last of some blocks."""
    if blocks is None:
        return {}
    first, last = blocks
    return {
        "error_enable": 1,
        "error_first": base + first * BLOCK_BYTES,
        "error_last": base + (last + 1) * BLOCK_BYTES - 1,
    }

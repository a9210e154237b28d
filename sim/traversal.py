"""The traversal unit at speed: a C++ loop around the Verilated unit and the memory of the simulations.

Rays in, results in the order of the rays out, and what the unit and the memory have counted.
"""

import re
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lightloom.gen.watched import axi_of, checker, ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.axi_rules import AXI_RULES, rule_of
from lightloom.golden_model.contract.formats import BLOCK_BYTES, RAY_QUERY, RAY_RESULT
from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim import verilated
from lightloom.sim.emitted import emitted

HERE = Path(__file__).parent
TOP, HARNESS, MEMORY = (HERE / name for name in ("traversal_run.v", "traversal_run.cpp", "axi_memory.v"))
BASE = 4096
"""Byte address of the tree: not zero, so that a unit which leaves it out is found out."""
MEMORY_BITS = 27
"""The memory has room for trees over two and a half million triangles."""
GREATEST_MEMORY_BITS = 30
WORKING = ("node_tests", "leaf_visits")
"""Counters that move as long as the unit works on a ray."""


class TraversalError(AssertionError):
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
    `verilog`, the text of module `traversal` instead of the unit's own; not `optimised`, for few rays, as in
    `sim.verilated.build`. Builds the simulator, or finds it in the cache. Raises InputError for a missing tool.
    """

    def __init__(
        self,
        config: Config = PRESETS["base"],
        *,
        memory_bits: int = MEMORY_BITS,
        verilog: str | None = None,
        optimised: bool = True,
    ):
        self.config = config
        self._memory_bytes = 1 << memory_bits
        verilog = emitted("traversal", config) if verilog is None else verilog
        ports = port_widths(verilog, "traversal")
        self._counters = [name.removeprefix("count_") for name in ports if name.startswith("count_")]
        self._counters.remove("clear")
        counters = [
            f".count_{name}(counters[{64 * k + ports[f'count_{name}'] - 1}:{64 * k}]),"
            for k, name in enumerate(self._counters)
        ]
        defines = {
            "QUERY_BITS": bitpack.width(RAY_QUERY),
            "RESULT_BITS": bitpack.width(RAY_RESULT),
            "TAG_BITS": config.streams.tag_width,
            "ADDRESS_BITS": ports["m_axi_araddr"],
            "AXI_BITS": ports["m_axi_rdata"],
            "ID_BITS": ports["m_axi_arid"],
            "LOAD_ERROR_BITS": ports["load_error"],
            "OVERLAP_BITS": ports["overlap"],
            "TIMEOUT_BITS": ports["read_timeout"],
            "MEMORY_BITS": memory_bits,
            "COUNTER_NUMBER": len(self._counters),
            "RULE_BITS": len(AXI_RULES).bit_length(),
            "COUNTERS": "".join(counters),
            "PROGRESS": ",".join(str(self._counters.index(name)) for name in WORKING),
        }
        self._binary = verilated.build(
            "traversal",
            verilog + checker(axi_of(ports_of(verilog, "traversal"))),
            top=TOP,
            others=[MEMORY],
            harness=HARNESS,
            defines=[f"{name}={value}" for name, value in defines.items()],
            optimised=optimised,
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
        if stall_seed is not None and not 0 < stall_seed < 1 << 63:
            raise ValueError("stall_seed must be 1 to 2**63 - 1")
        image = np.ascontiguousarray(blocks, dtype="<u4").tobytes()
        if base + len(image) > self._memory_bytes:
            raise InputError(
                f"a tree of {len(image):,} bytes at {base:,} is more than the simulated memory holds, "
                f"{self._memory_bytes:,}; use a smaller scene"
            )
        options = {
            "overlap": self.config.traversal.overlap if overlap is None else overlap,
            "latency": latency,
            "bandwidth": bandwidth,
            "reorder": reorder,
            "interleave": int(interleave),
            "stall": memory_stall,
            "seed": seed,
            "stall_seed": stall_seed or 0,
            "base": base,
            "read_timeout": read_timeout,
            # A ray may visit every block several times, one after the other.
            "patience": 1_000_000 + 8 * len(blocks) * (1000 + latency),
        }
        if bad_blocks is not None:
            first, last = bad_blocks
            options |= {"error_enable": 1, "error_first": base + first * BLOCK_BYTES}
            options |= {"error_last": base + (last + 1) * BLOCK_BYTES - 1}
        words = bitpack.words(RAY_RESULT)
        with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
            source, target, memory = (Path(scratch) / name for name in ("queries", "results", "image"))
            bitpack.pack(queries).tofile(source)
            with target.open("wb") as file:
                file.truncate(len(queries) * words * 4)
            with memory.open("wb") as file:
                file.seek(base)
                file.write(image)
            command = [str(self._binary), str(source), str(target), str(len(queries))]
            command += [f"{name}={value}" for name, value in options.items()]
            done = subprocess.run([*command, f"+image={memory}"], capture_output=True, text=True)
            packed = np.fromfile(target, dtype=np.uint32).reshape(-1, words)
        if done.returncode:
            said = [line for line in done.stdout.splitlines() if line.startswith("axi_memory:")][:1]
            rules = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("axi_rules ")]
            broken = [rule_of(int(number)) for numbers in rules for number in numbers if int(number)]
            message = "; ".join([done.stderr.strip() or str(done.returncode), *broken, *said])
            raise TraversalError(
                f"traversal ({', '.join(f'{name} {value}' for name, value in options.items())}): {message}"
            )
        figures = [line.split() for line in done.stdout.splitlines()]
        counts = [int(value) for name, value in figures if name == "counter"]
        figure = {name: value for name, value in figures if name != "counter"}
        return TraversalRun(
            results=bitpack.unpack(packed, RAY_RESULT),
            cycles=int(figure["cycles"]),
            counters=dict(zip(self._counters, counts, strict=True)),
            bursts=int(figure["bursts"]),
            beats=int(figure["beats"]),
            load_error=int(figure["load_error"]),
            most_in_flight=int(figure["most_in_flight"]),
            throughput=int(figure["simulated"]) / float(figure["seconds"]),
        )


def port_widths(verilog: str, module: str) -> dict[str, int]:
    """Width in bits of every port of a module, from its text as Yosys writes it."""
    start = re.search(rf"^module {module}\(", verilog, re.MULTILINE)
    assert start is not None, f"no module {module}"
    text = verilog[start.start() : verilog.index("endmodule", start.start())]
    ports = re.findall(r"^  (?:input|output) (?:\[(\d+):0\] )?(\w+);", text, re.MULTILINE)
    return {name: int(high or 0) + 1 for high, name in ports}

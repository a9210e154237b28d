"""Runs the benches of the traversal unit behind AXI4-Lite."""

import json
import re
from dataclasses import asdict, dataclass
from pathlib import Path

from lightloom.gen.manifest import manifest
from lightloom.gen.watched import ports_of, watched
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.config import Config
from lightloom.sim.emitted import emitted
from lightloom.sim.run_traversal_bench import SMALL
from lightloom.sim.runner import run_cocotb

BUS = "axi4-lite"
BENCHES = "lightloom.verif.benches."
FRONT = f"{BENCHES}test_front,{BENCHES}test_front_aborts"
COUNTERS = f"{BENCHES}test_front_counters"
NEAR_CARRY = (1 << 32) - 150
"""Where counters begin whose upper words are to be read: a simulation from 0 would not come to a carry."""


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How much of everything."""

    accesses: int = 300
    """At random, of reads and of writes."""
    few: int = 12
    """Rays through registers."""
    torn: int = 5
    """Times that a counter carries between the reads of its halves."""
    times: int = 4
    """Aborts in each phase."""
    settle: int = 250
    """Cycles from what causes an event to when it has surely happened."""


SIZES = Sizes()


def run_front_bench(
    simulator: str,
    folder: Path,
    *,
    seed: int,
    sizes: Sizes = SIZES,
    config: Config = SMALL,
    counters: bool = False,
    verilog: str | None = None,
    only: str | None = None,
) -> int:
    """Runs them; returns how many tests passed. With `counters` it is the bench of these alone, in which clearing sets
    them to NEAR_CARRY. `verilog` replaces the emitted text, `only` is that of `sim.runner.run_cocotb`. Raises
    BenchError where a test fails.
    """
    described = manifest("traversal", config, bus=BUS)
    module = described["module"]
    text = emitted("traversal", config, bus=BUS) if verilog is None else verilog
    if counters:
        text, found = re.subn(r"\b(count_\w+ <=) 48'h0{12};", rf"\1 48'h{NEAR_CARRY:012x};", text)
        assert found == len(re.findall(r"\boutput \[47:0\] count_", text)) // 2 > 0, "all counters, and nothing else"
    flat = config.flat()
    run = asdict(sizes) | {"seed": seed, "patience": 20_000, "rays": 0, "near_carry": NEAR_CARRY}
    run |= {name: flat[name] for name in ("width", "stack", "overlap", "contexts", "units")}
    run |= {"lines": {"node": config.node_cache.lines, "triangle": config.triangle_cache.lines}}
    run |= {"registers": described["registers"], "counters": []}
    ports = ports_of(text, module)
    return run_cocotb(
        f"{module}_watched",
        {f"{module}.v": text, f"{module}_watched.v": watched(module, ports)},
        simulator,
        module=COUNTERS if counters else FRONT,
        public_ports=[*ports, *RULE_PORTS, "axi_forget"],
        extra_env={"LIGHTLOOM_BENCH": json.dumps(run)},
        seed=seed,
        only=only,
        folder=folder,
    )

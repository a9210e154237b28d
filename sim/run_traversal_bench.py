"""Runs the traversal unit's bench, and the small unit that it is run on as a rule."""

import json
from pathlib import Path
from typing import Any

from lightloom.gen.manifest import manifest
from lightloom.gen.watched import ports_of, watched
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.emitted import emitted
from lightloom.sim.runner import run_cocotb

MODULES = ",".join(
    (
        "lightloom.verif.benches.test_traversal",
        "lightloom.verif.benches.test_traversal_wrong",
        "lightloom.verif.benches.test_traversal_memory",
    )
)
SEED = 2718
TAGS = 14
"""Bits of a tag: every ray of a test has its own."""
SMALL = PRESETS["tiny"].but(
    tag_width=TAGS,
    width=4,
    stack=6,
    overlap=3,
    node_sets=8,
    node_ways=2,
    node_misses=6,
    triangle_sets=8,
    triangle_ways=2,
    triangle_misses=4,
)
"""Little of everything, so that stacks, caches and queues are full now and then, and Icarus can simulate it."""


def run_traversal_bench(
    folder: Path,
    simulator: str,
    config: Config = SMALL,
    *,
    rays: int,
    few: int = 30,
    patience: int = 20_000,
    seed: int = SEED,
    verilog: str | None = None,
    only: str | None = None,
    waves: bool = False,
    coverage: bool = False,
) -> int:
    """Runs the bench, or its tests whose names match `only`; returns how many passed.

    `rays` go through the unit with all sides stalled; the other tests trace `few` at a time. A unit from which nothing
    comes in `patience` cycles hangs: a ray that meets every box may take thousands. The other options are those of
    `sim.runner.run_cocotb`. Raises BenchError where a test fails.
    """
    text = emitted("traversal", config) if verilog is None else verilog
    description: dict[str, Any] = {"seed": seed, "rays": rays, "few": few, "patience": patience}
    description |= {name: config.flat()[name] for name in ("width", "stack", "overlap", "contexts", "units")}
    ports = manifest("traversal", config)["ports"]
    description["counters"] = [port["name"].removeprefix("count_") for port in ports if port["role"] == "counter"]
    description["lines"] = {
        "node": config.node_cache.lines,
        "triangle": config.triangle_cache.lines,
    }
    ports = ports_of(text, "traversal")
    return run_cocotb(
        "traversal_watched",
        {"traversal.v": text, "traversal_watched.v": watched("traversal", ports)},
        simulator,
        module=MODULES,
        public_ports=[*ports, *RULE_PORTS, "axi_forget"],
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description)},
        seed=seed,
        only=only,
        folder=folder,
        waves=waves,
        coverage=coverage,
    )

"""The traversal unit's bench on both simulators, and units that it has to find broken."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from rtl.config import PRESETS, Config
from sim.emitted import emitted
from sim.runner import run_cocotb
from sim.traversal import port_widths
from tests.simulators import needs_icarus

SEED = 2718
TAGS = 14
"""Bits of a tag: every ray of a test has its own."""
TESTS = 25
SMALL = replace(
    PRESETS["tiny"],
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
BASE = replace(PRESETS["base"], tag_width=TAGS)


def bench(
    folder: Path,
    simulator: str,
    config: Config,
    *,
    rays: int,
    few: int = 30,
    verilog: str | None = None,
    only: str | None = None,
) -> int:
    """Runs verif/test_traversal.py, or its tests whose names match `only`.

    `rays` go through the unit with all sides stalled; the other tests trace `few` at a time.
    """
    text = emitted("traversal", config) if verilog is None else verilog
    description = {"seed": SEED, "rays": rays, "few": few}
    description |= {name: getattr(config, name) for name in ("width", "stack", "overlap", "contexts")}
    return run_cocotb(
        "traversal",
        {"traversal.v": text},
        simulator,
        module="verif.test_traversal",
        public_ports=list(port_widths(text, "traversal")),
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description), **({"COCOTB_TEST_FILTER": only} if only else {})},
        seed=SEED,
        folder=folder,
    )


@pytest.mark.parametrize(
    ("simulator", "config", "rays", "few"),
    [
        pytest.param("verilator", SMALL, 10_000, 30, id="verilator-small"),
        pytest.param("verilator", BASE, 10_000, 30, id="verilator-base"),
        pytest.param("icarus", SMALL, 1_000, 12, id="icarus-small", marks=[pytest.mark.icarus, needs_icarus]),
    ],
)
def test_bench(simulator: str, config: Config, rays: int, few: int, tmp_path: Path) -> None:
    assert bench(tmp_path, simulator, config, rays=rays, few=few) == TESTS

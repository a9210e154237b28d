"""The benches of the traversal unit behind AXI4-Lite on both simulators."""

from pathlib import Path

import pytest

from lightloom.sim.run_traversal_front_bench import Sizes, run_front_bench
from tests.simulators import needs_icarus

SEED = 1931
SMALLER = Sizes(accesses=120, few=3, torn=2, times=1)
"""For Icarus, which is there for what is undefined and for the order of events. Of that, tests/verif/test_registers.py
has smaller units behind the same registers for every day."""
PARTS = {
    "registers": ("reset_values|accesses_at_random", 8),
    "events": ("events_while|interrupt_of|refused", 5),
    "rays": ("rays_of_both|what_waits", 5),
    "aborts": ("aborts", 9),
}
"""Names of tests, and how many there are."""


def sizes(simulator: str) -> Sizes:
    return Sizes() if simulator == "verilator" else SMALLER


@pytest.mark.parametrize(
    ("part", "simulator"),
    [
        *(pytest.param(part, "verilator", id=f"{part}-verilator") for part in PARTS),
        *(
            pytest.param(
                part,
                "icarus",
                id=f"{part}-icarus",
                marks=[pytest.mark.icarus, needs_icarus, pytest.mark.long],
            )
            for part in PARTS
        ),
    ],
)
def test_front(part: str, simulator: str, tmp_path: Path) -> None:
    only, tests = PARTS[part]
    assert run_front_bench(simulator, tmp_path, seed=SEED, sizes=sizes(simulator), only=only) == tests


@pytest.mark.parametrize(
    "simulator", ["verilator", pytest.param("icarus", marks=[pytest.mark.icarus, pytest.mark.long, needs_icarus])]
)
def test_counters(simulator: str, tmp_path: Path) -> None:
    assert run_front_bench(simulator, tmp_path, seed=SEED, sizes=sizes(simulator), counters=True) == 3

"""The traversal unit's bench on both simulators, and units that it has to find broken."""

from pathlib import Path

import pytest

from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.emitted import emitted
from lightloom.sim.run_traversal_bench import SMALL, TAGS, run_traversal_bench
from lightloom.sim.runner import BenchError
from tests.simulators import SIMULATORS, needs_icarus

TESTS = 41
BASE = PRESETS["base"].but(tag_width=TAGS)


@pytest.mark.parametrize(
    ("config", "rays", "few"),
    [
        pytest.param(BASE, 10_000, 30, id="base", marks=pytest.mark.long),
        pytest.param(SMALL, 1_000, 10, id="small"),
    ],
)
def test_bench_on_verilator(config: Config, rays: int, few: int, tmp_path: Path) -> None:
    assert run_traversal_bench(tmp_path, "verilator", config, rays=rays, few=few) == TESTS


@pytest.mark.long
@pytest.mark.icarus
@needs_icarus
def test_bench_on_icarus(tmp_path: Path) -> None:
    """The tests in which everything stalls, starts and ends: Icarus, ten times slower, is there for what is undefined
    and for the order of events. `test_ten_thousand_rays` has all of them."""
    only = "all_sides_stalled|one_side_closed|another_tree_while|reset_in_flight|abort_while|never_end"
    assert run_traversal_bench(tmp_path, "icarus", rays=400, few=10, only=only) == 19


def test_aborts_of_an_array(tmp_path: Path) -> None:
    """Its units come to the end of their reads at different times, and its own port holds addresses, too."""
    config = SMALL.but(units=2, contexts=4)
    assert run_traversal_bench(tmp_path, "verilator", config, rays=0, few=3, only="abort") == 7


@pytest.mark.long
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_ten_thousand_rays(simulator: str, tmp_path: Path) -> None:
    assert run_traversal_bench(tmp_path, simulator, SMALL, rays=10_000) == TESTS


# --- broken units -----------------------------------------------------------------------------------------------------


SWAPPED = "{ statuses_r_data[13:1], ~statuses_r_data[0]"


def broken(verilog: str, module: str, original: str, mutant: str) -> str:
    """The unit with another text in one of its modules."""
    begin = verilog.index(f"module \\traversal.{module} (")
    end = verilog.index("endmodule", begin)
    assert verilog.count(original, begin, end) == 1, f"{original!r} is not once in {module}"
    return verilog[:begin] + verilog[begin:end].replace(original, mutant) + verilog[end:]


@needs_icarus
@pytest.mark.icarus
@pytest.mark.parametrize(
    ("module", "original", "mutant", "only", "message"),
    [
        ("results", "= { statuses_r_data[13:0]", "= { ~statuses_r_data[13:0]", "stalled/run=5", "of no request"),
        ("results", "= { statuses_r_data[13:0]", f"= {SWAPPED}", "stalled/run=5", "results differ"),
        ("results", "<= i__valid", "<= i__valid | (o__valid & ray[0])", "stalled/run=5", "doubled tags"),
        ("results", "if (moves) o__valid <=", "o__valid <=", "stalled/run=5", "was withdrawn|result changed"),
        ("results", "= o__valid & o__ready", "= o__valid", "stalled/run=5", "result changed|hangs"),
        ("arbiter.addresses", "if (moves) o__valid <=", "o__valid <=", "stalled/run=0", "ar_withdrawn"),
        ("triangle_blocks.cache.lines", "invalidate ? ", "1'h0 ? ", "another_tree$", "(renumbered|soup) at .*differ"),
        ("loader", " & idle", "", "another_tree_while", "nothing is there|differ"),
        ("nodes", "block[63:32] <= visit", "block[63:32] < visit", "damaged_blocks/overlap=one", "hangs|child.*differ"),
        ("nodes", "> blocks", ">= blocks", "stalled/run=3", "results differ"),
        ("nodes", "> blocks", ">= blocks", "step_by_step", r"traversal, step \d+, ray .*state before: node_tests"),
        ("node_blocks.cache.fill", " | has_failed;", ";", "memory_errors/overlap=one", "SLVERR .*differ"),
    ],
    ids=[
        "wrong tag",
        "swapped tags",
        "doubled",
        "withdrawn",
        "freed too early",
        "address withdrawn",
        "cache keeps a tree",
        "load in flight",
        "cycle",
        "last block",
        "last block, by steps",
        "error in one beat",
    ],
)
def test_bench_catches_a_broken_unit(
    module: str, original: str, mutant: str, only: str, message: str, tmp_path: Path
) -> None:
    verilog = broken(emitted("traversal", SMALL), module, original, mutant)
    with pytest.raises(BenchError, match=message):
        run_traversal_bench(tmp_path, "icarus", SMALL, rays=400, few=10, patience=3000, verilog=verilog, only=only)


def test_bench_catches_a_unit_that_hangs(tmp_path: Path) -> None:
    """Of the requests that wait for a block, all but one are lost. On Verilator, since it takes thousands of cycles to
    know that nothing will come."""
    waiters, last = "node_blocks.cache.waiters", "data.last  <= first;"
    verilog = broken(emitted("traversal", SMALL), waiters, last, last.replace("first", "1'h1"))
    with pytest.raises(BenchError, match="hangs"):
        run_traversal_bench(
            tmp_path, "verilator", SMALL, rays=400, few=10, patience=3000, verilog=verilog, only="stalled/run=0"
        )

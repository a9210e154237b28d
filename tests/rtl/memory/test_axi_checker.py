# amaranth: UnusedElaboratable=no
# (a checker that cannot be built is tried)
"""The checker of AXI4 ports: silent while all rules are kept, and it names the rule that a fault breaks."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from amaranth import ClockDomain, Module, Signal

from lightloom.gen.verilog import convert, ports_of
from lightloom.golden_model.contract.axi_rules import AXI_RULES, rule_of
from lightloom.rtl.memory.axi import Axi
from lightloom.rtl.memory.axi_checker import AxiChecker
from lightloom.sim.runner import run_cocotb
from lightloom.verif.vectors.axi_faults import FAULTS
from lightloom.verif.vectors.axi_traces import Cycle, Port, legal_trace
from tests.gen.test_lint import WAIVERS, lint
from tests.rtl.simulation import Simulation
from tests.simulators import SIMULATORS

SEED = 405


def checker_of(port: Port) -> AxiChecker:
    axi = Axi(address_width=port.address_width, data_width=port.data_width, id_width=port.id_width)
    reads = 1 if port.blocks else port.reads
    return AxiChecker(axi, blocks=port.blocks, reads=reads, writes=port.writes, ahead=port.ahead)


@cache
def compiled(port: Port) -> tuple[AxiChecker, Signal, Simulation]:
    """The checker of a port, its reset, and both in a simulator."""
    domain = ClockDomain("sync")
    dut = Module()
    dut.domains += domain
    dut.submodules.checker = checker = checker_of(port)
    return checker, domain.rst, Simulation(dut)


def watched(port: Port, trace: list[Cycle]) -> list[tuple[str, str]]:
    """For each cycle, which rules of the master and of the slave the checker has named up to then."""
    checker, reset, simulation = compiled(port)
    inputs = {name: reset if name == "rst" else getattr(checker.m_axi, name) for name in trace[0]}
    seen = []

    async def testbench(ctx: Any) -> None:
        for cycle in trace:
            for name, value in cycle.items():
                ctx.set(inputs[name], value)
            await ctx.tick()
            seen.append((rule_of(ctx.get(checker.master_rule)), rule_of(ctx.get(checker.slave_rule))))

    simulation.run(testbench)
    return seen


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("blocks", [True, False], ids=["blocks", "any bursts"])
@pytest.mark.parametrize("data_width", [32, 128, 512])
def test_no_rule_is_named_while_all_are_kept(data_width: int, blocks: bool, seed: int) -> None:
    port = Port(blocks=blocks, data_width=data_width)
    trace = legal_trace(port, SEED + seed, 1500)
    moved = {
        channel: sum(cycle[f"{channel}valid"] and cycle[f"{channel}ready"] for cycle in trace)
        for channel in ("aw", "w", "b", "ar", "r")
    }
    assert min(moved.values()) > 15, moved
    named = [(k, seen) for k, seen in enumerate(watched(port, trace)) if seen != ("", "")]
    assert not named, f"seed {SEED + seed}: {named[0]}"


def test_there_are_faults_for_every_rule() -> None:
    assert {fault.rule for fault in FAULTS.values()} == set(AXI_RULES)
    assert len(FAULTS) > 60


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("blocks", [True, False], ids=["blocks", "any bursts"])
def test_bench(simulator: str, blocks: bool, tmp_path: Path) -> None:
    """The emitted Verilog: silent in a trace that keeps all rules, and in one with each fault the rule is named."""
    port = Port(blocks=blocks)
    made = checker_of(port)
    ports = [name for name, _, _ in ports_of(made)]
    passed = run_cocotb(
        "axi_checker",
        {"axi_checker.v": convert(made, "axi_checker")},
        simulator,
        module="lightloom.verif.benches.test_axi_checker",
        public_ports=["clk", "rst", *ports],
        extra_env={"LIGHTLOOM_BENCH": json.dumps({"seed": SEED, "blocks": blocks})},
        seed=SEED,
        folder=tmp_path,
    )
    assert passed == 1 + sum(fault.blocks == blocks for fault in FAULTS.values())


@pytest.mark.parametrize("blocks", [True, False], ids=["blocks", "any bursts"])
def test_verilog_is_clean(blocks: bool, tmp_path: Path) -> None:
    source = tmp_path / "axi_checker.v"
    source.write_text(convert(checker_of(Port(blocks=blocks)), "axi_checker"))
    assert lint(WAIVERS, source, top="axi_checker") == ""


@pytest.mark.parametrize("wrong", [{"reads": 3}, {"writes": 0}, {"ahead": 12}])
def test_checkers_that_cannot_be_built(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be a power of two"):
        AxiChecker(Axi(address_width=40, data_width=128, id_width=2), **wrong)

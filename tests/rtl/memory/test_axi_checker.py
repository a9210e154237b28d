# amaranth: UnusedElaboratable=no
# (a checker that cannot be built is tried)
"""The checker of AXI4 ports: silent while all rules are kept, and it names the rule that a fault breaks."""

import json
import re
from functools import cache
from itertools import product
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
from lightloom.verif.vectors.axi_traces import (
    BLOCK_BYTES,
    CHANNELS,
    FIXED,
    INCR,
    PAGE,
    RESERVED,
    WRAP,
    Cycle,
    Port,
    legal_trace,
)
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
    check_silence(Port(blocks=blocks, data_width=data_width), SEED + seed)


@pytest.mark.parametrize("blocks", [True, False], ids=["blocks", "any bursts"])
def test_no_rule_is_named_with_one_of_each_at_a_time(blocks: bool) -> None:
    check_silence(Port(blocks=blocks, data_width=512, reads=1, writes=1, ahead=1), SEED)


def check_silence(port: Port, seed: int) -> None:
    """In a trace of much traffic that keeps all rules."""
    trace = legal_trace(port, seed, 1500)
    moved = {
        channel: sum(cycle[f"{channel}valid"] and cycle[f"{channel}ready"] for cycle in trace)
        for channel in ("aw", "w", "b", "ar", "r")
    }
    assert min(moved.values()) > 15, moved
    wrong = [(k, seen) for k, seen in enumerate(watched(port, trace)) if seen != ("", "")]
    assert not wrong, f"seed {seed}: {wrong[0]}"


def misfits(port: Port, address: int, beats: int, size: int, burst: int) -> set[str]:
    """The rules on what a burst may be that this one breaks, without their channel."""
    width = 1 << size
    last_byte = (address & -width) + beats * width - 1
    broken = {"boundary": burst == INCR and address // PAGE != last_byte // PAGE}
    if port.blocks:
        broken |= {
            "burst": burst != INCR,
            "size": width != port.lanes,
            "length": beats * port.lanes != BLOCK_BYTES,
            "alignment": address % BLOCK_BYTES != 0,
        }
    else:
        broken |= {
            "burst": burst == RESERVED,
            "size": width > port.lanes,
            "length": (burst == FIXED and beats > 16) or (burst == WRAP and beats not in (2, 4, 8, 16)),
            "alignment": burst == WRAP and address % width != 0,
        }
    return {name for name, is_broken in broken.items() if is_broken}


@pytest.mark.parametrize("blocks", [True, False], ids=["blocks", "any bursts"])
def test_what_a_burst_may_be(blocks: bool) -> None:
    """Every kind of burst around each limit, as soon as it is offered: on both address channels all rules it breaks."""
    port = Port(blocks=blocks)
    checker, reset, simulation = compiled(port)
    addresses = (0, 1, 8, port.lanes, BLOCK_BYTES // 2, BLOCK_BYTES, PAGE - BLOCK_BYTES, 2 * PAGE - port.lanes)
    bursts = product(addresses, (1, 2, 3, 4, 8, 16, 17, 32, 256), (0, 3, 4, 5), (FIXED, INCR, WRAP, RESERVED))

    async def testbench(ctx: Any) -> None:
        ctx.set(reset, 0)
        for address, beats, size, burst in bursts:
            for channel in ("ar", "aw"):
                offer = {"valid": 1, "addr": address, "len": beats - 1, "size": size, "burst": burst}
                for name, value in offer.items():
                    ctx.set(getattr(checker.m_axi, f"{channel}{name}"), value)
            bits = ctx.get(checker.broken)
            broken = {name for k, name in enumerate(AXI_RULES) if bits >> k & 1}
            wanted = misfits(port, address, beats, size, burst)
            assert broken == {f"{channel}_{name}" for channel in ("ar", "aw") for name in wanted}, (
                f"{address:#x}, {beats} beats of {1 << size} bytes, burst {burst}"
            )

    simulation.run(testbench)


IDLE: Cycle = {
    "rst": 0,
    **{f"{channel}{name}": 0 for channel, names in CHANNELS.items() for name in ("valid", "ready")},
    **{name: 0 for names in CHANNELS.values() for name in names},
}
RESET = [IDLE | {"rst": 1}] * 2


def takes(port: Port, *cycles: str, **changes: int) -> list[Cycle]:
    """In each cycle something is taken on the channels that it names, with an id of 0 or the one behind the name: of
    bursts of one beat over the whole bus, but for `changes`."""
    burst = {"len": 0, "size": port.lanes.bit_length() - 1, "burst": INCR, "last": 1}
    trace = []
    for words in cycles:
        cycle = dict(IDLE)
        for word in words.split():
            found = re.fullmatch(r"(\D+)(\d?)", word)
            assert found, word
            channel, identity = found.groups()
            values = {**burst, "valid": 1, "ready": 1, "id": int(identity or 0)}
            cycle |= {f"{channel}{name}": value for name, value in values.items() if f"{channel}{name}" in cycle}
        trace.append(cycle | changes)
    return trace


def named(port: Port, *traces: list[Cycle]) -> list[tuple[str, str]]:
    """The names of the rules that the master and the slave have broken up to each cycle behind a reset."""
    trace = sum(traces, RESET)
    seen = watched(port, trace)[len(RESET) :]
    return [(master.split(":")[0], slave.split(":")[0]) for master, slave in seen]


LIMITS = {
    # Rule: what may be taken so often, what makes room for one of it, and what ends them all.
    "ar_too_many": ("ar", "reads", ("r",), ("r",)),
    "aw_too_many": ("aw", "writes", ("w", "b"), ("w", "b")),
    "w_too_far": ("w", "ahead", ("aw",), ("aw", "b")),
}
LIMITED = [
    # A block is a beat.
    pytest.param(Port(blocks=True, data_width=512, reads=1), id="blocks"),
    pytest.param(Port(blocks=False, data_width=512), id="any bursts"),
    pytest.param(Port(blocks=True, data_width=512, reads=1, writes=1, ahead=1), id="a block"),
    pytest.param(Port(blocks=False, data_width=512, reads=1, writes=1, ahead=1), id="one of any bursts"),
]


@pytest.mark.parametrize("rule", LIMITS)
@pytest.mark.parametrize("port", LIMITED)
def test_as_many_as_there_may_be_and_one_more(port: Port, rule: str) -> None:
    """Silent at the limit, also the second time; the rule is named in the cycle that goes beyond it."""
    channel, limit, _, ends = LIMITS[rule]
    most = getattr(port, limit)
    if rule == "w_too_far":
        most = min(most, port.writes)  # so that all of them can have addresses
    ended = [word for word in ends for _ in range(most)]
    others = ["ar1"] if rule == "ar_too_many" else []
    whole = [channel] * getattr(port, limit)
    seen = named(port, takes(port, *[channel] * most, *ended, *whole, *others, channel))
    assert set(seen[:-1]) == {("", "")}
    assert seen[-1] == (rule, "")


@pytest.mark.parametrize("rule", LIMITS)
@pytest.mark.parametrize("port", LIMITED)
def test_room_is_there_in_the_cycle_after(port: Port, rule: str) -> None:
    """What is under way is counted before a cycle: what ends in it, or has its address in it, makes room from the next
    one on."""
    channel, limit, (*before, last), _ = LIMITS[rule]
    full = [*[channel] * getattr(port, limit), *before]
    assert set(named(port, takes(port, *full, last, channel))) == {("", "")}
    seen = named(port, takes(port, *full, f"{channel} {last}"))
    assert set(seen[:-1]) == {("", "")}
    assert seen[-1] == (rule, "")


def test_the_first_rule_is_kept() -> None:
    """Of each side, whatever is broken behind it, until a reset."""
    port = Port(blocks=False)
    first, other = takes(port, "aw b", awburst=RESERVED), takes(port, "ar r1", arsize=7)
    seen = named(port, first, other, [IDLE], RESET, [IDLE], other, first)
    were, are = ("aw_burst", "b_unasked"), ("ar_size", "r_unasked")
    assert seen == [were, were, were, ("", ""), ("", ""), ("", ""), are, are]


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

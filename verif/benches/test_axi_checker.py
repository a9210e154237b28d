"""Bench of the checker of AXI4 ports, as emitted: traces that keep all rules, and one with each seeded fault."""

import json
import os
from typing import Any

import cocotb
from cocotb.triggers import Timer

from lightloom.golden_model.contract.axi_rules import AXI_RULES, is_masters, rule_of
from lightloom.verif.vectors.axi_faults import FAULTS
from lightloom.verif.vectors.axi_traces import Cycle, legal_trace

RUN = json.loads(os.environ.get("LIGHTLOOM_BENCH", '{"seed": 0, "blocks": true}'))
"""`blocks`: the kind of bursts that the checker was made for."""
MINE = [fault for fault in FAULTS.values() if fault.blocks == RUN["blocks"]]


async def play(dut: Any, trace: list[Cycle]) -> list[tuple[str, str]]:
    """Shows a trace; which rules of the master and of the slave are named behind each of its cycles."""
    seen = []
    signals = {name: getattr(dut, name if name == "rst" else f"m_axi_{name}") for name in trace[0]}
    before: Cycle = {}
    for cycle in trace:
        for name, value in cycle.items():
            if before.get(name) != value:
                signals[name].value = value
        before = cycle
        dut.clk.value = 0
        await Timer(5, unit="ns")
        dut.clk.value = 1
        await Timer(5, unit="ns")
        seen.append((rule_of(int(dut.master_rule.value)), rule_of(int(dut.slave_rule.value))))
    return seen


@cocotb.test()
async def silent_while_all_rules_are_kept(dut: Any) -> None:
    """From the first cycle of reset on, in which nothing is known yet."""
    trace = legal_trace(MINE[0].port(), RUN["seed"], 1500)
    assert set(await play(dut, trace)) == {("", "")}


@cocotb.test()
@cocotb.parametrize(fault=[fault.name for fault in MINE])
async def a_fault_is_named(dut: Any, fault: str) -> None:
    """By the rule that it breaks, and not before; a reset forgets it."""
    seeded = FAULTS[fault]
    trace, where = seeded.trace(RUN["seed"])
    seen = await play(dut, trace)
    side = 0 if is_masters(seeded.rule) else 1
    named = [rules[side] for rules in seen if rules[side]]
    assert set(seen[:where]) <= {("", "")}, f"seed {RUN['seed']}: before cycle {where}"
    assert named, f"seed {RUN['seed']}: nothing is named; the fault is in cycle {where}"
    assert named[0] == rule_of(list(AXI_RULES).index(seeded.rule) + 1), f"seed {RUN['seed']}"

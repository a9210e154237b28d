"""A unit in Amaranth's simulator with a checker beside its memory port."""

from typing import Any

from amaranth import Module

from lightloom.rtl.memory.axi_checker import AxiChecker


def watched(unit: Any, **limits: Any) -> tuple[Module, AxiChecker]:
    """The unit and the checker of its `m_axi`, of which `limits` are parameters."""
    dut = Module()
    checker = AxiChecker(unit.m_axi.signature, **limits)
    dut.submodules.unit = unit
    dut.submodules.checker = checker
    for port in checker.axi.ports:
        for name in port.members:
            dut.d.comb += getattr(checker.m_axi, name).eq(getattr(unit.m_axi, name))
    return dut, checker

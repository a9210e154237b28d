"""The AXI4 memory of benches at a port in a simulator: cocotb's, or Amaranth's own."""

import random
from collections.abc import Callable
from functools import cache
from typing import Any

import cocotb
from cocotb.triggers import FallingEdge, RisingEdge

from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.verif.drivers.axi_slave import READ, WRITE, AxiSlave, Manner, Regions


def lanes_and_outputs(there: Callable[[str], bool], bits: Callable[[str], int]) -> tuple[int, tuple[str, ...]]:
    """Bytes of the bus, and what a slave drives, at a port that reads, writes, or both: of each of AXI's signals, by
    its name, whether it is `there`, and its `bits`."""
    reads, writes = there("arvalid"), there("awvalid")
    return bits("rdata" if reads else "wdata") // 8, (READ if reads else ()) + (WRITE if writes else ())


class CocotbSlave(AxiSlave):
    """The memory at the port `prefix` of `dut`, from the first edge of its `clk` on.

    `regions` are the bytes that begin at an address, and what may be asked for. Where `dut` has the ports of a checker,
    the test fails in the cycle after the one in which a rule is broken.
    """

    def __init__(self, dut: Any, prefix: str, *, rng: random.Random) -> None:
        self.regions = Regions()
        self._dut = dut
        self._signal = cache(lambda name: getattr(dut, f"{prefix}_{name}"))
        lanes, self._outputs = lanes_and_outputs(
            lambda name: hasattr(dut, f"{prefix}_{name}"), lambda name: len(self._signal(name))
        )
        super().__init__(lanes, rng=rng, content=self.regions, strict=True)
        self._rules = [getattr(dut, name) for name in RULE_PORTS if hasattr(dut, name)]
        cocotb.start_soon(self._run())

    def _get(self, name: str) -> int:
        return int(self._signal(name).value)

    async def _run(self) -> None:
        dut, quiet = self._dut, dict.fromkeys(self._outputs, 0)
        rising, falling = RisingEdge(dut.clk), FallingEdge(dut.clk)
        shown, in_reset = quiet, True
        driven: dict[str, int] = {}
        while True:
            for name, value in shown.items():
                if driven.get(name) != value:
                    self._signal(name).value = driven[name] = value
            await falling
            in_reset = bool(int(dut.rst.value))
            if in_reset:
                self.forget()
            else:
                self.sees(shown, self._get)
                if self._rules:
                    self.check(int(rule.value) for rule in self._rules)
            await rising
            shown = quiet if in_reset else quiet | self.offers(self._outputs)


class AmaranthSlave(AxiSlave):
    """The memory at a port of a unit in Amaranth's simulator, of which any content may be read and written.

    Call `drive` after each clock edge, and `sample` when everything has settled. `checker`, where there is one, watches
    the port.
    """

    def __init__(
        self,
        axi: Any,
        *,
        checker: Any = None,
        latency: int | tuple[int, int] = 1,
        stall: float = 0.0,
        reorder: bool = False,
        seed: int = 0,
        **options: Any,
    ) -> None:
        # A port of both directions has one of each.
        parts = (axi,) if hasattr(axi, "arvalid") or hasattr(axi, "awvalid") else (axi.read, axi.write)
        self._signals = {name: getattr(part, name) for part in parts for name in part.signature.members}
        lanes, self._outputs = lanes_and_outputs(self._signals.__contains__, lambda name: len(self._signals[name]))
        super().__init__(lanes, rng=random.Random(seed), **options)
        cycles = (latency, latency) if isinstance(latency, int) else latency
        self.manner = Manner(latency=cycles, stall=stall, reorder=reorder, interleave=reorder)
        self._checker = checker

    def drive(self, ctx: Any) -> None:
        self._shown = self.offers(self._outputs)
        for name, value in self._shown.items():
            ctx.set(self._signals[name], value)

    def sample(self, ctx: Any) -> None:
        self.sees(self._shown, lambda name: ctx.get(self._signals[name]))
        if self._checker is not None:
            self.check(ctx.get(rule) for rule in (self._checker.master_rule, self._checker.slave_rule))

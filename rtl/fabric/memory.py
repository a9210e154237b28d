"""Memories: the only place where the RTL has one.

`gen.verilog` makes a module of every kind, depth and width of a memory, the wrapper, and an instance of it wherever the
RTL has one: a flow may put a module of the same name and ports into its place, with a macro, its test or its code
inside. Nothing depends on what a memory holds before it was written.
"""

import re
from dataclasses import dataclass
from typing import Any

from amaranth import Module, Mux, Shape, Signal, Value
from amaranth.asserts import AnySeq
from amaranth.lib import wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.pipeline import register

KINDS = {
    "ram": "a word is read at a rising edge of clk where r_en is high, and stays at r_data until the next one",
    "regfile": "the words at the addresses are at r0_data and so on at all times",
}
"""Kinds of memories, by what a read is. All have one port to write a word at a rising edge at which w_en is high."""

READ_DURING_WRITE = {
    "any": "a word that is read at the edge at which it is written is not used: r_data may be anything",
    "old": "a word that is read at the edge at which it is written is the old one",
}
"""What whoever reads relies on."""


@dataclass(frozen=True)
class Wrapper:
    """What a memory is to whoever puts another in its place."""

    kind: str
    """One of KINDS."""
    reads: int
    """Ports to read."""
    depth: int
    """Words."""
    width: int
    """Bits of a word."""
    read_during_write: str
    """One of READ_DURING_WRITE."""

    @property
    def name(self) -> str:
        """What its module's name ends with."""
        old = "_read_first" if (self.kind, self.read_during_write) == ("ram", "old") else ""
        return f"{self.kind}_{self.reads}r1w_{self.depth}x{self.width}{old}"

    @classmethod
    def of(cls, module: str) -> "Wrapper | None":
        """The wrapper whose module has this name; None for a module that is none."""
        found = re.search(rf"_({'|'.join(KINDS)})_(\d+)r1w_(\d+)x(\d+)(_read_first)?$", module)
        if not found:
            return None
        kind, reads, depth, width, old = found.groups()
        return cls(kind, int(reads), int(depth), int(width), "old" if old or kind == "regfile" else "any")


class Wrapped(wiring.Component):
    """A memory that becomes an instance of a wrapper."""

    wrapper: Wrapper

    def __init__(self, shape: Any, wrapper: Wrapper, reads: dict[str, wiring.Member]):
        if wrapper.depth < 2:
            raise ValueError(f"a memory has 2 words at least, not {wrapper.depth}")
        self.wrapper = wrapper
        writes = {"w_en": In(1), "w_addr": In(range(wrapper.depth)), "w_data": In(shape)}
        super().__init__(writes | reads)

    def _words(self, m: Module) -> Memory:
        """The memory itself, and its port to write."""
        # By this attribute Yosys and others spare the logic that makes a block RAM give the old word.
        attributes = {"no_rw_check": 1} if self.wrapper.read_during_write == "any" else {}
        words = Memory(shape=self.wrapper.width, depth=self.wrapper.depth, init=[], attrs=attributes)
        m.submodules.words = words
        write = words.write_port()
        m.d.comb += [
            write.en.eq(self.w_en),
            write.addr.eq(self.w_addr),
            write.data.eq(Value.cast(self.w_data)),
        ]
        return words


class Ram(Wrapped):
    """A RAM with a port to write and one to read, which may be used in one cycle.

    Ports: a word `w_data` is written to `w_addr` in a cycle with `w_en`. The word at `r_addr` is at `r_data` one cycle
    after an `r_en` (high where nothing drives it), until the next one. If that word is written in the cycle in which it
    is read, `r_data` is the old one of a RAM that is `read_first`, and anything of another: proofs put just that there.
    """

    def __init__(self, shape: Any, depth: int, *, read_first: bool = False):
        during = "old" if read_first else "any"
        wrapper = Wrapper("ram", 1, depth, Shape.cast(shape).width, during)
        super().__init__(shape, wrapper, {"r_en": In(1, init=1), "r_addr": In(range(depth)), "r_data": Out(shape)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        words = self._words(m)
        if platform == "formal" and self.wrapper.read_during_write == "any":
            # The same, but for a word that is read while it is written: that is what the solver likes.
            read = words.read_port(domain="comb")
            held = Signal(self.wrapper.width, reset_less=True)
            clashes = Signal()
            m.d.comb += [clashes.eq(self.w_en & (self.w_addr == self.r_addr)), Value.cast(self.r_data).eq(held)]
            with m.If(self.r_en):
                m.d.sync += held.eq(Mux(clashes, AnySeq(len(held)), read.data))
        else:
            read = words.read_port()
            m.d.comb += [read.en.eq(self.r_en), Value.cast(self.r_data).eq(read.data)]
        m.d.comb += read.addr.eq(self.r_addr)
        return m


def write_first(m: Module, ram: Ram, name: str) -> Any:
    """The word that a RAM has read: the new one, if it was written in the cycle in which it was read."""
    written = register(m, ram.r_en, ram.w_en & (ram.w_addr == ram.r_addr), f"{name}_written")
    new = register(m, ram.r_en, ram.w_data, f"{name}_new")
    word = Signal(ram.r_data.shape(), name=name)
    m.d.comb += Value.cast(word).eq(Mux(written, new, Value.cast(ram.r_data)))
    return word


class RegisterFile(Wrapped):
    """Words that can be read at all times: for few bits, which a flow makes of flip-flops, latches or LUTs.

    Ports: a word `w_data` is written to `w_addr` in a cycle with `w_en`, and there from the next one on. The word at
    `r0_addr` is at `r0_data`, and so on: `reads` of them.
    """

    def __init__(self, shape: Any, depth: int, *, reads: int = 1):
        wrapper = Wrapper("regfile", reads, depth, Shape.cast(shape).width, "old")
        ports = [{f"r{k}_addr": In(range(depth)), f"r{k}_data": Out(shape)} for k in range(reads)]
        super().__init__(shape, wrapper, {name: member for port in ports for name, member in port.items()})

    def read(self, k: int) -> tuple[Signal, Any]:
        """Address and word of a port to read."""
        return getattr(self, f"r{k}_addr"), getattr(self, f"r{k}_data")

    def elaborate(self, platform: object) -> Module:
        m = Module()
        words = self._words(m)
        for k in range(self.wrapper.reads):
            read = words.read_port(domain="comb")
            address, word = self.read(k)
            m.d.comb += [read.addr.eq(address), Value.cast(word).eq(read.data)]
        return m

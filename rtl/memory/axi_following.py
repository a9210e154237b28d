"""What is under way at an AXI4 port, for whoever watches it (`rtl.memory.axi_checker`)."""

from typing import Any

from amaranth import Array, Cat, Const, Module, Mux, Signal, Value, signed
from amaranth.lib import data

from lightloom.rtl.fabric.memory import RegisterFile
from lightloom.rtl.memory.axi import AxiPort

Rules = dict[str, Value]
"""Names of rules, and whether each is broken."""
FIXED, INCR, WRAP = 0b00, 0b01, 0b10


class EachId:
    """A value for each id; zero after a reset, whatever the memory holds then."""

    def __init__(self, m: Module, name: str, id_width: int, shape: Any, *, reads: int):
        """`reads`: how often `of` is asked."""
        self._m, self._shape = m, shape
        m.submodules[name] = self._memory = RegisterFile(shape, 1 << id_width, reads=reads)
        self._ports = (self._memory.read(k) for k in range(reads))
        self._known = Signal(1 << id_width, name=f"{name}_known")

    def of(self, number: Value) -> Any:
        """The value of an id, before this cycle's `put`."""
        address, held = next(self._ports)
        value = Signal(self._shape)
        self._m.d.comb += address.eq(number)
        with self._m.If(self._known.bit_select(number, 1)):
            self._m.d.comb += Value.cast(value).eq(Value.cast(held))
        return value

    def put(self, en: Value, number: Value, value: Any) -> None:
        """Another value for an id, from the next cycle on."""
        memory = self._memory
        self._m.d.comb += [
            memory.w_en.eq(en),
            memory.w_addr.eq(number),
            Value.cast(memory.w_data).eq(Value.cast(value)),
        ]
        with self._m.If(en):
            self._m.d.sync += self._known.eq(self._known | (Const(1, len(self._known)) << number)[: len(self._known)])


class Fifo:
    """First in, first out, what was put last cycle or earlier; `count` are inside. Depth a power of two."""

    def __init__(self, m: Module, name: str, depth: int, shape: Any):
        depth = max(depth, 2)  # a memory has no fewer words
        m.submodules[name] = memory = RegisterFile(shape, depth)
        self._m, self._memory, self.depth = m, memory, depth
        self._into = Signal(range(2 * depth), name=f"{name}_into")
        self._out = Signal(range(2 * depth), name=f"{name}_out")
        self.count = Signal(range(2 * depth), name=f"{name}_count")
        address, self.head = memory.read(0)
        m.d.comb += [
            self.count.eq(self._into - self._out),
            memory.w_addr.eq(self._into[: len(memory.w_addr)]),
            address.eq(self._out[: len(address)]),
        ]

    def put(self, en: Value, value: Any) -> None:
        self._m.d.comb += [self._memory.w_en.eq(en), Value.cast(self._memory.w_data).eq(Value.cast(value))]
        self._m.d.sync += self._into.eq(self._into + en)

    def drop(self, en: Value) -> None:
        self._m.d.sync += self._out.eq(self._out + en)


def follow_reads(m: Module, port: Any, axi: AxiPort, *, bursts: int) -> Rules:
    """Beats of reads against what was asked for; `bursts` of an id, a power of two, may be under way.

    One whose last beat is taken in a cycle is still under way in that cycle.
    """
    slots = bursts.bit_length() - 1
    done_shape = data.StructLayout({"bursts": slots + 1, "beat": 8})
    asked = EachId(m, "asked_reads", axi.id_width, slots + 1, reads=2)
    done = EachId(m, "done_reads", axi.id_width, done_shape, reads=2)
    m.submodules.lengths = lengths = RegisterFile(8, bursts << axi.id_width)
    awaited_burst, length = lengths.read(0)
    asks = Signal()
    before = asked.of(port.arid)
    m.d.comb += [
        asks.eq(port.arvalid & port.arready),
        lengths.w_en.eq(asks),
        lengths.w_addr.eq(Cat(before[:slots], port.arid)),
        lengths.w_data.eq(port.arlen),
    ]
    asked.put(asks, port.arid, before + 1)

    now = done.of(port.rid)
    awaited = Signal()
    at_end = Signal()
    after = Signal(done_shape)
    m.d.comb += [
        awaited.eq(now.bursts != asked.of(port.rid)),
        awaited_burst.eq(Cat(now.bursts[:slots], port.rid)),
        at_end.eq(now.beat == length),
        after.bursts.eq(now.bursts + at_end),
        after.beat.eq(Mux(at_end, 0, now.beat + 1)),
    ]
    done.put(port.rvalid & port.rready & awaited, port.rid, after)
    comes = port.rvalid & awaited
    return {
        "ar_too_many": asks & ((before - done.of(port.arid).bursts)[: slots + 1] == bursts),
        "r_unasked": port.rvalid & ~awaited,
        "r_last_early": comes & port.rlast & ~at_end,
        "r_last_missing": comes & ~port.rlast & at_end,
    }


def follow_writes(m: Module, port: Any, axi: AxiPort, *, bursts: int) -> tuple[Rules, Value]:
    """Answers to writes against what was taken; and of how many bursts the data was ahead of the addresses.

    `bursts`, a power of two, may be under way in all. One whose answer is taken in a cycle is still under way in that
    cycle.
    """
    bits = bursts.bit_length()
    asked, whole, answered = (
        EachId(m, f"{name}_writes", axi.id_width, bits, reads=2 if name != "answered" else 1)
        for name in ("asked", "whole", "answered")
    )
    begins = Signal()
    ends = Signal()
    last = Signal()
    under_way = Signal(range(2 * bursts))
    balance = Signal(
        signed(bits + 9)
    )  # bursts whose address has come and whose data is not whole; less than 0: reverse
    completes = Signal()
    which = Signal(axi.id_width)
    ids = Fifo(m, "ids", bursts, axi.id_width)
    m.d.comb += [
        begins.eq(port.awvalid & port.awready),
        last.eq(port.wvalid & port.wready & port.wlast),
        completes.eq(Mux(balance > 0, last, Mux(balance < 0, begins, begins & last))),
        which.eq(Mux(balance > 0, ids.head, port.awid)),
    ]
    ids.put(begins, port.awid)
    ids.drop(completes)
    asked.put(begins, port.awid, asked.of(port.awid) + 1)
    whole.put(completes, which, whole.of(which) + 1)
    before = answered.of(port.bid)
    unasked = before == asked.of(port.bid)
    m.d.comb += ends.eq(port.bvalid & port.bready & ~unasked)
    answered.put(ends, port.bid, before + 1)
    m.d.sync += [balance.eq(balance + begins - last), under_way.eq(under_way + begins - ends)]
    rules = {
        "aw_too_many": begins & (under_way == bursts),
        "b_unasked": port.bvalid & unasked,
        "b_early": port.bvalid & ~unasked & (before == whole.of(port.bid)),
    }
    return rules, -balance


def block_beats(m: Module, port: Any, axi: AxiPort, *, leads: Value, ahead: int) -> Rules:
    """Beats of bursts that are blocks: their number, and that none is taken while `ahead` bursts lead: `leads` is as it
    was before the cycle."""
    beat = Signal(range(axi.block_beats))
    at_end = beat == axi.block_beats - 1
    takes = port.wvalid & port.wready
    with m.If(takes):
        m.d.sync += beat.eq(Mux(at_end | port.wlast, 0, beat + 1))
    return {
        "w_last_early": port.wvalid & port.wlast & ~at_end,
        "w_last_missing": port.wvalid & ~port.wlast & at_end,
        "w_too_far": takes & (leads >= ahead),
    }


def any_beats(m: Module, port: Any, axi: AxiPort, *, bursts: int, ahead: int) -> Rules:
    """Beats of any bursts against their addresses, where these have come: number and strobes, a cycle late or later.

    `bursts` and `ahead`, of beats whose address did not come before this cycle, are powers of two.
    """
    lanes = axi.data_width // 8
    lane_bits = axi.beat_size
    address_shape = data.StructLayout({"lane": lane_bits, "len": 8, "size": 3, "burst": 2})
    # An address stays until its beats were looked at, when its burst may have been answered.
    addresses = Fifo(m, "addresses", 1 << (bursts + ahead - 1).bit_length(), address_shape)
    beats = Fifo(m, "beats", ahead, data.StructLayout({"strb": lanes, "last": 1}))
    takes = Signal()
    looks = Signal()
    at_end = Signal()
    number = Signal(8)
    m.d.comb += [
        takes.eq(port.wvalid & port.wready),
        looks.eq((addresses.count != 0) & (beats.count != 0)),
        at_end.eq(number == addresses.head.len),
    ]
    addresses.put(port.awvalid & port.awready, Cat(port.awaddr[:lane_bits], port.awlen, port.awsize, port.awburst))
    beats.put(takes, Cat(port.wstrb, port.wlast))
    beats.drop(looks)
    ends = looks & (beats.head.last | at_end)
    addresses.drop(ends)

    burst = addresses.head
    kept = Signal(lane_bits)
    lane = Signal(lane_bits)
    width = Signal(lane_bits + 1)
    within = Signal(lane_bits)  # of a beat
    across = Signal(lane_bits)  # of a burst that wraps
    follows = Signal(lane_bits)
    may = Signal(lanes)
    sizes = range(lane_bits + 1)
    m.d.comb += [
        lane.eq(Mux(number == 0, burst.lane, kept)),
        width.eq(Array(1 << size for size in sizes)[burst.size]),
        within.eq(width - 1),
        across.eq(((burst.len + 1) << burst.size) - 1),
        may.eq(
            (Array(Const((1 << (1 << size)) - 1, lanes) for size in sizes)[burst.size] << (lane & ~within))
            & (Const(-1, lanes) << lane)
        ),
    ]
    with m.Switch(burst.burst):
        with m.Case(FIXED):
            m.d.comb += follows.eq(lane)
        with m.Case(WRAP):
            m.d.comb += follows.eq((lane & ~across) | ((lane + width) & across))
        with m.Default():
            m.d.comb += follows.eq((lane & ~within) + width)
    with m.If(looks):
        m.d.sync += [number.eq(Mux(ends, 0, number + 1)), kept.eq(follows)]
    return {
        "w_last_early": looks & beats.head.last & ~at_end,
        "w_last_missing": looks & ~beats.head.last & at_end,
        "w_strobe": looks & (beats.head.strb & ~may).any(),
        "w_too_far": takes & (beats.count == ahead) & ~looks,
    }

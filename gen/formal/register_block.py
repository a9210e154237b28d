"""The register block behind AXI4-Lite: every access is answered once, and does to the fields what it should."""

from dataclasses import dataclass, field

from amaranth import Cat, Const, Mux, Signal, Value

from lightloom.gen.formal.bench import Bench
from lightloom.gen.formal.properties import Induction, Property
from lightloom.gen.formal.streams import held
from lightloom.rtl.registers.register_block import RegisterBlock
from lightloom.rtl.registers.table import Access, Field, table_of

FIELDS = (
    Field(name="go", register="control", access=Access.W1P, meaning="Writing 1 begins."),
    Field(name="busy", register="status", access=Access.RO, meaning="Is 1 while it works."),
    Field(name="over", register="events", access=Access.W1C, meaning="Becomes 1 at the end; writing 1 makes it 0."),
    Field(name="lost", register="events", access=Access.W1C, meaning="Becomes 1 at a loss; writing 1 makes it 0."),
    Field(name="speed", register="speed", width=11, access=Access.RW, reset=0x2A5, meaning="Sets the speed."),
    Field(name="place", register="place", width=9, access=Access.RW, held_by="busy", meaning="Sets the place."),
    Field(name="send", register="send", access=Access.W1P, held_by="busy", meaning="Writing 1 sends it there."),
    Field(name="count", register="count", width=36, access=Access.RO, meaning="Counts cycles."),
    Field(name="total", register="total", width=34, access=Access.RO, meaning="Counts all."),
)
"""A field of every kind, two of what is read in halves."""
WORD = 4
"""Bytes."""


@dataclass
class _Waiting:
    """What has come on a channel that leads to the slave and is not done, by the handshakes alone."""

    bench: Bench
    name: str
    payload: Value
    come: Signal = field(init=False)
    """Something waits: at most one."""
    kept: Signal = field(init=False)
    """It."""

    def __post_init__(self) -> None:
        self.come = Signal(name=f"{self.name}_come")
        self.kept = Signal(len(self.payload), name=f"{self.name}_kept", reset_less=True)

    def follow(self, taken: Value, done: Value) -> None:
        m = self.bench.m
        with m.If(taken):
            m.d.sync += [self.come.eq(1), self.kept.eq(self.payload)]
        with m.Elif(done):
            m.d.sync += self.come.eq(0)


def protocol() -> Bench:
    """The rules of AXI4-Lite, by the handshakes alone: how many of each there were."""
    dut = RegisterBlock(table_of(FIELDS))
    bench = Bench(dut)
    port = dut.s_axi
    held(bench, "b", port.bvalid, port.bready, port.bresp)
    held(bench, "r", port.rvalid, port.rready, Cat(port.rdata, port.rresp))
    for answer, asked in (("b", ("aw", "w")), ("r", ("ar",))):
        valid, ready = getattr(port, f"{answer}valid"), getattr(port, f"{answer}ready")
        for channel in asked:
            owed = Signal(range(4), name=f"{channel}_owed")  # taken, and not answered
            taken = getattr(port, f"{channel}valid") & getattr(port, f"{channel}ready")
            bench.m.d.sync += owed.eq(owed + taken - (valid & ready))
            bench.require(f"{answer}_answers_{channel}", ~valid | (owed != 0))
            # One that is answered, and one that waits: what is ready says that there is room.
            waits = bench.inner({"aw": "write_addressed", "w": "write_given", "ar": "read_addressed"}[channel])
            bench.require(f"{channel}_none_lost_or_doubled", owed == valid + waits)
            bench.require(f"{channel}_is_taken_where_none_waits", getattr(port, f"{channel}ready") == ~waits)
            bench.reach(f"two_{channel}_owed", owed == 2)
        # All of an access has come and its answer is not offered: it is in the next cycle.
        whole = Cat(bench.inner(f"{'read' if answer == 'r' else 'write'}_{name}") for name in _parts(answer)).all()
        due = bench.past(whole & ~valid, f"{answer}_due")
        bench.require(f"{answer}_comes_at_once", ~due | valid)
        bench.reach(f"{answer}_waits_with_another", valid & whole & ~ready)
    ahead, behind = bench.inner("write_given"), bench.inner("write_addressed")
    bench.reach("data_before_their_address", ahead & ~behind & ~port.awvalid)
    bench.reach("address_before_its_data", behind & ~ahead & ~port.wvalid)
    return bench


def _parts(answer: str) -> tuple[str, ...]:
    return ("addressed",) if answer == "r" else ("addressed", "given")


def contents() -> Bench:
    """What accesses do, against a model of the registers a bit at a time."""
    dut = RegisterBlock(table_of(FIELDS))
    bench = Bench(dut)
    m, port = bench.m, dut.s_axi
    aw, w, ar = (
        _Waiting(bench, "aw", port.awaddr),
        _Waiting(bench, "w", Cat(port.wdata, port.wstrb)),
        _Waiting(bench, "ar", port.araddr),
    )
    writes, reads = Signal(name="writes"), Signal(name="reads")
    m.d.comb += [writes.eq(aw.come & w.come & ~port.bvalid), reads.eq(ar.come & ~port.rvalid)]
    for one, channel, done in ((aw, "aw", writes), (w, "w", writes), (ar, "ar", reads)):
        one.follow(getattr(port, f"{channel}valid") & getattr(port, f"{channel}ready"), done)
    # Where they wait inside.
    for name, one, inside in (
        ("addressed", aw, bench.inner("write_address")),
        ("given", w, Cat(bench.inner("write_data"), bench.inner("write_strobes"))),
    ):
        kept = one.kept[2:] if one is aw else one.kept
        bench.require(f"write_{name}_is_told", bench.inner(f"write_{name}") == one.come)
        bench.require(f"write_{name}_waits", ~one.come | (inside == kept))
    inside = bench.inner("read_address")
    bench.require("read_waits", (bench.inner("read_addressed") == ar.come) & (~ar.come | (inside == ar.kept[2:])))
    _written(bench, dut, writes, aw.kept, w.kept)
    _read(bench, dut, reads, ar.kept)
    return bench


def _written(bench: Bench, dut: RegisterBlock, writes: Value, address: Value, word: Value) -> None:
    """What a write leaves in each bit, and its answer."""
    m, port = bench.m, dut.s_axi
    data, strobes = word[:32], word[32:]
    refused = Signal(init=1, name="is_refused")
    for register in (one for one in dut.table.registers if one.writable):
        mine = Signal(name=f"writes_{register.name}")
        free = ~getattr(dut, register.held_by) if register.held_by else Const(1)
        m.d.comb += mine.eq((address[2:] == register.offset // WORD) & free)
        with m.If(mine):
            m.d.comb += refused.eq(0)
        for low, one in register.fields:
            here = [writes & mine & strobes[bit // 8] for bit in range(low, low + one.width)]
            ones = data[low : low + one.width]
            model = Signal(one.width, init=one.reset, name=f"model_{one.name}")
            for k, (bit, written) in enumerate(zip(model, here, strict=True)):
                if one.access is Access.RW:
                    m.d.sync += bit.eq(Mux(written, ones[k], bit))
                elif one.access is Access.W1P:
                    m.d.sync += bit.eq(written & ones[k])
                else:
                    m.d.sync += bit.eq(Mux(getattr(dut, f"{one.name}_set"), 1, Mux(written & ones[k], 0, bit)))
            bench.require(f"{one.name}_is_what_was_written", getattr(dut, one.name) == model)
            bench.reach(f"{one.name}_changes", model != one.reset)
        if register.held_by:
            here_but_held = (address[2:] == register.offset // WORD) & ~free
            bench.reach(f"{register.name}_is_held", writes & here_but_held & (strobes != 0))
    wanted = Signal(2, name="b_wanted", reset_less=True)
    with m.If(writes):
        m.d.sync += wanted.eq(Mux(refused, 0b10, 0b00))
    bench.require("write_is_answered_rightly", ~port.bvalid | (port.bresp == wanted))
    bench.reach("write_of_nothing", port.bvalid & (wanted != 0))
    bench.reach("set_while_cleared", writes & dut.over & dut.over_set & data[0] & strobes[0] & (address[2:] == 2))


def _read(bench: Bench, dut: RegisterBlock, reads: Value, address: Value) -> None:
    """What is read: the fields of that cycle, of an upper half those of the lower half's cycle."""
    m, port = bench.m, dut.s_axi
    word, found = Signal(32, name="word"), Signal(name="is_found")
    # What the registers of 64 bits were when a lower half was read last.
    whole, of = Signal(64, name="whole", reset_less=True), Signal(len(address) - 2, name="whole_of", reset_less=True)
    known = Signal(name="whole_is_known")
    for register in dut.table.registers:
        at = Signal(name=f"reads_{register.name}")
        m.d.comb += at.eq(address[2:] == register.offset // WORD)
        value = Signal(64, name=f"value_{register.name}")
        for low, one in register.fields:
            if one.access is not Access.W1P:
                m.d.comb += value[low : low + one.width].eq(getattr(dut, one.name))
        with m.If(at):
            m.d.comb += [found.eq(1), word.eq(value[:32])]
        if register.width > 32:
            with m.If(reads & at):
                m.d.sync += [whole.eq(value), of.eq(register.offset // WORD), known.eq(1)]
            with m.If(address[2:] == register.offset // WORD + 1):
                m.d.comb += [found.eq(1), word.eq(whole[32:])]
    bench.require("kept_half", ~known | (bench.inner("upper_half") == whole[32:]))
    wanted, answer = Signal(32, name="r_wanted", reset_less=True), Signal(2, name="r_answer", reset_less=True)
    upper = Signal(name="is_upper_half")  # without a lower half before, it is anything
    told = Signal(name="r_is_told", reset_less=True)
    halves = [register.offset // WORD + 1 for register in dut.table.registers if register.width > 32]
    m.d.comb += upper.eq(Cat(address[2:] == half for half in halves).any())
    with m.If(reads):
        m.d.sync += [wanted.eq(word), answer.eq(Mux(found, 0b00, 0b10)), told.eq(known | ~upper)]
    bench.require("read_is_answered_rightly", ~port.rvalid | (port.rresp == answer))
    bench.require("what_is_read", ~port.rvalid | ~told | (port.rdata == wanted))
    counted = bench.past(dut.count, "count")
    bench.reach("whole_while_it_counts", reads & known & upper & (of == halves[0] - 1) & (counted[32:] != whole[32:36]))
    bench.reach("read_of_nothing", port.rvalid & (answer != 0))
    bench.reach("read_of_what_was_written", port.rvalid & (wanted == 0x123))


def properties() -> list[Property]:
    return [
        Property(
            unit="register_block",
            name="protocol",
            says="every access is answered once, and at once when all of it has come; answers hold",
            method=Induction(depth=1),
            build=protocol,
            reach=6,
            quick=True,
        ),
        Property(
            unit="register_block",
            name="contents",
            says="what is written, by its strobes, is what is read; events, holds, refusals; counters whole",
            method=Induction(depth=1),
            build=contents,
            reach=8,
            quick=True,
        ),
    ]

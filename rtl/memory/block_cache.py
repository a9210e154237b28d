"""A cache for blocks of 64 bytes that goes on while it waits for the memory; docs/block_cache.md describes it.

Requests come in order and are answered in any order, each with its tag. A request whose block is there reads it; one
whose block is awaited joins those that wait for the same block, which are answered one a cycle when it has come; any
other is given a line of its set and starts a read.

    i -> lines --- hit -------------------------------> blocks (RAM) -> o
           |                                               ^
           +--- awaited, miss --> waiters --- drain -------+
           +--- miss --> m_axi.ar     ^                    |
                         m_axi.r --> fill -----------------+
"""

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import Buffer, FreeList, PassingQueue, number_width
from lightloom.rtl.memory.axi import BLOCK_BITS, INCR, OFFSET_BITS, AxiRead
from lightloom.rtl.memory.block_fill import BlockFill
from lightloom.rtl.memory.block_lines import BLOCK_NUMBER_BITS, BlockLines
from lightloom.rtl.memory.waiters import Waiters

PATIENCE = 7
"""Hits that may go before a request that has waited for its block."""
CALM, CROWD = 2, 8
"""Reads that wait for the memory port: prefetches start while there are fewer than CALM, and from CROWD on the memory
does not keep up."""


class BlockCache(wiring.Component):
    """Set-associative, non-blocking; one request and one response a cycle, a hit answered 3 cycles after its request.

    Ports: `i` {block: number of a block, tag}, `o` {data: the block, tag, error: the read failed, and the data means
    nothing}; `m_axi`, an AXI4 read master; `base`, the byte address of block 0, a multiple of 64; `invalidate`, which
    forgets all blocks (nothing may be in flight then, and `prefetching` is low); `tick`, a strobe: a read that is under
    way at two of them fails (`rtl.memory.block_fill` says what else makes one fail). Events, each a cycle long and one
    cycle after it happened: `hit`, `miss` (it started a read), `merged` (joined those that wait for the same block),
    `prefetched` (a prefetch did so), `evicted` (a block gave way to another), and `stalled`: a request waits for a free
    line, miss or list entry.

    `prefetch`, a strobe, names a `block` that is likely to be asked for soon. It is read if it is not there and nothing
    has to wait for that; otherwise nothing happens. `prefetching`: a request is inside, or a block is on its way that
    nobody has asked for. `crowded`: many reads wait for the port.
    """

    def __init__(
        self,
        *,
        sets: int,
        ways: int,
        misses: int,
        requests: int,
        tag_width: int,
        address_width: int = 40,
        data_width: int = 512,
        id_width: int | None = None,
    ):
        """`sets` (a power of two, 2 or more) times `ways` lines; `misses` blocks may be awaited at a time, and
        `requests` requests may wait for them. The id of a read is the number of its miss; `id_width` is wider where it
        has to match another master's. Raises ValueError for what cannot be built."""
        if sets < 2 or sets & (sets - 1):
            raise ValueError(f"sets must be a power of two from 2 up, not {sets}")
        for name, value in {"ways": ways, "misses": misses, "requests": requests, "tag_width": tag_width}.items():
            if value < 1:
                raise ValueError(f"{name} must be at least 1, not {value}")
        id_width = number_width(misses) if id_width is None else id_width
        if id_width < number_width(misses):
            raise ValueError(f"{misses} misses need ids of {number_width(misses)} bits, not {id_width}")
        self.sets, self.ways, self.misses, self.requests, self.tag_width = sets, ways, misses, requests, tag_width
        axi = AxiRead(address_width=address_width, data_width=data_width, id_width=id_width)
        super().__init__(
            {
                "i": In(stream.Signature(data.StructLayout({"block": BLOCK_NUMBER_BITS, "tag": tag_width}))),
                "o": Out(stream.Signature(data.StructLayout({"data": BLOCK_BITS, "tag": tag_width, "error": 1}))),
                "m_axi": Out(axi),
                "base": In(address_width),
                "invalidate": In(1),
                "tick": In(1),
                "hit": Out(1),
                "miss": Out(1),
                "merged": Out(1),
                "stalled": Out(1),
                "prefetch": In(wiring.Signature({"valid": Out(1), "block": Out(BLOCK_NUMBER_BITS)})),
                "prefetching": Out(1),
                "prefetched": Out(1),
                "crowded": Out(1),
                "evicted": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        axi = self.m_axi.signature
        m.submodules.lines = lines = BlockLines(sets=self.sets, ways=self.ways, misses=self.misses)
        m.submodules.misses = misses = FreeList(self.misses)
        m.submodules.waiters = waiters = Waiters(
            misses=self.misses, requests=self.requests, tag_width=self.tag_width + 1, line_width=lines.line_width
        )
        m.submodules.fill = fill = BlockFill(axi=axi, misses=self.misses, line_width=lines.line_width)
        drain = waiters.o
        address = data.StructLayout({"block": axi.address_width - OFFSET_BITS, "miss": len(fill.miss)})
        m.submodules.addresses = addresses = PassingQueue(address, self.misses)  # so it always has room

        # --- requests: one to be decided, one whose labels are read, and one that came while they could not move
        valid = Signal()
        read_valid = Signal()
        kept_valid = Signal()
        done = Signal()
        moves = Signal()
        read_moves = Signal()
        kept = register(m, ~read_moves & ~kept_valid, self.i.payload, "kept")
        incoming = Signal.like(self.i.payload)
        m.submodules.prefetch = prefetch = Buffer(BLOCK_NUMBER_BITS)
        m.d.comb += [
            moves.eq(~valid | done),
            read_moves.eq(~read_valid | moves),
            self.i.ready.eq(~kept_valid),
            incoming.eq(Mux(kept_valid, kept, Value.cast(self.i.payload))),
            # Nobody waits for a prefetch: what the buffer has no room for is dropped.
            prefetch.i.valid.eq(self.prefetch.valid),
            prefetch.i.payload.eq(self.prefetch.block),
        ]
        with m.If(read_moves):
            m.d.sync += [read_valid.eq(kept_valid | self.i.valid | prefetch.o.valid), kept_valid.eq(0)]
        with m.Elif(self.i.valid):
            m.d.sync += kept_valid.eq(1)
        with m.If(moves):
            m.d.sync += valid.eq(read_valid)
        vacant = ~(kept_valid | self.i.valid)
        m.d.comb += prefetch.o.ready.eq(read_moves & vacant)
        look = Signal(BLOCK_NUMBER_BITS)
        m.d.comb += look.eq(Mux(vacant, prefetch.o.payload, incoming.block))
        read_block = register(m, read_moves, look, "read_block")
        read_tag = register(m, read_moves, incoming.tag, "read_tag")
        read_prefetch = register(m, read_moves, vacant, "read_prefetch")
        block, tag = register(m, moves, read_block, "block"), register(m, moves, read_tag, "tag")
        is_prefetch = register(m, moves, read_prefetch, "is_prefetch")

        # --- what becomes of it ---------------------------------------------------------------------------------------
        asked = Signal()  # by somebody who waits for the answer
        hit_first = Signal()
        hit = Signal()
        may_miss = Signal()
        merge = Signal()
        miss = Signal()
        can_answer = Signal()
        impatient = Signal()
        m.d.comb += [
            # Without a number for another read, blocks that are not there are answered with an error at once.
            asked.eq(valid & ~is_prefetch),
            hit_first.eq(asked & Mux(lines.found, ~lines.awaited, fill.lost) & ~(drain.valid & impatient)),
            hit.eq(hit_first & can_answer),
            merge.eq(asked & lines.awaited & waiters.ready),
            # A prefetch waits for nothing: it starts a read, or nothing happens.
            may_miss.eq(valid & (~is_prefetch | (addresses.level < CALM))),
            miss.eq(may_miss & ~lines.found & lines.available & waiters.ready & misses.o.valid),
            done.eq(hit | merge | miss | (valid & is_prefetch)),
            lines.look.eq(read_moves),
            lines.step.eq(moves),
            lines.block.eq(look),
            lines.touch.eq(hit),
            lines.allocate.eq(miss),
            lines.allocate_miss.eq(misses.o.payload),
            lines.filled.eq(fill.filled),
            lines.filled_line.eq(fill.line),
            lines.filled_error.eq(fill.error),
            lines.release.eq(drain.valid & drain.ready & drain.payload.last),
            lines.release_line.eq(drain.payload.line),
            lines.invalidate.eq(self.invalidate),
            waiters.add.eq(merge | miss),
            waiters.miss.eq(Mux(lines.found, lines.miss, misses.o.payload)),
            waiters.tag.eq(Cat(tag, is_prefetch)),
            waiters.first.eq(~lines.found),
            waiters.filled.eq(fill.filled),
            waiters.ended.eq(fill.ended),
            waiters.filled_miss.eq(fill.miss),
            waiters.filled_line.eq(fill.line),
            waiters.filled_error.eq(fill.error),
            misses.o.ready.eq(miss),
            misses.i.valid.eq(waiters.free),
            misses.i.payload.eq(waiters.free_miss),
        ]
        m.d.sync += [
            self.crowded.eq(addresses.level >= CROWD),
            self.hit.eq(hit),
            self.miss.eq(miss & ~is_prefetch),
            self.prefetched.eq(miss & is_prefetch),
            self.merged.eq(merge),
            self.stalled.eq(asked & Mux(lines.found, lines.awaited, ~fill.lost) & ~merge & ~miss),
            self.evicted.eq(miss & lines.evicts),
        ]

        # A hit goes before those that have waited: they are answered in the cycles of requests that miss, of which
        # there is one for each of them, so that neither lookup nor answers pause. But not more than PATIENCE hits in a
        # row.
        overtaken = Signal(range(PATIENCE + 1))
        m.d.comb += impatient.eq(overtaken == PATIENCE)
        with m.If(drain.ready | ~drain.valid):
            m.d.sync += overtaken.eq(0)
        with m.Elif(drain.valid & hit):
            m.d.sync += overtaken.eq(overtaken + 1)

        # --- reads of the memory --------------------------------------------------------------------------------------
        m.d.comb += [
            addresses.i.valid.eq(miss),
            # Addresses count blocks.
            addresses.i.payload.block.eq(self.base[OFFSET_BITS:] + block),
            addresses.i.payload.miss.eq(misses.o.payload),
            self.m_axi.arvalid.eq(addresses.o.valid),
            addresses.o.ready.eq(self.m_axi.arready),
            self.m_axi.araddr.eq(addresses.o.payload.block << OFFSET_BITS),
            self.m_axi.arid.eq(addresses.o.payload.miss),
            self.m_axi.arlen.eq(axi.block_beats - 1),
            self.m_axi.arsize.eq(axi.beat_size),
            self.m_axi.arburst.eq(INCR),
            fill.start.eq(miss),
            fill.start_miss.eq(misses.o.payload),
            fill.start_line.eq(lines.victim),
            fill.tick.eq(self.tick),
            fill.passed.eq(waiters.passed),
            fill.rvalid.eq(self.m_axi.rvalid),
            self.m_axi.rready.eq(fill.rready),
            fill.rdata.eq(self.m_axi.rdata),
            fill.rid.eq(self.m_axi.rid),
            fill.rresp.eq(self.m_axi.rresp),
            fill.rlast.eq(self.m_axi.rlast),
        ]

        # --- blocks, and answers --------------------------------------------------------------------------------------
        # A line is never read and written in one cycle: it is written while its block is awaited, and read when it has
        # come. A hit reads in the cycle in which it is found, so it does not matter when its line is given to another.
        drains = Signal()
        answers = Signal()
        line = Signal(lines.line_width)
        of_prefetch = drain.payload.tag[self.tag_width]  # which wants no answer
        m.d.comb += [
            can_answer.eq(~self.o.valid | self.o.ready),
            drain.ready.eq(can_answer & ~hit_first),
            drains.eq(drain.valid & drain.ready),
            answers.eq(hit | (drains & ~of_prefetch)),
            line.eq(Mux(hit_first, lines.line, drain.payload.line)),
        ]
        parts = []
        for lane in range(axi.block_beats):
            depth = self.sets * self.ways
            m.submodules[f"blocks{lane}"] = memory = Memory(shape=axi.data_width, depth=depth, init=[])
            writes = memory.write_port()
            reads = memory.read_port()
            m.d.comb += [
                writes.en.eq(fill.write & (fill.lane == lane)),
                writes.addr.eq(fill.line),
                writes.data.eq(fill.data),
                reads.en.eq(answers),
                reads.addr.eq(line),
            ]
            parts.append(reads.data)
        with m.If(can_answer):
            m.d.sync += self.o.valid.eq(answers)
        # Entries of lists that nobody has asked for: a miss's number may be free before its entries have been answered.
        prefetching = Signal(range(self.requests + 1))
        m.d.sync += prefetching.eq(prefetching + (miss & is_prefetch) - (drains & of_prefetch))
        m.d.comb += self.prefetching.eq(prefetch.o.valid | read_valid | valid | (prefetching != 0))
        m.d.comb += [
            self.o.payload.data.eq(Cat(parts)),
            self.o.payload.tag.eq(
                register(m, answers, Mux(hit_first, tag, drain.payload.tag[: self.tag_width]), "answer_tag")
            ),
            self.o.payload.error.eq(
                register(m, answers, Mux(hit_first, ~lines.found, drain.payload.error), "answer_error")
            ),
        ]
        return m

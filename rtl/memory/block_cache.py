"""A cache for blocks of 64 bytes that goes on while it waits for the memory; docs/block_cache.md describes it.

Requests come in order and are answered in any order, each with its tag. A request whose block is there reads it; one
whose block is awaited joins those that wait for the same block, which are answered one a cycle when it has come; any
other is given a line of its set and starts a read.

    i -> requests -> lines --- hit -----------------> answers (RAM) -> o
                       |                                 ^
                       +--- awaited, miss --> waiters ---+
                       +--- miss --> m_axi.ar     ^      |
                                     m_axi.r --> fill ---+
"""

from typing import NamedTuple

from amaranth import Cat, Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.queues import FreeList, PassingQueue, number_width
from lightloom.rtl.memory.axi import INCR, OFFSET_BITS, AxiRead
from lightloom.rtl.memory.block_answers import BlockAnswers, block_answer
from lightloom.rtl.memory.block_fill import BlockFill
from lightloom.rtl.memory.block_lines import BlockLines
from lightloom.rtl.memory.block_requests import PREFETCH, BlockRequests, block_request
from lightloom.rtl.memory.waiters import Waiters

CALM, CROWD = 2, 8
"""Reads that wait for the memory port: prefetches start while there are fewer than CALM, and from CROWD on the memory
does not keep up."""


class _Parts(NamedTuple):
    """What a cache is made of, in the order in which requests come by."""

    requests: BlockRequests
    lines: BlockLines
    misses: FreeList
    waiters: Waiters
    fill: BlockFill
    answers: BlockAnswers
    addresses: PassingQueue


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

    COUNTERS = (
        Counter("hits", "blocks found in it", lambda cache: cache.hit),
        Counter("misses", "blocks that were not there, and that the memory was asked for", lambda cache: cache.miss),
        Counter("merged", "blocks that it was waiting for already", lambda cache: cache.merged),
    )
    PREFETCHES = Counter(
        "prefetches", "blocks that the memory was asked for before a ray did", lambda cache: cache.prefetched
    )

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
                "i": In(stream.Signature(block_request(tag_width))),
                "o": Out(stream.Signature(block_answer(tag_width))),
                "m_axi": Out(axi),
                "base": In(address_width),
                "invalidate": In(1),
                "tick": In(1),
                "hit": Out(1),
                "miss": Out(1),
                "merged": Out(1),
                "stalled": Out(1),
                "prefetch": In(PREFETCH),
                "prefetching": Out(1),
                "prefetched": Out(1),
                "crowded": Out(1),
                "evicted": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        axi = self.m_axi.signature
        m.submodules.requests = requests = BlockRequests(tag_width=self.tag_width)
        m.submodules.lines = lines = BlockLines(sets=self.sets, ways=self.ways, misses=self.misses)
        m.submodules.misses = misses = FreeList(self.misses)
        m.submodules.waiters = waiters = Waiters(
            misses=self.misses, requests=self.requests, tag_width=self.tag_width + 1, line_width=lines.line_width
        )
        m.submodules.fill = fill = BlockFill(axi=axi, misses=self.misses, line_width=lines.line_width)
        m.submodules.block_answers = answers = BlockAnswers(
            depth=self.sets * self.ways, data_width=axi.data_width, tag_width=self.tag_width
        )
        address = data.StructLayout({"block": axi.address_width - OFFSET_BITS, "miss": len(fill.miss)})
        m.submodules.addresses = addresses = PassingQueue(address, self.misses)  # so it always has room
        wiring.connect(m, wiring.flipped(self.i), requests.i)
        wiring.connect(m, wiring.flipped(self.prefetch), requests.prefetch)
        wiring.connect(m, waiters.o, answers.waited)
        wiring.connect(m, answers.o, wiring.flipped(self.o))

        parts = _Parts(requests, lines, misses, waiters, fill, answers, addresses)
        hit, merge, miss = self._outcome(m, parts)
        request = requests.o.payload
        answered = waiters.o.valid & waiters.o.ready  # one that has waited
        unasked = self._unasked(m, miss & request.is_prefetch, answered & waiters.o.payload.tag[self.tag_width])
        m.d.comb += [
            self.prefetching.eq(requests.busy | (unasked != 0)),
            lines.look.eq(requests.look),
            lines.step.eq(requests.step),
            lines.block.eq(requests.block),
            lines.touch.eq(hit),
            lines.allocate.eq(miss),
            lines.allocate_miss.eq(misses.o.payload),
            lines.release.eq(answered & waiters.o.payload.last),
            lines.release_line.eq(waiters.o.payload.line),
            lines.invalidate.eq(self.invalidate),
            waiters.add.eq(merge | miss),
            waiters.miss.eq(Mux(lines.found, lines.miss, misses.o.payload)),
            waiters.tag.eq(Cat(request.tag, request.is_prefetch)),
            waiters.first.eq(~lines.found),
            misses.o.ready.eq(miss),
            misses.i.valid.eq(waiters.free),
            misses.i.payload.eq(waiters.free_miss),
            addresses.i.valid.eq(miss),
            # Addresses count blocks.
            addresses.i.payload.block.eq(self.base[OFFSET_BITS:] + request.block),
            addresses.i.payload.miss.eq(misses.o.payload),
            fill.start.eq(miss),
            fill.start_miss.eq(misses.o.payload),
            fill.start_line.eq(lines.victim),
        ]
        self._read(m, addresses, fill)
        self._fill(m, fill, lines, waiters, answers)
        return m

    def _outcome(self, m: Module, parts: _Parts) -> tuple[Signal, Signal, Signal]:
        """What becomes of a request: it is answered, joins others that wait, or starts a read."""
        requests, lines, misses, waiters, fill, answers, addresses = parts
        request = requests.o.payload
        asked = Signal()  # by somebody who waits for the answer
        hit = Signal()
        merge = Signal()
        may_miss = Signal()
        miss = Signal()
        m.d.comb += [
            asked.eq(requests.o.valid & ~request.is_prefetch),
            # Without a number for another read, blocks that are not there are answered with an error at once.
            answers.hit.valid.eq(asked & Mux(lines.found, ~lines.awaited, fill.lost)),
            answers.hit.payload.line.eq(lines.line),
            answers.hit.payload.error.eq(~lines.found),
            answers.hit.payload.tag.eq(request.tag),
            hit.eq(answers.hit.valid & answers.hit.ready),
            merge.eq(asked & lines.awaited & waiters.ready),
            # A prefetch waits for nothing: it starts a read, or nothing happens.
            may_miss.eq(requests.o.valid & (~request.is_prefetch | (addresses.level < CALM))),
            miss.eq(may_miss & ~lines.found & lines.available & waiters.ready & misses.o.valid),
            requests.o.ready.eq(hit | merge | miss | request.is_prefetch),
        ]
        m.d.sync += [
            self.crowded.eq(addresses.level >= CROWD),
            self.hit.eq(hit),
            self.miss.eq(miss & ~request.is_prefetch),
            self.prefetched.eq(miss & request.is_prefetch),
            self.merged.eq(merge),
            self.stalled.eq(asked & Mux(lines.found, lines.awaited, ~fill.lost) & ~merge & ~miss),
            self.evicted.eq(miss & lines.evicts),
        ]
        return hit, merge, miss

    def _unasked(self, m: Module, begins: Value, ends: Value) -> Signal:
        """How many entries of lists nobody has asked for, in front of what begins and ends in this cycle.

        They may be more than `misses`: the number of a miss may be free before its entries have been answered.
        """
        unasked = Signal(range(self.requests + 1))
        m.d.sync += unasked.eq(unasked + begins - ends)
        return unasked

    def _read(self, m: Module, addresses: PassingQueue, fill: BlockFill) -> None:
        """The memory: addresses go out, beats come in."""
        axi = self.m_axi.signature
        m.d.comb += [
            self.m_axi.arvalid.eq(addresses.o.valid),
            addresses.o.ready.eq(self.m_axi.arready),
            self.m_axi.araddr.eq(addresses.o.payload.block << OFFSET_BITS),
            self.m_axi.arid.eq(addresses.o.payload.miss),
            self.m_axi.arlen.eq(axi.block_beats - 1),
            self.m_axi.arsize.eq(axi.beat_size),
            self.m_axi.arburst.eq(INCR),
            self.m_axi.rready.eq(fill.rready),
        ]
        for name in ("rvalid", "rdata", "rid", "rresp", "rlast"):
            m.d.comb += getattr(fill, name).eq(getattr(self.m_axi, name))

    def _fill(self, m: Module, fill: BlockFill, lines: BlockLines, waiters: Waiters, answers: BlockAnswers) -> None:
        """Tells of what has come who has to know: a part of a block, or the end of a read."""
        m.d.comb += [
            fill.tick.eq(self.tick),
            fill.passed.eq(waiters.passed),
            answers.write.en.eq(fill.write),
            answers.write.line.eq(fill.line),
            answers.write.lane.eq(fill.lane),
            answers.write.data.eq(fill.data),
            waiters.ended.eq(fill.ended),
            waiters.filled_miss.eq(fill.miss),
        ]
        for each in (lines, waiters):
            m.d.comb += [
                each.filled.eq(fill.filled),
                each.filled_line.eq(fill.line),
                each.filled_error.eq(fill.error),
            ]

# amaranth: UnusedElaboratable=no
# (a unit that is made only to ask for its ports has these, too)
"""The way of a traversal unit's visits to their blocks: a queue and a cache."""

from typing import Any

from amaranth import Module, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.rtl.blocks import Cache
from lightloom.rtl.fabric.queues import PassingQueue
from lightloom.rtl.memory.axi import BLOCK_BITS
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.rtl.memory.block_requests import PREFETCH

BACKLOG = 3
"""Requests in front of a cache from which on they wait, and do not only pass."""


class VisitedBlocks(wiring.Component):
    """Reads the block of each visit; blocks come in any order.

    There is room for all visits in the queue and in the cache, all that there can be: so `i` is always
    ready, the cache can always answer, and what waits for it always gets on.

    Ports: `i`, stream of visits, `o`, stream of them with their blocks: {data, error: the read failed, visit}. `base`,
    `invalidate`, `tick`, `prefetch`, `prefetching` and `m_axi` are those of the cache (`rtl.memory.block_cache`), but
    `prefetching` already in the cycle of a `prefetch`. `backlog`: visits wait in front of the cache, or many reads for
    the memory. The events of the `cache` may be counted.
    """

    def __init__(self, *, visits: int, cache: Cache, visit: data.StructLayout, axi: dict[str, int]):
        """At most `visits` are in flight. `visit`: its `address` is a block's number; `axi`: the widths of the memory
        port, an `AxiRead`."""
        self._queue = PassingQueue(visit, visits)
        self.cache = BlockCache(
            sets=cache.sets,
            ways=cache.ways,
            misses=cache.misses,
            requests=visits,
            tag_width=visit.size,
            **axi,
        )
        super().__init__(
            {
                "i": In(stream.Signature(visit, always_ready=True)),
                "o": Out(stream.Signature(data.StructLayout({"data": BLOCK_BITS, "error": 1, "visit": visit}))),
                "m_axi": Out(self.cache.m_axi.signature),
                "base": In(axi["address_width"]),
                "invalidate": In(1),
                "tick": In(1),
                "prefetch": In(PREFETCH),
                "prefetching": Out(1),
                "backlog": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.queue = queue = self._queue
        m.submodules.cache = cache = self.cache
        wiring.connect(m, wiring.flipped(self.i), queue.i)
        wiring.connect(m, wiring.flipped(self.prefetch), cache.prefetch)
        wiring.connect(m, cache.m_axi, wiring.flipped(self.m_axi))
        answer: Any = cache.o.payload
        m.d.comb += [
            cache.i.valid.eq(queue.o.valid),
            cache.i.payload.block.eq(queue.o.payload.address),
            cache.i.payload.tag.eq(queue.o.payload),
            queue.o.ready.eq(cache.i.ready),
            cache.base.eq(self.base),
            cache.invalidate.eq(self.invalidate),
            cache.tick.eq(self.tick),
            self.o.valid.eq(cache.o.valid),
            self.o.payload.data.eq(answer.data),
            self.o.payload.error.eq(answer.error),
            Value.cast(self.o.payload.visit).eq(answer.tag),
            cache.o.ready.eq(self.o.ready),
            self.prefetching.eq(self.prefetch.valid | cache.prefetching),
            self.backlog.eq((queue.level >= BACKLOG) | cache.crowded),
        ]
        return m

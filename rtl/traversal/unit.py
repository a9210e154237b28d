# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its ports)
"""The traversal unit: rays in, hits out, through a tree of boxes in memory."""

from typing import Any

from amaranth import Const, Module, ResetInserter, Signal, Value
from amaranth.lib import stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import LEAF_RAY, RAY_QUERY, RAY_RESULT
from lightloom.golden_model.contract.interfaces import COUNTERS
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.layouts import packet_of
from lightloom.rtl.fabric.queues import PassingQueue, Queue, number_width
from lightloom.rtl.memory.axi_read_arbiter import AxiReadArbiter
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.rtl.memory.header_reader import HeaderReader
from lightloom.rtl.memory.read_timer import TIMEOUT_BITS, ReadTimer
from lightloom.rtl.traversal.control import Control
from lightloom.rtl.traversal.counters import COUNTER_BITS, Counters
from lightloom.rtl.traversal.intake import LATTICE, Intake
from lightloom.rtl.traversal.leaf import LeafStage
from lightloom.rtl.traversal.loader import Loader
from lightloom.rtl.traversal.node_stage import NodeStage
from lightloom.rtl.traversal.records import ADDRESS_BITS
from lightloom.rtl.traversal.results import Results

MASTERS = 3
"""The header reader and two caches share the memory port."""


BACKLOG = 3
"""Requests in front of a cache from which on they wait, and do not only pass."""


class Traversal(wiring.Component):
    """Traces `config.contexts` rays at a time (docs/traversal_unit.md).

    Ports:

    - `i`: stream of RAY_QUERY with a tag; `o`: stream of RAY_RESULT with the same tag, in any order.
    - `m_axi`: AXI4 read master.
    - `load`: strobe, a tree is to be used that begins at byte address `base`, a multiple of 64. Rays that are in the
      unit are finished first, and no ray enters before its header is read. Then `loaded` is high, or `load_error` says
      why not (`rtl.memory.header_reader`); until then both are 0.
    - `read_timeout`: cycles after which, within as many again, a read of the memory that is not answered fails
      (`rtl.memory.read_timer`); 0: it is waited for.
    - `abort`: strobe, rays and tree are forgotten. `aborting` is high from the next cycle until all reads under way
      have been answered, or with a `read_timeout` until the memory has been silent for so long; no ray is taken
      meanwhile, and a `load` is lost. Then all is as after a reset.
    - `overlap`: how many visits of a ray may be under way, 1 to `config.overlap`.
    - `count_<name>`: counters (`rtl.traversal.counters`); `count_clear` sets them to 0.
    """

    def __init__(self, config: Config):
        self._config = config
        ports = {
            "address_width": config.address_width,
            "data_width": config.axi_width,
            "id_width": max(number_width(config.node_misses), number_width(config.triangle_misses)),
        }
        self._ports = ports
        self._header = HeaderReader(width=config.width, stack=config.stack, **ports)
        self.reads = 1 + config.node_misses + config.triangle_misses
        """Greatest number of reads under way."""
        self._arbiter = AxiReadArbiter(MASTERS, reads=self.reads, **ports)
        super().__init__(
            {
                "i": In(stream.Signature(packet_of(RAY_QUERY, config.tag_width))),
                "o": Out(stream.Signature(packet_of(RAY_RESULT, config.tag_width))),
                "m_axi": Out(self._arbiter.m_axi.signature),
                "load": In(1),
                "base": In(config.address_width),
                "loaded": Out(1),
                "load_error": Out(len(self._header.load_error)),
                "overlap": In(config.overlap.bit_length()),
                "read_timeout": In(TIMEOUT_BITS),
                "abort": In(1),
                "aborting": Out(1),
                "count_clear": In(1),
                **{f"count_{name}": Out(COUNTER_BITS) for name in COUNTERS},
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        config = self._config
        visits = config.contexts * config.overlap
        m.submodules.arbiter = arbiter = self._arbiter

        def part(name: str, component: Any) -> Any:
            """A part that an abort resets."""
            m.submodules[name] = ResetInserter(arbiter.aborting)(component)
            return component

        loader = part("loader", Loader(config.address_width))
        header = part("header_reader", self._header)
        m.submodules.read_timer = timer = ReadTimer()  # which goes on: an abort may be waiting for it
        intake = part("intake", Intake(config))
        control = part("control", Control(config))
        nodes = part("nodes", NodeStage(config))
        leaves = part("leaves", LeafStage(config))
        results = part("results", Results(config))
        counters = part("counters", Counters())

        idle = Signal()  # no ray is inside
        prefetching = Signal()  # but a prefetch may be, of a ray that was
        m.d.comb += idle.eq(intake.idle & control.idle)

        # --- the tree -----------------------------------------------------------------------------------------------
        m.d.comb += [
            loader.load.eq(self.load),
            loader.base.eq(self.base),
            loader.idle.eq(idle & ~prefetching),
            loader.busy.eq(header.busy),
            header.load.eq(loader.go),
            header.base.eq(loader.next_base),
            timer.timeout.eq(self.read_timeout),
            header.tick.eq(timer.tick),
            intake.tree.eq(header.loaded),
            nodes.blocks.eq(header.blocks),
            control.root.eq(header.root),
            control.levels.eq(header.levels),
            control.overlap.eq(self.overlap),
        ]
        m.d.comb += [intake.lattice[name].eq(getattr(header, name)) for name in LATTICE.names or ()]
        with m.If(~loader.loading):
            m.d.comb += [self.loaded.eq(header.loaded), self.load_error.eq(header.load_error)]

        # --- rays in and out ----------------------------------------------------------------------------------------
        enters = Signal()
        m.d.comb += [
            enters.eq(~(loader.loading | arbiter.aborting)),
            intake.i.payload.eq(self.i.payload),
            intake.i.valid.eq(self.i.valid & enters),
            self.i.ready.eq(intake.i.ready & enters),
        ]
        prepared = intake.o.payload
        starts = control.start.valid & control.start.ready
        m.d.comb += [
            control.start.valid.eq(intake.o.valid),
            control.start.payload.skip.eq(prepared.skip),
            intake.o.ready.eq(control.start.ready),
            nodes.start.valid.eq(starts),
            nodes.start.payload.context.eq(control.start_context),
            nodes.start.payload.ray.eq(prepared.node),
            leaves.start.valid.eq(starts),
            leaves.start.payload.context.eq(control.start_context),
            results.start.valid.eq(starts),
            results.start.payload.context.eq(control.start_context),
            results.start.payload.status.eq(prepared.status),
            control.started.valid.eq(leaves.started.valid),
            control.started.context.eq(leaves.started.context),
        ]
        m.d.comb += [leaves.start.payload[name].eq(prepared.leaf[name]) for name in LEAF_RAY.names or ()]
        wiring.connect(m, control.finished, results.i)
        wiring.connect(m, results.release, control.release)
        for side in range(2):
            wiring.connect(m, control.failed[side], results.failed[side])
        wiring.connect(m, results.o, wiring.flipped(self.o))

        # --- visits: request, block, result -------------------------------------------------------------------------
        # Every queue on the way has room for all visits that there can be. So the stages' own requests never wait, the
        # caches can always answer, and what waits for a cache always gets on.
        caches = {}
        backlog: Value = Const(0)
        prefetches: Value = control.near_leaf.valid
        for name, requests in (("node", control.node_request), ("triangle", control.leaf_request)):
            queue = part(f"{name}_queue", PassingQueue(requests.payload.shape(), visits))
            backlog |= queue.level >= BACKLOG
            cache = BlockCache(
                sets=getattr(config, f"{name}_sets"),
                ways=getattr(config, f"{name}_ways"),
                misses=getattr(config, f"{name}_misses"),
                requests=visits,
                tag_width=len(Value.cast(requests.payload)),
                **self._ports,
            )
            caches[name] = part(f"{name}_cache", cache)
            backlog |= cache.crowded
            prefetches |= cache.prefetching
            wiring.connect(m, requests, queue.i)
            m.d.comb += [
                cache.i.valid.eq(queue.o.valid),
                cache.i.payload.block.eq(queue.o.payload.address),
                cache.i.payload.tag.eq(queue.o.payload),
                queue.o.ready.eq(cache.i.ready),
                cache.base.eq(header.tree_base),
                cache.invalidate.eq(loader.go),
                cache.tick.eq(timer.tick),
            ]
        m.d.comb += [
            caches["triangle"].prefetch.valid.eq(control.near_leaf.valid),
            caches["triangle"].prefetch.block.eq(control.near_leaf.payload.address),
            prefetching.eq(prefetches),
        ]
        m.d.comb += [control.backlog.eq(backlog), control.starved.eq(nodes.starved)]
        m.d.comb += [
            nodes.i.valid.eq(caches["node"].o.valid),
            nodes.i.payload.data.eq(caches["node"].o.payload.data),
            nodes.i.payload.error.eq(caches["node"].o.payload.error),
            Value.cast(nodes.i.payload.tag).eq(caches["node"].o.payload.tag),
            caches["node"].o.ready.eq(nodes.i.ready),
        ]
        wiring.connect(m, nodes.o, control.node)
        # The leaf stage is done with visits in the order in which it takes them.
        leaf_addresses = part("leaf_addresses", Queue(ADDRESS_BITS, leaves.latency + 2))
        block = control.leaf_request.payload.shape()(caches["triangle"].o.payload.tag)
        m.d.comb += [
            leaves.i.valid.eq(caches["triangle"].o.valid),
            leaves.i.payload.context.eq(block.context),
            leaves.i.payload.data.eq(caches["triangle"].o.payload.data),
            leaves.i.payload.error.eq(caches["triangle"].o.payload.error),
            caches["triangle"].o.ready.eq(leaves.i.ready),
            leaf_addresses.i.valid.eq(leaves.i.valid & leaves.i.ready),
            leaf_addresses.i.payload.eq(block.address),
            leaf_addresses.o.ready.eq(leaves.done.valid),
            control.leaf.valid.eq(leaves.done.valid),
            control.leaf.payload.context.eq(leaves.done.context),
            control.leaf.payload.address.eq(leaf_addresses.o.payload),
            control.leaf.payload.hit.eq(leaves.done.hit),
            control.leaf.payload.error.eq(leaves.done.error),
            leaves.hit_read.context.eq(results.hit_read.context),
            results.hit_read.hit.eq(leaves.hit_read.hit),
        ]
        for reader, port in zip((nodes.time_read, control.time_read), leaves.time_read, strict=True):
            m.d.comb += [port.context.eq(reader.context), reader.time.eq(port.time)]

        # --- memory -------------------------------------------------------------------------------------------------
        m.d.comb += [
            arbiter.abort.eq(self.abort),
            arbiter.tick.eq(timer.tick),
            arbiter.timed.eq(timer.runs),
            self.aborting.eq(arbiter.aborting),
        ]
        for k, master in enumerate((header.m_axi, caches["node"].m_axi, caches["triangle"].m_axi)):
            wiring.connect(m, master, arbiter.masters[k])
        wiring.connect(m, arbiter.m_axi, wiring.flipped(self.m_axi))

        # --- counters -----------------------------------------------------------------------------------------------
        given = self.o.valid & self.o.ready
        busy = ~idle
        events = {
            "cycles": busy,
            "rays": given,
            "node_tests": control.visit,
            "revisits": control.revisit,
            "triangle_tests": leaves.test,
            "leaf_visits": leaves.done.valid & (leaves.done.error == 0),
            "node_busy": nodes.tested,
            "node_starved": nodes.starved & busy,
            "node_stalled": nodes.stalled,
            "triangle_busy": leaves.test,
            "triangle_starved": leaves.starved & busy,
            "triangle_stalled": leaves.stalled,
            "beats": self.m_axi.rvalid & self.m_axi.rready,
            "errors": given & (self.o.payload.data.error != 0),
        }
        for name, cache in caches.items():
            events |= {f"{name}_hits": cache.hit, f"{name}_misses": cache.miss, f"{name}_merged": cache.merged}
        events["triangle_prefetches"] = caches["triangle"].prefetched
        m.d.comb += counters.clear.eq(self.count_clear)
        for name in COUNTERS:
            m.d.comb += [
                getattr(counters, f"event_{name}").eq(events[name]),
                getattr(self, f"count_{name}").eq(getattr(counters, f"count_{name}")),
            ]
        return m

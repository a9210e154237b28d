# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its ports)
"""The traversal unit: rays in, hits out, through a tree of boxes in memory."""

from dataclasses import dataclass, fields
from functools import partial

from amaranth import Module, ResetInserter, Signal, Value
from amaranth.lib import wiring

from lightloom.golden_model.contract.formats import LEAF_RAY, LOAD_ERRORS
from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.counters import Counter, Counters, within
from lightloom.rtl.fabric.queues import Queue, number_width
from lightloom.rtl.fabric.unit import Event, Port, Role, UnitComponent, counter_ports
from lightloom.rtl.memory.axi_read_arbiter import AxiReadArbiter
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.rtl.memory.header_reader import HeaderReader
from lightloom.rtl.memory.read_timer import TIMEOUT_BITS, ReadTimer
from lightloom.rtl.traversal.control import Control
from lightloom.rtl.traversal.intake import LATTICE, Intake
from lightloom.rtl.traversal.leaf import LeafStage
from lightloom.rtl.traversal.loader import Loader
from lightloom.rtl.traversal.node_stage import NodeStage
from lightloom.rtl.traversal.records import ADDRESS_BITS, leaf_visit, node_visit
from lightloom.rtl.traversal.results import Results
from lightloom.rtl.traversal.visited_blocks import VisitedBlocks

MASTERS = 3
"""The header reader and two caches share the memory port."""


EVENTS = (
    Event("load_over", "a tree has been loaded, or refused", lambda unit: unit.loaded | (unit.load_error != 0)),
    Event("abort_over", "an abort has come to its end", lambda unit: ~unit.aborting),
)
"""Of a traversal unit, and of an array of them."""


@dataclass(frozen=True, kw_only=True)
class _Parts:
    """What a unit is made of; an abort resets all but the arbiter and the timer."""

    arbiter: AxiReadArbiter
    timer: ReadTimer

    loader: Loader
    header_reader: HeaderReader
    intake: Intake
    control: Control
    nodes: NodeStage
    leaves: LeafStage
    results: Results
    counters: Counters
    node_blocks: VisitedBlocks
    triangle_blocks: VisitedBlocks
    leaf_addresses: Queue

    @property
    def idle(self) -> Value:
        """No ray is inside."""
        return self.intake.idle & self.control.idle


COUNTERS = (
    Counter("cycles", "cycles in which a ray was in the unit", lambda parts: ~parts.idle),
    *within(lambda parts: parts.results, Results.COUNTERS),
    *within(lambda parts: parts.control, Control.COUNTERS),
    *within(lambda parts: parts.nodes, NodeStage.COUNTERS),
    Counter(
        "node_starved",
        "cycles in which there was no block for the node test",
        lambda parts: parts.nodes.starved & ~parts.idle,
    ),
    *within(lambda parts: parts.leaves, LeafStage.COUNTERS),
    Counter(
        "triangle_starved",
        "cycles in which there was no block for the triangle test",
        lambda parts: parts.leaves.starved & ~parts.idle,
    ),
    *within(lambda parts: parts.node_blocks.cache, BlockCache.COUNTERS, "node cache"),
    *within(lambda parts: parts.triangle_blocks.cache, (*BlockCache.COUNTERS, BlockCache.PREFETCHES), "triangle cache"),
    *within(lambda parts: parts.arbiter, AxiReadArbiter.COUNTERS),
)
"""Of `_Parts`. Busy, starved and stalled cycles of either test add up to `cycles`."""


class Traversal(UnitComponent):
    """Traces `config.traversal.contexts` rays at a time (docs/traversal_unit.md).

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
    - `overlap`: how many visits of a ray may be under way, 1 to `config.traversal.overlap`; 0 counts as 1, and more as
      the most.
    - `count_<name>`: counters (COUNTERS); `count_clear` sets them to 0.
    """

    EVENTS = EVENTS

    def __init__(self, config: Config):
        self._config = config
        ports = {
            "address_width": config.memory.address_width,
            "data_width": config.memory.axi_width,
            "id_width": max(number_width(config.node_cache.misses), number_width(config.triangle_cache.misses)),
        }
        self._ports = ports
        self._header = HeaderReader(width=config.tree.width, stack=config.traversal.stack, **ports)
        self.reads = 1 + config.node_cache.misses + config.triangle_cache.misses
        """Greatest number of reads under way."""
        self._arbiter = AxiReadArbiter(MASTERS, reads=self.reads, **ports)
        super().__init__(
            UNITS["traversal"],
            config.streams.tag_width,
            memory=self._arbiter.m_axi.signature,
            ports=self._described(config) | counter_ports(COUNTERS),
        )

    def _described(self, config: Config) -> dict[str, Port]:
        """The ports beside streams, memory and counters."""
        return {
            "load": Port(role=Role.STROBE, meaning="reads the header of the tree at `base`; rays wait meanwhile"),
            "base": Port(
                width=config.memory.address_width,
                role=Role.CONTROL,
                meaning="byte address of the tree, a multiple of 64 (refused otherwise)",
            ),
            "loaded": Port(role=Role.STATUS, meaning="a usable tree is loaded"),
            "load_error": Port(
                width=len(self._header.load_error),
                role=Role.STATUS,
                meaning="why the last header was refused, 0 if it was not",
                values=LOAD_ERRORS,
            ),
            "overlap": Port(
                width=config.traversal.overlap_bits,
                role=Role.CONTROL,
                meaning="greatest number of visits of one ray in flight, from 1 (strict order) up; 0 counts as 1, and "
                f"more than {config.traversal.overlap} as {config.traversal.overlap}",
                reset=config.traversal.overlap,
            ),
            "read_timeout": Port(
                width=TIMEOUT_BITS,
                role=Role.CONTROL,
                tie=0,
                meaning="cycles after which, within as many again, an unanswered read fails, and an abort ends; "
                "0: never",
            ),
            "abort": Port(
                role=Role.STROBE,
                tie=0,
                meaning="forgets rays and tree; reads under way are finished, their data dropped; then all is as after "
                "a reset",
            ),
            "aborting": Port(role=Role.STATUS, meaning="an abort waits for reads under way"),
            "count_clear": Port(role=Role.STROBE, tie=0, meaning="sets all counters to zero"),
        }

    @property
    def forgetting(self) -> Value:
        return self.aborting

    def elaborate(self, platform: object) -> Module:
        m = Module()
        parts = self._parts(m)
        self._tree(m, parts)
        self._rays(m, parts)
        self._visits(m, parts)
        self._leaves(m, parts)
        self._memory(m, parts)
        self._count(m, parts)
        return m

    def _parts(self, m: Module) -> _Parts:
        config = self._config
        m.submodules.arbiter = self._arbiter
        m.submodules.read_timer = timer = ReadTimer()  # which goes on: an abort may be waiting for it
        blocks = partial(VisitedBlocks, visits=config.traversal.visits, axi=self._ports)
        leaves = LeafStage(config)
        parts = _Parts(
            arbiter=self._arbiter,
            timer=timer,
            loader=Loader(config.memory.address_width),
            header_reader=self._header,
            intake=Intake(config),
            control=Control(config),
            nodes=NodeStage(config),
            leaves=leaves,
            results=Results(config),
            counters=Counters(one.name for one in COUNTERS),
            node_blocks=blocks(cache=config.node_cache, visit=node_visit(config)),
            triangle_blocks=blocks(cache=config.triangle_cache, visit=leaf_visit(config)),
            leaf_addresses=Queue(ADDRESS_BITS, leaves.latency + 2),
        )
        for field in fields(parts):
            if field.name not in ("arbiter", "timer"):
                m.submodules[field.name] = ResetInserter(self._arbiter.aborting)(getattr(parts, field.name))
        return parts

    def _tree(self, m: Module, parts: _Parts) -> None:
        """Which tree there is, and how it is read."""
        loader, header, timer = parts.loader, parts.header_reader, parts.timer
        prefetching = Signal()  # though no ray is inside, a block may be on its way for one that was
        m.d.comb += [
            prefetching.eq(parts.node_blocks.prefetching | parts.triangle_blocks.prefetching),
            loader.load.eq(self.load),
            loader.base.eq(self.base),
            loader.idle.eq(parts.idle & ~prefetching),
            loader.busy.eq(header.busy),
            header.load.eq(loader.go),
            header.base.eq(loader.next_base),
            timer.timeout.eq(self.read_timeout),
            header.tick.eq(timer.tick),
            parts.intake.tree.eq(header.loaded),
            parts.nodes.blocks.eq(header.blocks),
            parts.control.root.eq(header.root),
            parts.control.levels.eq(header.levels),
            parts.control.overlap.eq(self.overlap),
        ]
        m.d.comb += [parts.intake.lattice[name].eq(getattr(header, name)) for name in LATTICE.names or ()]
        for blocks in (parts.node_blocks, parts.triangle_blocks):
            m.d.comb += [blocks.base.eq(header.tree_base), blocks.invalidate.eq(loader.go), blocks.tick.eq(timer.tick)]
        with m.If(~loader.loading):
            m.d.comb += [self.loaded.eq(header.loaded), self.load_error.eq(header.load_error)]

    def _rays(self, m: Module, parts: _Parts) -> None:
        """Rays in and out."""
        intake, control, nodes, leaves, results = (
            parts.intake,
            parts.control,
            parts.nodes,
            parts.leaves,
            parts.results,
        )
        enters = Signal()
        prepared = intake.o.payload
        m.d.comb += [
            enters.eq(~(parts.loader.loading | self._arbiter.aborting)),
            intake.i.payload.eq(self.i.payload),
            intake.i.valid.eq(self.i.valid & enters),
            self.i.ready.eq(intake.i.ready & enters),
            control.start.valid.eq(intake.o.valid),
            control.start.payload.skip.eq(prepared.skip),
            intake.o.ready.eq(control.start.ready),
            nodes.start.payload.ray.eq(prepared.node),
            results.start.payload.status.eq(prepared.status),
            control.started.valid.eq(leaves.started.valid),
            control.started.context.eq(leaves.started.context),
        ]
        m.d.comb += [leaves.start.payload[name].eq(prepared.leaf[name]) for name in LEAF_RAY.names or ()]
        for part in (nodes, leaves, results):
            m.d.comb += [
                part.start.valid.eq(control.start.valid & control.start.ready),
                part.start.payload.context.eq(control.start_context),
            ]
        wiring.connect(m, control.finished, results.i)
        wiring.connect(m, results.release, control.release)
        for side in range(2):
            wiring.connect(m, control.failed[side], results.failed[side])
        wiring.connect(m, results.o, wiring.flipped(self.o))

    def _visits(self, m: Module, parts: _Parts) -> None:
        """Visits: request, block, result. Requests never wait, as every place on the way has room for all of them."""
        control, nodes, leaves = parts.control, parts.nodes, parts.leaves
        wiring.connect(m, control.node_request, parts.node_blocks.i)
        wiring.connect(m, control.leaf_request, parts.triangle_blocks.i)
        node = parts.node_blocks.o.payload
        m.d.comb += [
            parts.triangle_blocks.prefetch.valid.eq(control.near_leaf.valid),
            parts.triangle_blocks.prefetch.block.eq(control.near_leaf.payload.address),
            control.backlog.eq(parts.node_blocks.backlog | parts.triangle_blocks.backlog),
            control.starved.eq(nodes.starved),
            nodes.i.valid.eq(parts.node_blocks.o.valid),
            nodes.i.payload.data.eq(node.data),
            nodes.i.payload.error.eq(node.error),
            nodes.i.payload.tag.eq(node.visit),
            parts.node_blocks.o.ready.eq(nodes.i.ready),
        ]
        wiring.connect(m, nodes.o, control.node)
        for reader, port in zip((nodes.time_read, control.time_read), leaves.time_read, strict=True):
            m.d.comb += [port.context.eq(reader.context), reader.time.eq(port.time)]

    def _leaves(self, m: Module, parts: _Parts) -> None:
        """Blocks of triangles. The leaf stage is done with visits in the order in which it takes them."""
        control, leaves, addresses, blocks = (parts.control, parts.leaves, parts.leaf_addresses, parts.triangle_blocks)
        block = blocks.o.payload
        m.d.comb += [
            leaves.i.valid.eq(blocks.o.valid),
            leaves.i.payload.context.eq(block.visit.context),
            leaves.i.payload.data.eq(block.data),
            leaves.i.payload.error.eq(block.error),
            blocks.o.ready.eq(leaves.i.ready),
            addresses.i.valid.eq(leaves.i.valid & leaves.i.ready),
            addresses.i.payload.eq(block.visit.address),
            addresses.o.ready.eq(leaves.done.valid),
            control.leaf.valid.eq(leaves.done.valid),
            control.leaf.payload.context.eq(leaves.done.context),
            control.leaf.payload.address.eq(addresses.o.payload),
            control.leaf.payload.hit.eq(leaves.done.hit),
            control.leaf.payload.error.eq(leaves.done.error),
            leaves.hit_read.context.eq(parts.results.hit_read.context),
            parts.results.hit_read.hit.eq(leaves.hit_read.hit),
        ]

    def _memory(self, m: Module, parts: _Parts) -> None:
        arbiter = self._arbiter
        m.d.comb += [
            arbiter.abort.eq(self.abort),
            arbiter.tick.eq(parts.timer.tick),
            arbiter.timed.eq(parts.timer.runs),
            self.aborting.eq(arbiter.aborting),
        ]
        ports = (parts.header_reader.m_axi, parts.node_blocks.m_axi, parts.triangle_blocks.m_axi)
        for port, master in zip(ports, arbiter.masters, strict=True):
            wiring.connect(m, port, master)
        wiring.connect(m, arbiter.m_axi, wiring.flipped(self.m_axi))

    def _count(self, m: Module, parts: _Parts) -> None:
        m.d.comb += parts.counters.clear.eq(self.count_clear)
        for one in COUNTERS:
            m.d.comb += [
                getattr(parts.counters, f"event_{one.name}").eq(one.event(parts)),
                getattr(self, f"count_{one.name}").eq(getattr(parts.counters, f"count_{one.name}")),
            ]

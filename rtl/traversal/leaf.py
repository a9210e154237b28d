# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""The leaf stage of a traversal unit: the triangles of a block against the ray that visits it."""

from dataclasses import dataclass
from typing import Any

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data, stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BLOCK_BYTES, LEAF_RAY, TRACE_ERRORS, TRIANGLE_BLOCK, TRIANGLES_KIND
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.counters import Counter
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.intersection.ray_triangle import RayTriangle, RayTriangleHalf
from lightloom.rtl.traversal.best_hits import TIMED, BestHits
from lightloom.rtl.traversal.records import ERROR_BITS, Ports, beside_layout

CORNER_BITS = 96
TESTED = ("origin", "shear", "t_min", "axis", "flip", "cull")
"""The fields of LEAF_RAY that are operands of a test as they are."""


@dataclass(frozen=True)
class _Visit:
    """A visit in front of the core: whether it is there, and one behind it; what it is, its block, its ray."""

    there: Signal
    held: Signal
    arrived: Any
    block: Any
    ray: Any


@dataclass(frozen=True)
class _Chosen:
    """A test, or a visit without one: its turn, which triangles are wanted, which one it is, what is wrong."""

    turn: Signal
    wanted: Signal
    second: Signal
    last: Signal
    error: Signal


class LeafStage(wiring.Component):
    """Tests the triangles of a block a visit, and keeps the best hit of every context.

    A test begins every `config.triangle_test.interval` cycles.

    Ports (docs/leaf_stage.md); a strobe is taken or missed in the cycle in which it is valid:

    - `start`: strobe, a ray (LEAF_RAY) begins in an idle context: no hit, the best t is its t_max, which is no NaN.
    - `started`: strobe, the context's time can be read; visits may begin.
    - `i`: stream of visits: the block as it came from memory; `error`, the memory answered with one. A context that has
      started may have any number of visits in flight.
    - `done`: strobe, the visit's effects show at the read ports. `hit`: the ray asks for any hit and the block has
      one; `error`: a code of TRACE_ERRORS, then nothing was tested.
    - `time_read`, two of them, and `hit_read`: what is asked for in one cycle is there in the next. `time`: `high` of
      `ray_time` for the best t; `hit`: HIT, a miss where there is none.
    - `test`, `starved`, `stalled`: exactly one is high in a cycle: the core gets a test; there is nothing to test; the
      block that is there has nothing to be tested, or has to wait for the core.
    """

    COUNTERS = (
        Counter("triangle_tests", "triangles tested", lambda leaves: leaves.test),
        Counter(
            "leaf_visits", "blocks of triangles visited", lambda leaves: leaves.done.valid & (leaves.done.error == 0)
        ),
        Counter("triangle_busy", "cycles in which a triangle entered the triangle test", lambda leaves: leaves.test),
        Counter(
            "triangle_stalled",
            "cycles for a block of which the ray sees no triangle, and of waiting where a test takes two",
            lambda leaves: leaves.stalled,
        ),
    )

    def __init__(self, config: Config):
        self._core = {1: RayTriangle, 2: RayTriangleHalf}[config.triangle_test.interval](config)
        self._best = BestHits(config)
        self._contexts = config.traversal.contexts
        self._context = context = config.traversal.context_bits
        ports = Ports(config)
        self._ray = layout_of(LEAF_RAY)
        self._beside = beside_layout(config)
        start = data.StructLayout({"context": context, **self._ray.members})
        visit = data.StructLayout({"context": context, "data": 8 * BLOCK_BYTES, "error": 1})
        super().__init__(
            {
                "start": In(wiring.Signature({"valid": Out(1), "payload": Out(start)})),
                "started": Out(ports.started),
                "i": In(stream.Signature(visit)),
                "done": Out(ports.done),
                "time_read": In(ports.time_read).array(2),
                "hit_read": In(ports.hit_read),
                "test": Out(1),
                "starved": Out(1),
                "stalled": Out(1),
            }
        )

    @property
    def latency(self) -> int:
        """Cycles from the taking of a visit with at most one test to its `done`; a second test adds one."""
        return 4 + self._core.latency + self._best.latency

    @property
    def start_latency(self) -> int:
        """Cycles from `start` to `started`, where no better hit comes in between."""
        return self._best.start_latency

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.ray_triangle = self._core
        m.submodules.best_hits = best = self._best
        start = self.start.payload
        m.d.comb += best.start.valid.eq(self.start.valid)
        m.d.comb += [best.start.payload[name].eq(start[name]) for name in ("context", *TIMED)]
        wiring.connect(m, wiring.flipped(self.started), best.started)
        wiring.connect(m, wiring.flipped(self.done), best.done)
        wiring.connect(m, wiring.flipped(self.hit_read), best.hit_read)
        for k in range(2):
            wiring.connect(m, wiring.flipped(self.time_read[k]), best.time_read[k])
        moves = Signal()
        visit = self._visit(m, moves)
        chosen = self._choose(m, visit, moves)
        self._test(m, visit, chosen)
        self._answer(m, visit, chosen)
        return m

    def _visit(self, m: Module, moves: Signal) -> _Visit:
        """A visit: its block, its ray and the best t, read in one cycle and put into registers in the next."""
        kept = data.StructLayout({name: self._ray[name].shape for name in (*TESTED, "t_max", "mask", "any_hit")})
        m.submodules.rays = rays = Ram(kept, self._contexts)
        take = Signal()
        held = Signal()
        there = Signal()
        visit_layout = data.StructLayout({"context": self._context, "block": layout_of(TRIANGLE_BLOCK), "error": 1})
        arrived = Signal(visit_layout, reset_less=True)
        m.d.comb += [
            rays.w_en.eq(self.start.valid),
            rays.w_addr.eq(self.start.payload.context),
            take.eq(self.i.valid & self.i.ready),
            rays.r_en.eq(take),
            rays.r_addr.eq(self.i.payload.context),
            self._best.best_read.en.eq(take),
            self._best.best_read.context.eq(self.i.payload.context),
        ]
        m.d.comb += [rays.w_data[name].eq(self.start.payload[name]) for name in kept.members]
        with m.If(take):
            m.d.sync += arrived.eq(self.i.payload)
        with m.If(self.i.ready):
            m.d.sync += held.eq(self.i.valid)
        visit = Signal(visit_layout, reset_less=True)
        ray = Signal(kept, reset_less=True)
        with m.If(moves):
            m.d.sync += [visit.eq(arrived), ray.eq(rays.r_data), there.eq(held)]
            with m.If(self._best.best_read.found):
                m.d.sync += ray.t_max.eq(self._best.best_read.t)
        return _Visit(there, held, visit, visit.block, ray)

    def _choose(self, m: Module, visit: _Visit, moves: Signal) -> _Chosen:
        """Which of its triangles are tested, and when; without any it still passes through, as one without test."""
        core, block, ray, there = self._core, visit.block, visit.ray, visit.there
        error = Signal(ERROR_BITS)
        wanted = Signal(2)
        first_passed = Signal()
        second = Signal()
        last = Signal()
        turn = Signal(init=1)  # a test, or a visit without one, may go on
        if core.initiation_interval == 2:
            # Its phase is that of the cycle in which it gets what goes on in this one.
            m.d.comb += core.phase.eq(~turn)
            m.d.sync += turn.eq(~turn)
        with m.If(visit.arrived.error):
            m.d.comb += error.eq(TRACE_ERRORS["memory"])
        with m.Elif((block.kind != TRIANGLES_KIND) | ~((block.count == 1) | (block.count == 2))):
            m.d.comb += error.eq(TRACE_ERRORS["kind"])
        m.d.comb += [
            wanted[0].eq((error == 0) & (block.mask[0] & ray.mask).any()),
            wanted[1].eq((error == 0) & (block.mask[1] & ray.mask).any() & (block.count == 2)),
            second.eq(first_passed | ~wanted[0]),
            last.eq(first_passed | ~wanted.all()),
            moves.eq(~there | (last & turn)),
            self.i.ready.eq(~visit.held | moves),
            self.test.eq(there & turn & wanted.any()),
            self.starved.eq(~there),
            self.stalled.eq(there & ~(turn & wanted.any())),
        ]
        with m.If(turn):
            m.d.sync += first_passed.eq(there & ~last)
        return _Chosen(turn, wanted, second, last, error)

    def _test(self, m: Module, visit: _Visit, chosen: _Chosen) -> None:
        """The test that goes into the core."""
        core, block, ray = self._core, visit.block, visit.ray
        test = Signal(core.i.shape(), reset_less=True)
        m.d.sync += [test[name].eq(ray[name]) for name in (*TESTED, "t_max")]
        corners = Value.cast(block.vertices)
        for k in range(3):
            other = corners.word_select(block.order[k], CORNER_BITS)
            m.d.sync += test[f"v{k}"].eq(Mux(chosen.second, other, corners.word_select(k, CORNER_BITS)))
        m.d.comb += [core.en.eq(1), core.i.eq(test)]

    def _answer(self, m: Module, visit: _Visit, chosen: _Chosen) -> None:
        """What travels beside the core, with a stage more before it and one after it; then both to the best hits."""
        core, best, block = self._core, self._best, visit.block
        valid, beside = visit.there & chosen.turn, Signal(self._beside, name="beside0")
        m.d.comb += [
            beside.context.eq(visit.arrived.context),
            beside.primitive.eq(Mux(chosen.second, block.primitive[1], block.primitive[0])),
            beside.any_hit.eq(visit.ray.any_hit),
            beside.tested.eq(chosen.wanted.any()),
            beside.last.eq(chosen.last),
            beside.error.eq(chosen.error),
        ]
        for stage in range(core.latency + 2):
            if stage == core.latency:
                m.d.comb += best.coming.context.eq(beside.context)
            valid_before, before = valid, beside
            valid = Signal(name=f"valid{stage + 1}")
            beside = Signal(self._beside, name=f"beside{stage + 1}", reset_less=True)
            m.d.sync += [valid.eq(valid_before), beside.eq(before)]
        outcome = Signal(core.o.shape(), reset_less=True)
        m.d.sync += outcome.eq(core.o)
        m.d.comb += [best.result.valid.eq(valid), best.result.payload.data.eq(outcome)]
        m.d.comb += [best.result.payload[name].eq(beside[name]) for name in self._beside.members]

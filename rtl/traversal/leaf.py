"""The leaf stage of a traversal unit: triangles against the rays that visit them, and each ray's best hit so far.

A visit is one block of one or two triangles. Its tests enter the ray-triangle core one a cycle; results meet the ray's
best hit in the order of the tests, one a cycle, so that a comparison always sees the one before it. Nothing in the
stage ever waits for anybody after it.
"""

import numpy as np
from amaranth import Module, Mux, Signal, Value, unsigned
from amaranth.lib import data, stream, wiring
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from golden_model.formats import (
    BLOCK_BYTES,
    BOX_RAY,
    HIT,
    RAY_QUERY,
    RAY_TRIANGLE,
    TIME_BITS,
    TRACE_ERRORS,
    TRIANGLE_BLOCK,
    TRIANGLES_KIND,
)
from rtl.config import Config
from rtl.layouts import layout_of
from rtl.operators.float_compare import compare
from rtl.ray_time import RayTime
from rtl.ray_triangle import RayTriangle

BLOCK_BITS = 8 * BLOCK_BYTES
CORNER_BITS = 96
TESTED = ("origin", "shear", "t_min", "t_max", "axis", "flip", "cull")
"""What a triangle test needs of a ray; it is called the same in RAY_TRIANGLE."""
TIMED = ("rate", "scale")
"""What turns t into the box test's distance."""
LEAF_RAY = np.dtype(
    [
        *((name, RAY_TRIANGLE[name]) for name in TESTED),
        *((name, BOX_RAY[name]) for name in TIMED),
        ("mask", RAY_QUERY["mask"]),
        ("any_hit", RAY_QUERY["any_hit"]),
    ]
)
"""All that the stage needs of a ray."""

ERROR_BITS = 3


class LeafStage(wiring.Component):
    """Tests the triangles of a block a visit and keeps the best hit of every context (docs/leaf_stage.md).

    Ports; a strobe is taken or missed in the cycle in which it is valid:

    - `start`: strobe, a ray (LEAF_RAY) begins in an idle context: no hit, best t is its t_max (not NaN).
    - `started`: strobe, the context's distance can be read; visits may begin.
    - `i`: stream of visits, the block as it came from memory; `error`: the memory answered with an error. A context
      that has started may have any number of them in flight.
    - `done`: strobe, the visit's effects show at the read ports. `hit`: the ray asks for any hit and the block has
      one; `error`: of TRACE_ERRORS, then nothing was tested.
    - `time_read`, two of them, and `hit_read`: what is asked for in one cycle is there in the next. `time`: an upper
      bound of the best t (`ray_time`, high); `hit`: HIT, a miss where there is none.
    - `test`, `starved`, `stalled`: exactly one is high in a cycle: the core got a test; nothing was there to test; the
      block that was there had nothing to be tested.
    """

    def __init__(self, config: Config):
        self._config = config
        self._core = RayTriangle(config)
        self._ray_time = RayTime(config)
        self._contexts = config.contexts
        context = unsigned(max(1, (config.contexts - 1).bit_length()))
        self._context_shape = context
        self._ray_layout = layout_of(LEAF_RAY)
        self._hit_layout = layout_of(HIT)
        start = data.StructLayout({"context": context, **self._ray_layout.members})
        visit = data.StructLayout({"context": context, "data": BLOCK_BITS, "error": 1})
        time_read = wiring.Signature({"context": Out(context), "time": In(TIME_BITS)})
        super().__init__(
            {
                "start": In(wiring.Signature({"valid": Out(1), "payload": Out(start)})),
                "started": Out(wiring.Signature({"valid": Out(1), "context": Out(context)})),
                "i": In(stream.Signature(visit)),
                "done": Out(
                    wiring.Signature(
                        {"valid": Out(1), "context": Out(context), "hit": Out(1), "error": Out(ERROR_BITS)}
                    )
                ),
                "time_read": In(time_read).array(2),
                "hit_read": In(wiring.Signature({"context": Out(context), "hit": In(self._hit_layout)})),
                "test": Out(1),
                "starved": Out(1),
                "stalled": Out(1),
            }
        )

    @property
    def latency(self) -> int:
        """Cycles from the taking of a visit with one test to its `done`; another test takes one more."""
        return 5 + self._core.latency + self._ray_time.latency

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.ray_triangle = core = self._core
        m.submodules.ray_time = ray_time = self._ray_time
        m.d.comb += [core.en.eq(1), ray_time.en.eq(1)]
        context, count = self._context_shape, self._contexts

        # --- what is kept of each context ---------------------------------------------------------------------------
        # Two copies of t_max: one is read with a visit, the other when the stage gets round to the ray's distance.
        ray_layout = data.StructLayout({name: member.shape for name, member in self._ray_layout if name not in TIMED})
        m.submodules.rays = rays = Memory(shape=ray_layout, depth=count, init=[])
        clock_layout = data.StructLayout({name: self._ray_layout[name].shape for name in ("t_max", *TIMED)})
        m.submodules.clocks = clocks = Memory(shape=clock_layout, depth=count, init=[])
        # Where `found` is not set, the best t is the ray's t_max. So `best` is written by results alone.
        best_layout = data.StructLayout({"t": 32, "primitive": 32})
        m.submodules.best = best = Memory(shape=best_layout, depth=count, init=[])
        m.submodules.hits = hits = Memory(shape=self._hit_layout, depth=count, init=[])
        m.submodules.times = times = Memory(shape=TIME_BITS, depth=count, init=[])
        found = Signal(count)

        # --- start --------------------------------------------------------------------------------------------------
        ray_write, clock_write = rays.write_port(), clocks.write_port()
        # Starts wait for a cycle in which no better hit needs the conversion of t; a context waits at most once.
        m.submodules.starting = starting = SyncFIFOBuffered(width=len(self.started.context), depth=count)
        m.d.comb += [
            ray_write.en.eq(self.start.valid),
            ray_write.addr.eq(self.start.payload.context),
            clock_write.en.eq(self.start.valid),
            clock_write.addr.eq(self.start.payload.context),
            starting.w_en.eq(self.start.valid),
            starting.w_data.eq(self.start.payload.context),
        ]
        m.d.comb += [ray_write.data[name].eq(self.start.payload[name]) for name in ray_layout.members]
        m.d.comb += [clock_write.data[name].eq(self.start.payload[name]) for name in clock_layout.members]

        # --- a visit: its block, and what is known of its ray -------------------------------------------------------
        take = Signal()
        held = Signal()
        block = Signal(layout_of(TRIANGLE_BLOCK), reset_less=True)
        block_context = Signal(context, reset_less=True)
        block_error = Signal(reset_less=True)
        block_found = Signal(reset_less=True)
        ray_read, best_read = rays.read_port(), best.read_port()
        m.d.comb += [
            take.eq(self.i.valid & self.i.ready),
            ray_read.en.eq(take),
            ray_read.addr.eq(self.i.payload.context),
            best_read.en.eq(take),
            best_read.addr.eq(self.i.payload.context),
        ]
        with m.If(take):
            m.d.sync += [
                block.eq(self.i.payload.data),
                block_context.eq(self.i.payload.context),
                block_error.eq(self.i.payload.error),
                block_found.eq(found.bit_select(self.i.payload.context, 1)),
            ]
        ray = ray_read.data

        # --- which of its triangles are tested, and when ------------------------------------------------------------
        error = Signal(ERROR_BITS)
        wanted = Signal(2)
        second, last = Signal(), Signal()
        """The second triangle's turn; the block's last test, or its only turn without one."""
        first_done = Signal()
        one, two = block.count == 1, block.count == 2
        with m.If(block_error):
            m.d.comb += error.eq(TRACE_ERRORS["memory"])
        with m.Elif((block.kind != TRIANGLES_KIND) | ~(one | two)):
            m.d.comb += error.eq(TRACE_ERRORS["kind"])
        m.d.comb += [
            wanted[0].eq((error == 0) & (block.mask[0] & ray.mask).any()),
            wanted[1].eq((error == 0) & two & (block.mask[1] & ray.mask).any()),
            second.eq(first_done | ~wanted[0]),
            last.eq(first_done | ~wanted.all()),
            self.i.ready.eq(~held | last),
            self.test.eq(held & wanted.any()),
            self.starved.eq(~held),
            self.stalled.eq(held & ~wanted.any()),
        ]
        m.d.sync += first_done.eq(held & ~last)
        with m.If(self.i.ready):
            m.d.sync += held.eq(self.i.valid)

        test = Signal(core.i.shape(), reset_less=True)
        m.d.sync += [test[name].eq(ray[name]) for name in TESTED if name != "t_max"]
        m.d.sync += test.t_max.eq(Mux(block_found, best_read.data.t, ray.t_max))
        corners = Value.cast(block.vertices)
        for k in range(3):
            other = corners.word_select(block.order[k], CORNER_BITS)
            m.d.sync += test[f"v{k}"].eq(Mux(second, other, corners.word_select(k, CORNER_BITS)))
        m.d.comb += core.i.eq(test)

        # --- what travels beside the core ---------------------------------------------------------------------------
        beside_layout = data.StructLayout(
            {"context": context, "primitive": 32, "any_hit": 1, "tested": 1, "last": 1, "error": ERROR_BITS}
        )
        entering = Signal(beside_layout)
        m.d.comb += [
            entering.context.eq(block_context),
            entering.primitive.eq(Mux(second, block.primitive[1], block.primitive[0])),
            entering.any_hit.eq(ray.any_hit),
            entering.tested.eq(wanted.any()),
            entering.last.eq(last),
            entering.error.eq(error),
        ]
        # One stage with the test's register, one with each of the core's, one with the result's.
        valid, beside = held, entering
        for stage in range(core.latency + 2):
            valid_before, before = valid, beside
            valid = Signal(name=f"valid{stage}")
            beside = Signal(beside_layout, name=f"beside{stage}", reset_less=True)
            m.d.sync += [valid.eq(valid_before), beside.eq(before)]
        result = Signal(core.o.shape(), reset_less=True)
        m.d.sync += result.eq(core.o)

        # --- the best hit -------------------------------------------------------------------------------------------
        # Read and written in one cycle: the next result may be the same ray's.
        best_old, best_write, hit_write = best.read_port(domain="comb"), best.write_port(), hits.write_port()
        hit, better, nearer = Signal(), Signal(), Signal()
        order = compare(m, a=result.t, b=best_old.data.t)
        lower = beside.primitive.as_signed() < best_old.data.primitive.as_signed()
        m.d.comb += [
            best_old.addr.eq(beside.context),
            nearer.eq(order["less"] | (order["equal"] & lower)),
            hit.eq(valid & beside.tested & result.hit),
            better.eq(hit & (~found.bit_select(beside.context, 1) | nearer)),
            best_write.en.eq(better),
            best_write.addr.eq(beside.context),
            best_write.data.t.eq(result.t),
            best_write.data.primitive.eq(beside.primitive),
            hit_write.en.eq(better),
            hit_write.addr.eq(beside.context),
            hit_write.data.primitive.eq(beside.primitive),
        ]
        m.d.comb += [hit_write.data[name].eq(result[name]) for name in ("t", "u", "v", "front")]
        for k in range(count):
            with m.If(better & (beside.context == k)):
                m.d.sync += found[k].eq(1)
            with m.If(self.start.valid & (self.start.payload.context == k)):
                m.d.sync += found[k].eq(0)

        # The tests of a block follow each other: a hit of the first is known one cycle before its second's.
        hit_before = Signal()
        m.d.sync += hit_before.eq(hit & ~beside.last)

        # --- its distance -------------------------------------------------------------------------------------------
        clock_read = clocks.read_port()
        m.d.comb += [
            clock_read.addr.eq(Mux(better, beside.context, starting.r_data)),
            starting.r_en.eq(starting.r_rdy & ~better),
        ]
        late_layout = data.StructLayout(
            {"time_context": context, "done_context": context, "hit": 1, "error": ERROR_BITS}
        )
        strobes_layout = data.StructLayout({"better": 1, "started": 1, "done": 1})
        late, strobes = Signal(late_layout), Signal(strobes_layout)
        m.d.comb += [
            late.time_context.eq(clock_read.addr),
            late.done_context.eq(beside.context),
            late.hit.eq(beside.any_hit & (hit | hit_before)),
            late.error.eq(beside.error),
            strobes.better.eq(better),
            strobes.started.eq(starting.r_en),
            strobes.done.eq(valid & beside.last),
        ]
        better_t = Signal(32, reset_less=True)
        m.d.sync += better_t.eq(result.t)
        for stage in range(ray_time.latency + 1):
            late_before, strobes_before = late, strobes
            late = Signal(late_layout, name=f"late{stage}", reset_less=True)
            strobes = Signal(strobes_layout, name=f"strobes{stage}")
            m.d.sync += [late.eq(late_before), strobes.eq(strobes_before)]
            if stage == 0:
                m.d.comb += ray_time.i.t.eq(Mux(strobes.better, better_t, clock_read.data.t_max))
        m.d.comb += [ray_time.i[name].eq(clock_read.data[name]) for name in TIMED]

        time_write = times.write_port()
        m.d.comb += [
            time_write.en.eq(strobes.better | strobes.started),
            time_write.addr.eq(late.time_context),
            time_write.data.eq(ray_time.o.high),
        ]
        done_layout = data.StructLayout({"context": context, "hit": 1, "error": ERROR_BITS})
        done, started_context = Signal(done_layout, reset_less=True), Signal(context, reset_less=True)
        m.d.sync += [
            self.started.valid.eq(strobes.started),
            self.done.valid.eq(strobes.done),
            started_context.eq(late.time_context),
            done.context.eq(late.done_context),
            done.hit.eq(late.hit),
            done.error.eq(late.error),
        ]
        m.d.comb += [
            self.started.context.eq(started_context),
            self.done.context.eq(done.context),
            self.done.hit.eq(done.hit),
            self.done.error.eq(done.error),
        ]

        # --- the read ports -----------------------------------------------------------------------------------------
        for port in self.time_read:
            time_read = times.read_port()
            m.d.comb += [time_read.addr.eq(port.context), port.time.eq(time_read.data)]
        hit_read, hit_found = hits.read_port(), Signal(reset_less=True)
        m.d.sync += hit_found.eq(found.bit_select(self.hit_read.context, 1))
        m.d.comb += hit_read.addr.eq(self.hit_read.context)
        with m.If(hit_found):
            m.d.comb += self.hit_read.hit.eq(hit_read.data)
        with m.Else():
            m.d.comb += self.hit_read.hit.primitive.eq(-1)
        return m

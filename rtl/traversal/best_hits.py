# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Each context's best hit so far, and how far its ray still has to look for a better one."""

from amaranth import Module, Mux, Signal
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import LEAF_RAY, TIME_BITS, TRIANGLE_HIT
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.fabric.queues import Queue
from lightloom.rtl.intersection.ray_time import RayTime
from lightloom.rtl.operators.float_compare import compare
from lightloom.rtl.traversal.records import ERROR_BITS, Ports, beside_layout

TIMED = ("t_max", "rate", "scale")
"""The fields of LEAF_RAY that give the box test's distance of t_max."""


class BestHits(wiring.Component):
    """Compares the results of triangle tests with the best hit of their context, one a cycle.

    The best hit has the lowest t; of equal ones, the lowest index. Ports:

    - `start`: strobe, a ray begins: no hit, the best t is its t_max. `started`: strobe, its `time` can be read.
    - `coming`: the context of the result that comes two cycles later.
    - `result`: strobe, what the ray-triangle core says. A visit has one or two, and `last` marks the last; where
      `tested` is not set there was no test, and `error` says why.
    - `done`: strobe, the visit's effects show at all read ports. `hit`: a test of it hit, and the ray asks for any hit.
    - `best_read`, `time_read`, `hit_read`: what is asked for in one cycle is there in the next; `best_read` holds it
      while `en` is low. Without `found`, `t` means nothing, and `hit` is a miss. While a visit is under way, `hit` may
      mean nothing either.
    """

    def __init__(self, config: Config):
        self._ray_time = RayTime(config)
        self._contexts = config.traversal.contexts
        self._context = context = config.traversal.context_bits
        ports = Ports(config)
        ray = layout_of(LEAF_RAY).members
        self._timed = data.StructLayout({name: ray[name] for name in TIMED})
        start = data.StructLayout({"context": context, **self._timed.members})
        result = data.StructLayout({**beside_layout(config).members, "data": layout_of(TRIANGLE_HIT)})
        coming = {"context": Out(context)}
        best_read = {"en": Out(1), "context": Out(context), "found": In(1), "t": In(32)}
        super().__init__(
            {
                "start": In(wiring.Signature({"valid": Out(1), "payload": Out(start)})),
                "started": Out(ports.started),
                "coming": In(wiring.Signature(coming)),
                "result": In(wiring.Signature({"valid": Out(1), "payload": Out(result)})),
                "done": Out(ports.done),
                "best_read": In(wiring.Signature(best_read)),
                "time_read": In(ports.time_read).array(2),
                "hit_read": In(ports.hit_read),
            }
        )

    @property
    def latency(self) -> int:
        """Cycles from a visit's last result to `done`."""
        return 3 + self._ray_time.latency

    @property
    def start_latency(self) -> int:
        """Cycles from `start` to `started`, where no better hit comes in between."""
        return 5 + self._ray_time.latency

    def elaborate(self, platform: object) -> Module:
        m = Module()
        # Without `found` the best t is the ray's t_max, so that the memories are written by results alone.
        found = Signal(self._contexts)
        better = self._compare(m, found)
        self._distance(m, better)

        start, result = self.start.payload, self.result.payload
        for k in range(self._contexts):
            with m.If(better & (result.context == k)):
                m.d.sync += found[k].eq(1)
            with m.If(self.start.valid & (start.context == k)):
                m.d.sync += found[k].eq(0)
        return m

    def _compare(self, m: Module, found: Signal) -> Signal:
        """The result against the best hit, and the read ports of the latter; returns: it is a better one."""
        result = self.result.payload
        m.submodules.nearest = nearest = Ram(32, self._contexts, read_first=True)
        m.submodules.nearest_ahead = nearest_ahead = Ram(32, self._contexts)
        m.submodules.primitives_ahead = primitives_ahead = Ram(32, self._contexts)
        m.submodules.hits = hits = Ram(self.hit_read.hit.shape(), self._contexts)

        # What is the best so far is read ahead. Of the two results in between, which may be the same ray's, the first
        # is written while the RAM is read and passes by it; the second one is seen here.
        better = Signal()
        following = Signal(self._context, reset_less=True)
        t_passing = Signal(32, reset_less=True)
        primitive_passing = Signal(32, reset_less=True)
        passing = Signal()  # the result before this one is the best of the one to come
        again = Signal()  # the next result is compared with this one
        t_best = Signal(32, reset_less=True)
        primitive_best = Signal(32, reset_less=True)
        found_best = Signal()
        m.d.comb += [
            nearest_ahead.r_addr.eq(self.coming.context),
            primitives_ahead.r_addr.eq(self.coming.context),
            again.eq(better & (result.context == following)),
        ]
        m.d.sync += [
            following.eq(self.coming.context),
            passing.eq(better & (result.context == self.coming.context)),
            t_passing.eq(result.data.t),
            primitive_passing.eq(result.primitive),
            found_best.eq(again | found.bit_select(following, 1)),
        ]
        with m.If(again):
            m.d.sync += [t_best.eq(result.data.t), primitive_best.eq(result.primitive)]
        with m.Elif(passing):
            m.d.sync += [t_best.eq(t_passing), primitive_best.eq(primitive_passing)]
        with m.Else():
            m.d.sync += [t_best.eq(nearest_ahead.r_data), primitive_best.eq(primitives_ahead.r_data)]
        order = compare(m, a=result.data.t, b=t_best)
        lower = result.primitive.as_signed() < primitive_best.as_signed()
        hit = self.result.valid & result.tested & result.data.hit
        m.d.comb += better.eq(hit & (~found_best | order["less"] | (order["equal"] & lower)))
        for memory in (nearest, nearest_ahead, primitives_ahead, hits):
            m.d.comb += [memory.w_en.eq(better), memory.w_addr.eq(result.context)]
        m.d.comb += [
            nearest.w_data.eq(result.data.t),
            nearest_ahead.w_data.eq(result.data.t),
            primitives_ahead.w_data.eq(result.primitive),
            hits.w_data.primitive.eq(result.primitive),
        ]
        m.d.comb += [hits.w_data[name].eq(result.data[name]) for name in ("t", "u", "v", "front")]

        self._show_best(m, found, nearest, hits)
        return better

    def _show_best(self, m: Module, found: Signal, nearest: Ram, hits: Ram) -> None:
        """The read ports of the best hit: its t, and all of it."""
        t_found = Signal(reset_less=True)
        with m.If(self.best_read.en):
            m.d.sync += t_found.eq(found.bit_select(self.best_read.context, 1))
        m.d.comb += [
            nearest.r_en.eq(self.best_read.en),
            nearest.r_addr.eq(self.best_read.context),
            self.best_read.found.eq(t_found),
            self.best_read.t.eq(nearest.r_data),
        ]
        hit_found = Signal(reset_less=True)
        m.d.sync += hit_found.eq(found.bit_select(self.hit_read.context, 1))
        m.d.comb += hits.r_addr.eq(self.hit_read.context)
        with m.If(hit_found):
            m.d.comb += self.hit_read.hit.eq(hits.r_data)
        with m.Else():
            m.d.comb += self.hit_read.hit.primitive.eq(-1)

    def _distance(self, m: Module, better: Signal) -> None:
        """The distance of every better t, and of a starting ray's t_max; `done` and `started` come with it."""
        start, result, context = self.start.payload, self.result.payload, self._context
        m.submodules.ray_time = ray_time = self._ray_time
        m.submodules.timed = timed = Ram(self._timed, self._contexts)
        # Starts wait for a cycle without a better hit, each context at most once.
        m.submodules.starting = starting = Queue(context, self._contexts)
        m.d.comb += [
            timed.w_en.eq(self.start.valid),
            timed.w_addr.eq(start.context),
            starting.i.valid.eq(self.start.valid),
            starting.i.payload.eq(start.context),
            starting.o.ready.eq(~better),
            timed.r_addr.eq(Mux(better, result.context, starting.o.payload)),
        ]
        m.d.comb += [timed.w_data[name].eq(start[name]) for name in TIMED]

        # A test of the visit has hit: this one, or the one before it.
        hit = Signal()
        hit_before = Signal()
        m.d.comb += hit.eq(result.any_hit & result.tested & result.data.hit)
        with m.If(self.result.valid):
            m.d.sync += hit_before.eq(~result.last & hit)

        late_layout = data.StructLayout({"changing": context, "done": context, "hit": 1, "error": ERROR_BITS})
        strobes_layout = data.StructLayout({"better": 1, "started": 1, "done": 1})
        late, strobes = Signal(late_layout, name="late0"), Signal(strobes_layout, name="strobes0")
        m.d.comb += [
            late.changing.eq(timed.r_addr),
            late.done.eq(result.context),
            late.hit.eq(hit | hit_before),
            late.error.eq(result.error),
            strobes.better.eq(better),
            strobes.started.eq(starting.o.valid & ~better),
            strobes.done.eq(self.result.valid & result.last),
        ]
        t = Signal(32, reset_less=True)
        is_better = Signal(reset_less=True)
        operands = Signal(ray_time.i.shape(), reset_less=True)
        m.d.sync += [
            t.eq(result.data.t),
            is_better.eq(better),
            operands.t.eq(Mux(is_better, t, timed.r_data.t_max)),
            operands.rate.eq(timed.r_data.rate),
            operands.scale.eq(timed.r_data.scale),
        ]
        m.d.comb += [ray_time.en.eq(1), ray_time.i.eq(operands)]
        for stage in range(1, ray_time.latency + 3):
            late_before, strobes_before = late, strobes
            late = Signal(late_layout, name=f"late{stage}", reset_less=True)
            strobes = Signal(strobes_layout, name=f"strobes{stage}")
            m.d.sync += [late.eq(late_before), strobes.eq(strobes_before)]

        self._show_distance(m, late, strobes)

    def _show_distance(self, m: Module, late: data.View, strobes: data.View) -> None:
        """The read ports of the distance, which has come; what has come with it is told a cycle later."""
        for k, port in enumerate(self.time_read):
            m.submodules[f"times{k}"] = times = Ram(TIME_BITS, self._contexts, read_first=True)
            m.d.comb += [
                times.w_en.eq(strobes.better | strobes.started),
                times.w_addr.eq(late.changing),
                times.w_data.eq(self._ray_time.o.high),
                times.r_addr.eq(port.context),
                port.time.eq(times.r_data),
            ]
        shown = Signal(late.shape(), reset_less=True)
        m.d.sync += [shown.eq(late), self.started.valid.eq(strobes.started), self.done.valid.eq(strobes.done)]
        m.d.comb += [
            self.started.context.eq(shown.changing),
            self.done.context.eq(shown.done),
            self.done.hit.eq(shown.hit),
            self.done.error.eq(shown.error),
        ]

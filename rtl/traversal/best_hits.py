# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Each context's best hit so far, and how far its ray still has to look for a better one."""

from amaranth import Module, Mux, Signal
from amaranth.lib import data, wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import LEAF_RAY, TIME_BITS, TRIANGLE_HIT
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.layouts import layout_of
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
      while `en` is low. Without `found`, `t` means nothing, and `hit` is a miss.
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
        m.submodules.nearest = nearest = Memory(shape=32, depth=self._contexts, init=[])
        m.submodules.primitives = primitives = Memory(shape=32, depth=self._contexts, init=[])
        m.submodules.hits = hits = Memory(shape=self.hit_read.hit.shape(), depth=self._contexts, init=[])

        # What is the best so far is read ahead. Of the two results in between, which may be the same ray's, the first
        # is written while the RAM is read and passes by it; the second one is seen here.
        t_write = nearest.write_port()
        primitive_write = primitives.write_port()
        hit_write = hits.write_port()
        t_read_ahead = nearest.read_port()
        primitive_read_ahead = primitives.read_port()
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
            t_read_ahead.addr.eq(self.coming.context),
            primitive_read_ahead.addr.eq(self.coming.context),
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
            m.d.sync += [t_best.eq(t_read_ahead.data), primitive_best.eq(primitive_read_ahead.data)]
        order = compare(m, a=result.data.t, b=t_best)
        lower = result.primitive.as_signed() < primitive_best.as_signed()
        hit = self.result.valid & result.tested & result.data.hit
        m.d.comb += better.eq(hit & (~found_best | order["less"] | (order["equal"] & lower)))
        for port in (t_write, primitive_write, hit_write):
            m.d.comb += [port.en.eq(better), port.addr.eq(result.context)]
        m.d.comb += [
            t_write.data.eq(result.data.t),
            primitive_write.data.eq(result.primitive),
            hit_write.data.primitive.eq(result.primitive),
        ]
        m.d.comb += [hit_write.data[name].eq(result.data[name]) for name in ("t", "u", "v", "front")]

        t_read = nearest.read_port()
        t_found = Signal(reset_less=True)
        with m.If(self.best_read.en):
            m.d.sync += t_found.eq(found.bit_select(self.best_read.context, 1))
        m.d.comb += [
            t_read.en.eq(self.best_read.en),
            t_read.addr.eq(self.best_read.context),
            self.best_read.found.eq(t_found),
            self.best_read.t.eq(t_read.data),
        ]
        hit_read = hits.read_port()
        hit_found = Signal(reset_less=True)
        m.d.sync += hit_found.eq(found.bit_select(self.hit_read.context, 1))
        m.d.comb += hit_read.addr.eq(self.hit_read.context)
        with m.If(hit_found):
            m.d.comb += self.hit_read.hit.eq(hit_read.data)
        with m.Else():
            m.d.comb += self.hit_read.hit.primitive.eq(-1)
        return better

    def _distance(self, m: Module, better: Signal) -> None:
        """The distance of every better t, and of a starting ray's t_max; `done` and `started` come with it."""
        start, result, context = self.start.payload, self.result.payload, self._context
        m.submodules.ray_time = ray_time = self._ray_time
        m.submodules.timed = timed = Memory(shape=self._timed, depth=self._contexts, init=[])
        m.submodules.times = times = Memory(shape=TIME_BITS, depth=self._contexts, init=[])
        # Starts wait for a cycle without a better hit, each context at most once.
        m.submodules.starting = starting = Queue(context, self._contexts)
        timed_write = timed.write_port()
        timed_read = timed.read_port()
        m.d.comb += [
            timed_write.en.eq(self.start.valid),
            timed_write.addr.eq(start.context),
            starting.i.valid.eq(self.start.valid),
            starting.i.payload.eq(start.context),
            starting.o.ready.eq(~better),
            timed_read.addr.eq(Mux(better, result.context, starting.o.payload)),
        ]
        m.d.comb += [timed_write.data[name].eq(start[name]) for name in TIMED]

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
            late.changing.eq(timed_read.addr),
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
            operands.t.eq(Mux(is_better, t, timed_read.data.t_max)),
            operands.rate.eq(timed_read.data.rate),
            operands.scale.eq(timed_read.data.scale),
        ]
        m.d.comb += [ray_time.en.eq(1), ray_time.i.eq(operands)]
        for stage in range(1, ray_time.latency + 3):
            late_before, strobes_before = late, strobes
            late = Signal(late_layout, name=f"late{stage}", reset_less=True)
            strobes = Signal(strobes_layout, name=f"strobes{stage}")
            m.d.sync += [late.eq(late_before), strobes.eq(strobes_before)]

        time_write = times.write_port()
        m.d.comb += [
            time_write.en.eq(strobes.better | strobes.started),
            time_write.addr.eq(late.changing),
            time_write.data.eq(ray_time.o.high),
        ]
        for port in self.time_read:
            time_read = times.read_port()
            m.d.comb += [time_read.addr.eq(port.context), port.time.eq(time_read.data)]
        shown = Signal(late_layout, reset_less=True)
        m.d.sync += [shown.eq(late), self.started.valid.eq(strobes.started), self.done.valid.eq(strobes.done)]
        m.d.comb += [
            self.started.context.eq(shown.changing),
            self.done.context.eq(shown.done),
            self.done.hit.eq(shown.hit),
            self.done.error.eq(shown.error),
        ]

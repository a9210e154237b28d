"""What comes back from the memory, put together to blocks: the read data channel of `rtl.memory.block_cache`.

The state of a miss is two flip-flops, `wanted` and `marked`. Neither: no read is under way. `wanted`: its block is
awaited; both: as well, and a look has found it so already. `marked` alone: its read was given up, and its number is not
used again until the last of its beats has come, so that no late beat is taken for another read's.
"""

from dataclasses import dataclass

from amaranth import Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.memory import Ram
from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import number_width
from lightloom.rtl.memory.axi import AxiRead, is_error


@dataclass(frozen=True)
class _Step:
    """A beat, or a look at a miss: of which miss, by its number and as a bit each."""

    beat: Signal
    look: Signal
    which: Signal
    chosen: Signal


@dataclass(frozen=True)
class _Outcome:
    """The block is there, or given up; its read is over; it is wrong; the beat's place; whether that was waited for."""

    fills: Signal
    ends: Signal
    wrong: Signal
    lane: Signal
    is_wanted: Signal


class BlockFill(Component):
    """Remembers for every miss which line it fills; takes a beat a cycle, of any misses in any order.

    Ports: `start` says that the burst with the id `miss` is for line `line` (before its first beat comes). `r` is the
    read data channel. One cycle after a beat that is awaited, `write` asks for its `data` to be written to part `lane`
    of line `line`. `filled`: nothing more is awaited for miss `miss`, whose block is then whole or had an `error`.
    `ended`: the last of its beats has come, and its number may be used again.

    A beat with an error response, RLAST on another beat than the block's last, or none on that, and a read that is
    found under way by two of the looks that begin with `tick` make an error. The read is over with a beat that has
    RLAST and is the block's last, or comes later; as a rule `filled` and `ended` come together. Where they do not, no
    beat is taken until `passed`, so that events of a miss stay apart. Beats of which no read is under way are dropped.
    `lost`: all numbers belong to reads that were given up.
    """

    def __init__(self, *, axi: AxiRead, misses: int, line_width: int):
        self.axi, self.misses, self.line_width = axi, misses, line_width
        self.lanes = axi.block_beats
        members = {name: member for name, member in axi.members.items() if name.startswith("r")}
        super().__init__(
            {
                "start": In(1),
                "start_miss": In(number_width(misses)),
                "start_line": In(line_width),
                "tick": In(1),
                "passed": In(1),
                **members,
                "write": Out(1),
                "line": Out(line_width),
                "lane": Out(number_width(self.lanes)),
                "data": Out(axi.data_width),
                "filled": Out(1),
                "ended": Out(1),
                "miss": Out(number_width(misses)),
                "error": Out(1),
                "lost": Out(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        hold = Signal()
        step = self._step(m, hold)
        self._tell(m, step, self._decide(m, step, hold))
        return m

    def _step(self, m: Module, hold: Signal) -> _Step:
        """A step a cycle, but none of a beat while `hold` is high."""
        # A look waits for a cycle without a beat, but not for a second one.
        number = len(self.miss)
        looking = Signal()
        looked = Signal(number)
        yields = Signal()
        beat = Signal()
        look = Signal()
        which = Signal(number)
        chosen = Signal(self.misses)
        m.d.comb += [
            self.rready.eq(~(hold | yields)),
            beat.eq(self.rvalid & self.rready),
            look.eq(looking & ~beat & ~hold),
            which.eq(Mux(look, looked, self.rid)),
            chosen.eq(Mux(look | (self.rid[number:] == 0), Const(1, self.misses) << which, 0)),
        ]
        m.d.sync += yields.eq(looking & beat)
        with m.If(look):
            m.d.sync += looked.eq(looked + 1)
            with m.If(looked == self.misses - 1):
                m.d.sync += [looked.eq(0), looking.eq(0)]
        with m.If(self.tick):
            m.d.sync += looking.eq(1)
        return _Step(beat, look, which, chosen)

    def _decide(self, m: Module, step: _Step, hold: Signal) -> _Outcome:
        """What a step means, and what is known of misses."""
        beat, look, chosen = step.beat, step.look, step.chosen
        wanted = Signal(self.misses)
        marked = Signal(self.misses)
        failed = Signal(self.misses)  # wanted, and a beat before was an error
        place = [Signal(self.misses, name=f"place{k}") for k in range((self.lanes - 1).bit_length())]

        def of_chosen(vector: Value, name: str) -> Signal:
            result = Signal(name=name)
            m.d.comb += result.eq((vector & chosen).any())
            return result

        is_wanted, is_marked = of_chosen(wanted, "is_wanted"), of_chosen(marked, "is_marked")
        lane = Signal(len(self.lane))
        at_end = Signal()
        over = Signal()
        odd = Signal()
        gives_up = Signal()
        fills = Signal()
        ends = Signal()
        wrong = Signal()
        has_failed = of_chosen(failed, "has_failed") if self.lanes > 1 else Const(0)
        for k, plane in enumerate(place):
            m.d.comb += lane[k].eq(of_chosen(plane, f"is_place{k}"))
        m.d.comb += [
            at_end.eq(lane == self.lanes - 1),
            over.eq(beat & at_end & self.rlast),
            odd.eq(beat & is_wanted & (at_end ^ self.rlast)),
            gives_up.eq(odd | (look & is_wanted & is_marked)),
            fills.eq(gives_up | (over & is_wanted)),
            ends.eq(over & (is_wanted | is_marked)),
            wrong.eq(gives_up | is_error(self.rresp) | has_failed),
        ]

        def if_chosen(condition: Value) -> Value:
            return chosen & condition.replicate(self.misses)

        started = Signal(self.misses)
        m.d.comb += started.eq(Mux(self.start, Const(1, self.misses) << self.start_miss, 0))
        m.d.sync += [
            wanted.eq(wanted & ~if_chosen(fills) | started),
            marked.eq((marked | if_chosen((look & is_wanted) | odd)) & ~if_chosen(ends)),
            self.lost.eq((marked & ~wanted).all()),
            hold.eq(hold & ~self.passed | (fills & ~ends)),
        ]
        if self.lanes > 1:
            m.d.sync += failed.eq(failed & ~if_chosen(fills) | if_chosen(beat & is_wanted & ~fills & wrong))
        # The number of the next beat: beats beyond the block's last are as that, and with the read's end it is 0 again.
        counts = beat & (is_wanted | is_marked) & ~at_end
        for plane, now, after in zip(place, lane, lane + 1, strict=False):
            m.d.sync += plane.eq((plane ^ if_chosen(counts & (now ^ after))) & ~if_chosen(ends))
        return _Outcome(fills, ends, wrong, lane, is_wanted)

    def _tell(self, m: Module, step: _Step, outcome: _Outcome) -> None:
        """That, a cycle later."""
        beat, look, which, lane = step.beat, step.look, step.which, outcome.lane
        m.submodules.lines = lines = Ram(self.line_width, max(self.misses, 2))
        moves = beat | look
        m.d.comb += [
            lines.w_en.eq(self.start),
            lines.w_addr.eq(self.start_miss),
            lines.w_data.eq(self.start_line),
            lines.r_en.eq(moves),
            lines.r_addr.eq(which),
            self.line.eq(lines.r_data),
            self.lane.eq(register(m, beat, lane, "beat_lane")),
            self.data.eq(register(m, beat, self.rdata, "beat")),
            self.miss.eq(register(m, moves, which, "step_miss")),
            self.error.eq(register(m, moves, outcome.wrong, "step_wrong")),
        ]
        m.d.sync += [
            self.write.eq(beat & outcome.is_wanted),
            self.filled.eq(outcome.fills),
            self.ended.eq(outcome.ends),
        ]

"""What every fixed-latency unit is made of: a core that computes, and a stream wrapper around it.

A `Core` is a datapath whose registers all advance together when `en` is high. Cores are built from steps
(`StepCore`) or from other cores (`rtl.fabric.dataflow`). `StreamUnit` gives a core a valid/ready stream on both sides
and carries a tag with each operation.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.interfaces import Unit
from lightloom.rtl.fabric.float_format import FLOAT32, FloatFormat
from lightloom.rtl.fabric.layouts import layout_of
from lightloom.rtl.fabric.one_hot import any_of
from lightloom.rtl.fabric.unit import UnitComponent

Step = Callable[..., Mapping[str, Any]]

INTERVALS = range(1, 33)
"""Cycles from one operation of a core to the next."""


class Core(wiring.Component):
    """A pipelined datapath of fixed latency that accepts an operation every `interval` cycles, 1 to 32.

    Ports: `en` (all registers advance), `i` (operands), `o` (results, `latency` enabled cycles later). Data has no
    reset: validity is kept by whoever uses the core. With an interval of more than 1 also `phase`, which goes round
    with the enabled cycles: bit k is high in slot k, and none in the last slot. Operands are taken in slot 0, and as
    long as operations are under way, slots follow each other. Floating-point fields have the width of `format`.
    """

    def __init__(self, unit: Unit, latency: int, format: FloatFormat = FLOAT32, *, interval: int = 1):
        self.unit = unit
        if interval not in INTERVALS:
            raise ValueError(f"{self.unit.name}: interval must be 1 to {INTERVALS[-1]}, not {interval}")
        self.latency = latency
        self.format = format
        self.initiation_interval = interval
        i, o = (layout_of(dtype, format.width) for dtype in (self.unit.input, self.unit.output))
        ports = {"en": In(1), "i": In(i), "o": Out(o)}
        super().__init__(ports | ({"phase": In(interval - 1)} if interval > 1 else {}))


class StepCore(Core):
    """A core whose function is a chain of combinational steps with `depth` register stages spread among them.

    Subclasses set `declared`, the unit that they are, and return the chain from `steps()`, each step with its delay in
    levels of gates, as measured for float32. A step is called with the module, the number format and the values that
    the step before returned, by name, and returns the values that the next one needs; the first gets the input's
    fields, the last returns the output's. A register stage may stand after any step; they stand where the longest delay
    between two of them is least.
    """

    declared: Unit

    def __init__(self, depth: int, format: FloatFormat = FLOAT32):
        count = len(self.steps(format))
        if not 0 <= depth <= count:
            raise ValueError(f"{self.declared.name}: depth must be 0 to {count}, not {depth}")
        super().__init__(self.declared, depth, format)

    @classmethod
    def steps(cls, format: FloatFormat) -> list[tuple[Step, int]]:
        raise NotImplementedError

    def chain(self) -> list[tuple[Step, int]]:
        """The steps of this core; one with more parameters than a format says which."""
        return self.steps(self.format)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        steps = self.chain()
        cuts = balanced_cuts([delay for _, delay in steps], self.latency)
        values: Mapping[str, Any] = {name: getattr(self.i, name) for name in self.unit.input.names or ()}
        for index, (step, _) in enumerate(steps):
            values = step(m, self.format, **values)
            if index in cuts:
                values = {name: register(m, self.en, value, f"s{index}_{name}") for name, value in values.items()}
            else:
                values = {name: named(m, value, f"s{index}_{name}") for name, value in values.items()}
        for name in self.unit.output.names or ():
            m.d.comb += getattr(self.o, name).eq(values[name])
        return m


def balanced_cuts(delays: Sequence[int], depth: int) -> set[int]:
    """The steps after which a register stage stands: `depth` of them, the last step's among them.

    The longest delay between two of them is least, counting what precedes the first.
    """
    limit = max(delays)
    while len(cuts := _cuts_within(delays, limit)) > max(depth, 1):
        limit += 1
    spare = (index for index in range(len(delays)) if index not in cuts)  # where fewer stages do as well
    while len(cuts) < depth:
        cuts.add(next(spare))
    return cuts if depth else set()


def _cuts_within(delays: Sequence[int], limit: int) -> set[int]:
    """As few cuts as leave no more than `limit` between two of them; each as late as it can be."""
    cuts, delay = {len(delays) - 1}, 0
    for index, step in enumerate(delays):
        if delay + step > limit:
            cuts.add(index - 1)
            delay = 0
        delay += step
    return cuts


def register(m: Module, en: Value, value: Any, name: str) -> Signal:
    """`value` one enabled cycle later; data registers have no reset, so that flows may use plain flip-flops."""
    value = Value.cast(value)
    held = Signal(value.shape(), name=name, reset_less=True)
    with m.If(en):
        m.d.sync += held.eq(value)
    return held


def named(m: Module, value: Any, name: str) -> Value:
    """`value` as a signal: an expression that is used in many places is then written, and elaborated, once."""
    value = Value.cast(value)
    if isinstance(value, Signal | Const):
        return value
    wire = Signal(value.shape(), name=name)
    m.d.comb += wire.eq(value)
    return wire


def slots_of(phase: Value) -> list[Value]:
    """Of each slot, whether it is this one: `phase` has a bit for each but the last."""
    return [*phase, ~any_of(phase)] if len(phase) else [Const(1)]


def in_slot(slots: Sequence[Value], time: int, value: Value) -> Value:
    """`value` in the slot that `time` falls into, 0 in the others."""
    return value & slots[time % len(slots)] if len(slots) > 1 else value


class StreamUnit(UnitComponent):
    """A core between two streams, with a tag that travels with each operation; results keep the operands' order.

    The whole pipeline stops while a result waits at the output and `o.ready` is low, and moves otherwise. The latency
    is the core's. `i.ready` depends combinationally on `o.ready`, never on `i.valid`.

    With an interval of N cycles, an operation is taken at once where nothing is under way: `i.ready` stays high in an
    empty unit, and nothing goes round in it. Else it is taken N moves of the pipeline after the last one, or 2N, 3N, …:
    all that are under way have to keep out of each other's slots. So `i.ready` is high in every N-th move.
    """

    latency: int
    initiation_interval: int

    def __init__(self, core: Core, tag_width: int):
        self.core = core
        self.latency = core.latency
        # Less than the core's where an operation has left before: the next one then finds the unit empty.
        self.initiation_interval = min(core.initiation_interval, max(core.latency, 1) + 1)
        super().__init__(core.unit, tag_width, float_width=core.format.width)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.core = core = self.core
        interval, latency = core.initiation_interval, self.latency
        advance = Signal()
        taking = Signal()
        phase = Signal(interval - 1, init=interval > 1)
        slots = slots_of(phase)
        m.d.comb += taking.eq(in_slot(slots, 0, advance))
        # From one slot 0 to the next an operation stays in one stage, and its tag too. In its own slot it goes from the
        # last stage to the output, where it is for one move.
        valid: Value = self.i.valid
        tag: Value = self.i.payload.tag
        m.d.comb += [
            core.en.eq(advance),
            core.i.eq(self.i.payload.data),
            self.o.payload.data.eq(core.o),
        ]
        stages = [Signal(name=f"valid{stage}") for stage in range(-(-(latency - 1) // interval))]
        if interval > 1 and stages:
            with m.If(in_slot(slots, latency - 1, advance)):
                m.d.sync += stages[-1].eq(0)
        for held in stages:
            with m.If(taking):
                m.d.sync += held.eq(valid)
            valid = held
        if latency:
            offered = Signal(name=f"valid{len(stages)}")
            with m.If(advance):
                m.d.sync += offered.eq(in_slot(slots, latency - 1, valid))
            valid = offered
        for stage in range(-(-latency // interval)):
            tag = register(m, taking, tag, f"tag{stage}")
        if interval > 1:
            under_way = any_of([in_slot(slots, 0, self.i.valid), *stages])
            m.d.comb += core.phase.eq(phase)
            with m.If(advance):
                m.d.sync += phase.eq(Mux(under_way, Cat(slots[-1], phase[:-1]), 1))
        m.d.comb += [
            self.o.valid.eq(valid),
            self.o.payload.tag.eq(tag),
            advance.eq(~valid | self.o.ready if latency else self.o.ready),
            self.i.ready.eq(taking),
        ]
        return m

# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Composes cores into a larger pipelined datapath, with the delays that line operands up put in automatically.

docs/fabric.md tells how one graph becomes a datapath that takes operands in every cycle, or one that takes them every
so many cycles with a fraction of the cores.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data

from lightloom.golden_model.contract.interfaces import Unit
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.one_hot import any_of, pick
from lightloom.rtl.fabric.pipeline import Core, in_slot, named, register, slots_of
from lightloom.rtl.fabric.schedule import Kind, Schedule


@dataclass(eq=False)
class Node:
    """A value that is there `time` enabled cycles after the operands of its operation entered."""

    value: Any
    time: int
    name: str
    staged: bool = False
    """The value is used through its first register only."""
    delayed: list[Signal] = field(default_factory=list)
    """The value behind 1, 2, … registers, as far as anyone asked: delay lines are shared."""

    @property
    def ready(self) -> int:
        """The first cycle in which the value may be used."""
        return self.time + self.staged


@dataclass(eq=False)
class Placed:
    """A core, and the operations that it does: name and operands by the time at which it is given them."""

    core: Core
    operations: dict[int, tuple[str, Mapping[str, Node | int]]] = field(default_factory=dict)


class Dataflow:
    """Builds one datapath inside a module; all cores and delay lines in it advance with `en`.

    Every operation starts as soon as its last operand is there. Where the datapath takes its operands every `interval`
    cycles, operations share cores, each in a slot of its own, as the `schedule` says; `phase` (see `Core`) counts the
    slots. A shared core's operands are chosen in the cycle before: a register stands between the choice and the core.
    A register of a delay line loads in the slot of its value, and holds it until the next one comes: so a value that is
    used k cycles later takes k / interval registers, rounded up.
    """

    def __init__(self, m: Module, en: Value, phase: Value | None = None, schedule: Schedule | None = None):
        self._m = m
        self._en = en
        self._slots = slots_of(Signal(0) if phase is None else phase)
        self._schedule = schedule or Schedule(1)
        self._placed: dict[tuple[Kind, int], Placed] = {}

    @property
    def interval(self) -> int:
        """Cycles from one operation of the datapath to the next."""
        return self._schedule.interval

    def source(self, value: Any, name: str, time: int = 0) -> Node:
        """An operand of the whole datapath."""
        return Node(value, time, name)

    def at(self, node: Node, time: int) -> Any:
        """The node's value at a later time, through registers."""
        assert time >= node.ready, f"{node.name} is not known before cycle {node.ready}"
        registers = -(-(time - node.time) // self.interval)
        load = in_slot(self._slots, node.time, self._en)
        while len(node.delayed) < registers:
            previous = node.delayed[-1] if node.delayed else node.value
            name = f"{node.name}_d{len(node.delayed) + 1}"
            node.delayed.append(register(self._m, load, previous, name))
        return node.delayed[registers - 1] if registers else node.value

    def _slot(self, time: int) -> Value:
        """Whether this is cycle `time` of an operation, or one any number of intervals from it."""
        return self._slots[time % self.interval]

    def _chosen(self, values: Iterable[tuple[int, Any]]) -> Any:
        """Of values with their times, that of this slot; in a slot that has none, anything."""
        sources: dict[Any, tuple[Any, list[int]]] = {}
        for time, value in values:
            sources.setdefault(value if isinstance(value, int) else id(value), (value, []))[1].append(time)
        found = [value for value, _ in sources.values()]
        if len(found) == 1:
            return found[0]
        slots = [any_of(map(self._slot, times)) for _, times in sources.values()]
        return Mux(slots[0], *found) if len(found) == 2 else pick(slots, found)

    def logic(self, name: str, function: Callable[..., Any], *operands: Node, stage: bool = False) -> Node:
        """Combinational logic over operands brought to the time of the latest, with a register after it if `stage`."""
        time = max(node.ready for node in operands)
        value = Value.cast(function(*(self.at(node, time) for node in operands)))
        result = Signal(value.shape(), name=name)
        self._m.d.comb += result.eq(value)
        return Node(result, time, name, staged=stage)

    def repeated(
        self, name: str, function: Callable[..., Any], state: Node, *others: Node, count: int, at_once: int = 1
    ) -> Node:
        """`function` of the state and other operands, the result being its next state, `count` times.

        Each time takes a cycle, in which it is applied `at_once` times; a register is in front of the first and behind
        the last. A function that makes the state wider adds on top. A piece of logic and the register in front of it do
        as many times as the interval has cycles: the register takes what came before, then what its own logic gave.
        """
        if self.interval == 1:
            for k in range(count):
                state = self.applied(f"{name}{k + 1}", function, state, *others, at_once=at_once, stage=True)
            return state
        time = max(state.time, *(node.ready - 1 for node in others))
        given = self.at(Node(state.value, state.time, state.name), time)
        for k in range(0, count, self.interval):
            times = range(time + 1, time + 1 + min(self.interval, count - k))
            operands = [self._chosen((at, self.at(node, at)) for at in times) for node in others]
            growth = at_once * (len(Value.cast(function(given, *operands))) - len(given))
            held = Signal(len(given) + (len(times) - 1) * growth, name=f"{name}{k}_held", reset_less=True)
            result = self._applied(f"{name}{k}", function, held, *operands, at_once=at_once)
            result = named(self._m, result, f"{name}{k}_next")
            with self._m.If(self._en):
                self._m.d.sync += held.eq(Mux(self._slot(time), given, result))
            given, time = result, times[-1]
        return Node(given, time, f"{name}{count}", staged=True)

    def applied(
        self, name: str, function: Callable[..., Any], state: Node, *others: Node, at_once: int, stage: bool = False
    ) -> Node:
        """As `logic`: `function` of the state and other operands, the result being its next state, `at_once` times."""

        def chain(state: Any, *others: Any) -> Any:
            return self._applied(name, function, state, *others, at_once=at_once)

        return self.logic(name, chain, state, *others, stage=stage)

    def _applied(self, name: str, function: Callable[..., Any], state: Any, *others: Any, at_once: int) -> Any:
        for k in range(1, at_once):
            state = named(self._m, function(state, *others), f"{name}_part{k}")
        return function(state, *others)

    def apply(self, name: str, core: Core, stand_in: Core | None = None, /, **operands: Node | int) -> dict[str, Node]:
        """The results, by field name, of an operation that a core like `core` does; an operand may be a constant.

        `stand_in` is a larger core that gives the same results if the operands that only it has are 0. Where cores like
        it have slots to spare, and a core less is needed if they are used, it does the operation.
        """
        assert core.initiation_interval == 1, f"{core.unit.name} does not take an operation in every cycle"
        ready = max(node.ready for node in operands.values() if isinstance(node, Node))
        place = self._schedule.place(_kind(core), ready, stand_in and _kind(stand_in))
        if place.kind != _kind(core):
            assert stand_in is not None
            zeros: dict[str, Node | int] = dict.fromkeys(stand_in.unit.input.names or (), 0)
            core, operands = stand_in, zeros | operands
        placed = self._placed.setdefault((place.kind, place.number), Placed(core))
        placed.operations[place.time] = (name, operands)
        chosen = self._schedule.shares(place.kind)
        if not chosen:
            self._instantiate(placed)
        results: data.View = placed.core.o
        return {
            field_name: Node(results[field_name], place.time + chosen + core.latency, f"{name}_{field_name}")
            for field_name in core.unit.output.names or ()
        }

    def finish(self) -> None:
        """Has to be called in the end: only then all operations of the shared cores are known."""
        for (kind, _), placed in self._placed.items():
            if self._schedule.shares(kind):
                self._instantiate(placed, chosen=True)

    def _instantiate(self, placed: Placed, chosen: bool = False) -> None:
        """A core as a submodule with the names of its operations, its operands `chosen` in the cycle before."""
        core, operations = placed.core, placed.operations
        together = _together([name for name, _ in operations.values()])
        self._m.submodules[together] = core
        self._m.d.comb += core.en.eq(self._en)
        for field_name in core.unit.input.names or ():
            value = self._chosen((time, self._operand(of[field_name], time)) for time, (_, of) in operations.items())
            if chosen and not isinstance(value, int):
                value = register(self._m, self._en, value, f"{together}_{field_name}")
            self._m.d.comb += core.i[field_name].eq(value)

    def _operand(self, operand: Node | int, time: int) -> Any:
        return self.at(operand, time) if isinstance(operand, Node) else operand


def _kind(core: Core) -> Kind:
    return type(core), core.latency


def _together(names: list[str]) -> str:
    """A name for what does all of these."""
    return "_and_".join(names if len(names) < 3 else (names[0], f"{len(names) - 1}_more"))


class DataflowCore(Core):
    """A core composed of other cores, whose latency follows from its graph.

    Subclasses set `declared`, the unit that they are, and draw the graph in `compute`, which is called when the core is
    made. A vector field of the input or output is a list of nodes, one a component. With an `interval` of more than 1,
    operations share cores, of each kind as few as can do all of them; the graph is the same.
    """

    declared: Unit

    def __init__(self, config: Config, *, interval: int = 1):
        super().__init__(self.declared, latency=0, interval=interval)
        self._graph = Module()
        phase, schedule = (self.phase if interval > 1 else None), Schedule(interval)
        if interval > 1:  # counts the operations
            self._drawn(Dataflow(Module(), self.en, phase, schedule), config)
            schedule = Schedule(interval, schedule)
        flow = Dataflow(self._graph, self.en, phase, schedule)

        results = self._drawn(flow, config)
        scalars = {name: value if isinstance(value, list) else [value] for name, value in results.items()}
        self.latency = max(node.ready for value in scalars.values() for node in value)
        for name, value in scalars.items():
            port = getattr(self.o, name)
            for k, node in enumerate(value):
                target = port[k] if self.unit.output[name].shape else port
                self._graph.d.comb += target.eq(flow.at(node, self.latency))
        flow.finish()

    def _drawn(self, flow: Dataflow, config: Config) -> Mapping[str, Any]:
        """The results of the graph, drawn into `flow`."""

        def nodes(name: str) -> Any:
            port, shape = getattr(self.i, name), self.unit.input[name].shape
            if not shape:
                return flow.source(port, name)
            return [flow.source(port[k], f"{name}{k}") for k in range(shape[0])]

        return self.compute(flow, config, **{name: nodes(name) for name in self.unit.input.names or ()})

    def compute(self, *args: Any, **operands: Any) -> Mapping[str, Any]:
        """(flow, config, operands by field name) to results by field name."""
        raise NotImplementedError

    def elaborate(self, platform: object) -> Module:
        return self._graph

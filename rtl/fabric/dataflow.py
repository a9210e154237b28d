# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Composes cores into a larger pipelined datapath, with the delays that line operands up put in automatically."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.pipeline import Core, named, register

Kind = tuple[type[Core], int]
"""Class and latency of a core: cores of one kind can stand in for each other."""


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
    """A core, and the operations that it does: time, name and operands, by the parity of the time."""

    core: Core
    operations: dict[int, tuple[int, str, dict[str, Node | int]]]


class Dataflow:
    """Builds one datapath inside a module; all cores and delay lines in it advance with `en`.

    Every operation starts as soon as its last operand is there. Where the datapath takes its operands in every other
    cycle only, those in which `phase` is high, two operations of one kind share a core, one in the even cycles, one in
    the odd; an operation that finds no turn free starts a cycle later. `cores` says how many there are of a kind. The
    operands of either are chosen in the cycle before: a register stands between the choice and the core. A delay line
    then needs a register for two cycles only, as each value may stay in it until the next one comes.
    """

    def __init__(self, m: Module, en: Value, phase: Value | None = None, cores: Mapping[Kind, int] | None = None):
        self._m = m
        self._en = en
        self._phase = phase
        self._interval = 1 if phase is None else 2
        self._cores = cores or {}
        self._placed: list[Placed] = []
        self.operations: Counter[Kind] = Counter()
        """How many there are of each kind."""

    def source(self, value: Any, name: str, time: int = 0) -> Node:
        """An operand of the whole datapath."""
        return Node(value, time, name)

    def at(self, node: Node, time: int) -> Any:
        """The node's value at a later time, through registers."""
        assert time >= node.ready, f"{node.name} is not known before cycle {node.ready}"
        registers = -(-(time - node.time) // self._interval)
        while len(node.delayed) < registers:
            previous = node.delayed[-1] if node.delayed else node.value
            name = f"{node.name}_d{len(node.delayed) + 1}"
            node.delayed.append(register(self._m, self._load(node.time), previous, name))
        return node.delayed[registers - 1] if registers else node.value

    def _load(self, time: int) -> Value:
        """The enable of registers that load in this cycle of an operation."""
        return self._en if self._phase is None else self._en & self._even(time)

    def _even(self, time: int) -> Value:
        """Whether this is cycle `time` of an operation, or one an even number of cycles from it."""
        assert self._phase is not None
        return ~self._phase if time % 2 else self._phase

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
        """`function` of the state and other operands, the result being its next state, `count` times: an even number.

        Each time takes a cycle, in which it is applied `at_once` times; a register is in front of the first and behind
        the last. A function that makes the state wider adds on top. Where the datapath takes operands in every other
        cycle, one piece of logic and the register in front of it do two times: the register takes what came before,
        then what its own logic gave.
        """
        if self._phase is None:
            for k in range(count):
                state = self.applied(f"{name}{k + 1}", function, state, *others, at_once=at_once, stage=True)
            return state
        time = max(state.time, *(node.ready - 1 for node in others))
        given = self.at(Node(state.value, state.time, state.name), time)
        for k in range(0, count, 2):
            first = self._even(time)
            operands = [self._at_either(first, node, time + 1) for node in others]
            growth = at_once * (len(Value.cast(function(given, *operands))) - len(given))
            held = Signal(len(given) + growth, name=f"{name}{k}_held", reset_less=True)
            result = self._applied(f"{name}{k}", function, held, *operands, at_once=at_once)
            result = named(self._m, result, f"{name}{k}_next")
            with self._m.If(self._en):
                self._m.d.sync += held.eq(Mux(first, given, result))
            given, time = result, time + 2
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

    def _at_either(self, first: Value, node: Node, time: int) -> Value:
        """The node's value in two cycles, the first of which is `time`; `first` is low in it."""
        one, other = self.at(node, time), self.at(node, time + 1)
        return one if one is other else Mux(first, other, one)

    def apply(self, name: str, core: Core, **operands: Node | int) -> dict[str, Node]:
        """The results, by field name, of an operation that a core like `core` does; an operand may be a constant."""
        placed, time = self._place(core, max(node.ready for node in operands.values() if isinstance(node, Node)))
        placed.operations[time % self._interval] = (time, name, operands)
        if self._phase is None:
            self._instantiate(placed)
        results: data.View = placed.core.o
        choice = self._interval - 1  # cycles that the choice of operands takes
        return {
            field_name: Node(results[field_name], time + choice + core.latency, f"{name}_{field_name}")
            for field_name in core.unit.output.names or ()
        }

    def _place(self, core: Core, ready: int) -> tuple[Placed, int]:
        """A core with a free turn as soon as there is one, and the time of that turn."""
        kind = (type(core), core.latency)
        self.operations[kind] += 1
        alike = [placed for placed in self._placed if (type(placed.core), placed.core.latency) == kind]
        for time in range(ready, ready + self._interval):
            for placed in alike:
                if time % self._interval not in placed.operations:
                    return placed, time
            if len(alike) < self._cores.get(kind, len(alike) + 1):
                self._placed.append(Placed(core, {}))
                return self._placed[-1], time
        raise AssertionError(f"more operations than {len(alike)} cores of {core.unit.name} can do")

    def _operand(self, operand: Node | int, time: int) -> Any:
        return self.at(operand, time) if isinstance(operand, Node) else operand

    def finish(self) -> None:
        """Has to be called in the end where operations share cores: only then all operations of a core are known."""
        if self._phase is not None:
            for placed in self._placed:
                self._instantiate(placed)

    def _instantiate(self, placed: Placed) -> None:
        """A core as a submodule with the names of its operations."""
        core, operations = placed.core, placed.operations
        together = "_and_".join(name for _, name, _ in operations.values())
        self._m.submodules[together] = core
        self._m.d.comb += core.en.eq(self._en)
        for field_name in core.unit.input.names or ():
            values = {
                turn: self._operand(operands[field_name], time) for turn, (time, _, operands) in operations.items()
            }
            value = next(iter(values.values()))
            if self._phase is not None and not (isinstance(value, int) and set(values.values()) == {value}):
                chosen = Mux(self._phase, values[0], values[1]) if len(values) == 2 else value
                value = register(self._m, self._en, chosen, f"{together}_{field_name}")
            self._m.d.comb += core.i[field_name].eq(value)


class DataflowCore(Core):
    """A core composed of other cores, whose latency follows from its graph.

    Subclasses set `unit_name` and draw the graph in `compute`, which is called when the core is made. A vector field of
    the input or output is a list of nodes, one a component. A subclass with an `initiation_interval` of 2 shares cores,
    of each kind as few as can do all operations.
    """

    unit_name: str

    def __init__(self, config: Config):
        super().__init__(self.unit_name, latency=0)
        self._graph = Module()
        if self.initiation_interval == 1:
            flow = Dataflow(self._graph, self.en)
        else:
            counted = Dataflow(Module(), self.en, self.phase)
            self._drawn(counted, config)
            cores = {kind: -(-count // 2) for kind, count in counted.operations.items()}
            flow = Dataflow(self._graph, self.en, self.phase, cores)

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

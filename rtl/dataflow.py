# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""Composes cores into a larger pipelined datapath, with the delays that line operands up put in automatically."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from amaranth import Module, Signal, Value
from amaranth.lib import data

from rtl.config import Config
from rtl.pipeline import Core, register


@dataclass(eq=False)
class Node:
    """A value that is there `time` enabled cycles after the operands of its operation entered."""

    value: Any
    time: int
    name: str
    delayed: list[Signal] = field(default_factory=list)
    """The value 1, 2, … cycles later, as far as anyone asked: delay lines are shared."""


class Dataflow:
    """Builds one datapath inside a module; all cores and delay lines in it advance with `en`.

    Every operation starts as soon as its last operand is there.
    """

    def __init__(self, m: Module, en: Value):
        self._m = m
        self._en = en

    def source(self, value: Any, name: str, time: int = 0) -> Node:
        """An operand of the whole datapath."""
        return Node(value, time, name)

    def at(self, node: Node, time: int) -> Any:
        """The node's value at a later time, through registers."""
        assert time >= node.time, f"{node.name} is not known before cycle {node.time}"
        while len(node.delayed) < time - node.time:
            previous = node.delayed[-1] if node.delayed else node.value
            count = len(node.delayed) + 1
            node.delayed.append(register(self._m, self._en, previous, f"{node.name}_d{count}"))
        return node.delayed[time - node.time - 1] if time > node.time else node.value

    def logic(self, name: str, function: Callable[..., Any], *operands: Node, stage: bool = False) -> Node:
        """Combinational logic over operands brought to the time of the latest, with a register after it if `stage`."""
        time = max(node.time for node in operands)
        value = Value.cast(function(*(self.at(node, time) for node in operands)))
        result = Signal(value.shape(), name=name)
        self._m.d.comb += result.eq(value)
        node = Node(result, time, name)
        return Node(self.at(node, time + 1), time + 1, name) if stage else node

    def apply(self, name: str, core: Core, **operands: Node | int) -> dict[str, Node]:
        """Instantiates `core` as submodule `name`; an operand may be a constant. Returns its results by field name."""
        self._m.submodules[name] = core
        time = max(node.time for node in operands.values() if isinstance(node, Node))
        self._m.d.comb += core.en.eq(self._en)
        for field_name, node in operands.items():
            value = self.at(node, time) if isinstance(node, Node) else node
            self._m.d.comb += core.i[field_name].eq(value)
        results: data.View = core.o
        return {
            field_name: Node(results[field_name], time + core.latency, f"{name}_{field_name}")
            for field_name in core.unit.output.names or ()
        }


class DataflowCore(Core):
    """A core composed of other cores, whose latency follows from its graph.

    Subclasses set `unit_name` and draw the graph in `compute`, which is called once, when the core is made. A vector
    field of the input or output is a list of nodes, one a component.
    """

    unit_name: str

    def __init__(self, config: Config):
        super().__init__(self.unit_name, latency=0)
        self._graph = Module()
        flow = Dataflow(self._graph, self.en)

        def nodes(name: str) -> Any:
            port, shape = getattr(self.i, name), self.unit.input[name].shape
            if not shape:
                return flow.source(port, name)
            return [flow.source(port[k], f"{name}{k}") for k in range(shape[0])]

        results = self.compute(flow, config, **{name: nodes(name) for name in self.unit.input.names or ()})
        scalars = {name: value if isinstance(value, list) else [value] for name, value in results.items()}
        self.latency = max(node.time for value in scalars.values() for node in value)
        for name, value in scalars.items():
            port = getattr(self.o, name)
            for k, node in enumerate(value):
                target = port[k] if self.unit.output[name].shape else port
                self._graph.d.comb += target.eq(flow.at(node, self.latency))

    def compute(self, *args: Any, **operands: Any) -> Mapping[str, Any]:
        """(flow, config, operands by field name) to results by field name."""
        raise NotImplementedError

    def elaborate(self, platform: object) -> Module:
        return self._graph

"""Composes cores into a larger pipelined datapath, with the delays that line operands up put in automatically."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from amaranth import Module, Signal, Value
from amaranth.lib import data

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
    """Builds one datapath inside a module; all cores and delay lines in it advance with `en`."""

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

# amaranth: UnusedElaboratable=no
# (cores are also made that no graph takes)
"""Cores of small whole numbers, and an interpreter of the graphs that `rtl.fabric.dataflow` draws."""

import random
import re
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import numpy as np
from amaranth import Module, Value

from lightloom.golden_model.contract.formats import bits
from lightloom.golden_model.contract.interfaces import Unit
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import DataflowCore
from lightloom.rtl.fabric.pipeline import Core, register

WIDTH = 8
MASK = (1 << WIDTH) - 1


def record(*names: str) -> np.dtype:
    """Fields of WIDTH bits."""
    return np.dtype([(name, bits(WIDTH)) for name in names])


class Toy(Core):
    """A core that computes modulo 2**WIDTH, with registers behind its logic."""

    operands: ClassVar[str]
    """Their names, each a letter."""
    function: ClassVar[Callable[..., Any]]
    """Of integers, or of Amaranth's values."""

    def __init__(self, latency: int = 1):
        super().__init__(self.unit_of(), latency)

    @classmethod
    def unit_of(cls) -> Unit:
        """The unit that it is."""
        return Unit(
            name=re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower(),
            summary="",
            input=record(*cls.operands),
            output=record("z"),
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        value = Value.cast(self.function(*(self.i[name] for name in self.operands)))[:WIDTH]
        for stage in range(self.latency):
            value = register(m, self.en, value, f"stage{stage}")
        m.d.comb += self.o.z.eq(value)
        return m


class Subtract(Toy):
    operands = "ab"
    function = staticmethod(lambda a, b: a - b)


class Multiply(Toy):
    operands = "ab"
    function = staticmethod(lambda a, b: a * b)


class MultiplySubtract(Toy):
    """Does what Multiply does where c and d are 0."""

    operands = "abcd"
    function = staticmethod(lambda a, b, c, d: a * b - c * d)


TOYS = (Subtract, Multiply, MultiplySubtract)


class Interpreter:
    """Stands for a Dataflow: its nodes are integers, and every operation is done at once."""

    def apply(self, name: str, core: Core, stand_in: Core | None = None, /, **operands: int) -> dict[str, int]:
        assert isinstance(core, Toy)
        z = core.function(**operands) & MASK
        if isinstance(stand_in, Toy):
            assert stand_in.function(**dict.fromkeys(stand_in.operands, 0) | operands) & MASK == z, "no stand-in"
        return {"z": z}

    def logic(self, name: str, function: Callable[..., int], *operands: int, stage: bool = False) -> int:
        return function(*operands)

    def applied(
        self, name: str, function: Callable[..., int], state: int, *others: int, at_once: int, stage: bool = False
    ) -> int:
        for _ in range(at_once):
            state = function(state, *others)
        return state

    def repeated(
        self, name: str, function: Callable[..., int], state: int, *others: int, count: int, at_once: int = 1
    ) -> int:
        return self.applied(name, function, state, *others, at_once=count * at_once)


class Graph:
    """A random graph of toys: operations with and without stand-ins, logic with and without registers, repetitions."""

    def __init__(self, seed: int, inputs: int = 4, size: int = 14):
        rng = random.Random(seed)
        self.inputs = inputs
        self._stands_in = rng.random() < 0.7
        self._latencies = {toy: rng.randint(0, 3) for toy in TOYS}
        self._steps = [self._step(rng, inputs + k) for k in range(size)]
        """What draws each further node, from the flow, the node's name and the nodes before it."""
        used = rng.sample(range(inputs + size - 1), 2)
        self._results = [*used, inputs + size - 1]
        self.unit = Unit(
            name="graph",
            summary="",
            input=np.dtype([("x", bits(WIDTH), (inputs,))]),
            output=np.dtype([("z", bits(WIDTH), (len(self._results),))]),
        )

    def draw(self, flow: Any, nodes: list[Any]) -> list[Any]:
        """The results, drawn into `flow` from the operands."""
        nodes = list(nodes)
        for step in self._steps:
            nodes.append(step(flow, f"n{len(nodes)}", nodes))
        return [nodes[k] for k in self._results]

    def results(self, operands: list[int]) -> list[int]:
        """What the graph makes of integers."""
        return [z & MASK for z in self.draw(Interpreter(), operands)]

    def _step(self, rng: random.Random, known: int) -> Callable[[Any, str, list[Any]], Any]:
        def some() -> int:
            return rng.randrange(max(0, known - 8), known)

        one, other, third = some(), some(), some()
        kind = rng.random()
        if kind < 0.65:
            toy = rng.choice(TOYS)
            chosen = {name: some() if rng.random() < 0.9 else None for name in toy.operands}
            chosen["a"] = one
            constant = rng.randint(0, MASK)
            stand_in = toy is Multiply and self._stands_in

            def apply(flow: Any, name: str, nodes: list[Any]) -> Any:
                operands = {field: constant if k is None else nodes[k] for field, k in chosen.items()}
                other = MultiplySubtract(self._latencies[MultiplySubtract]) if stand_in else None
                return flow.apply(name, toy(self._latencies[toy]), other, **operands)["z"]

            return apply
        if kind < 0.85:
            stage = rng.random() < 0.5
            return lambda flow, name, nodes: flow.logic(
                name, mixed, *(nodes[k] for k in (one, other, third)), stage=stage
            )
        count, at_once, wider = rng.randint(1, 9), rng.randint(1, 2), rng.random() < 0.5

        def repeated(flow: Any, name: str, nodes: list[Any]) -> Any:
            state, *others = (nodes[k] for k in (one, other, third))
            return flow.repeated(name, grown if wider else mixed, state, *others, count=count, at_once=at_once)

        return repeated


def low(value: Any) -> Any:
    """The lowest bits."""
    return value[:WIDTH] if isinstance(value, Value) else value & MASK


def mixed(a: Any, b: Any, c: Any) -> Any:
    """As wide as a toy's operand; the order of the operands matters."""
    return low(3 * a + (b ^ (c << 1)))


def grown(a: Any, b: Any, c: Any) -> Any:
    """A bit wider than `a`."""
    return (a << 1) ^ low(b + c)


class GraphCore(DataflowCore):
    """The hardware of a graph."""

    def __init__(self, graph: Graph, interval: int):
        self._drawing = graph
        self.declared = graph.unit
        super().__init__(Config(), interval=interval)

    def compute(self, flow: Any, config: Config, *, x: list[Any]) -> Mapping[str, Any]:
        return {"z": self._drawing.draw(flow, x)}

"""Whether rays of a traversal unit may run ahead: whether a test would have nothing to do otherwise."""

from amaranth import Module, Mux, Signal
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.traversal.popped_visits import POPS

FEW = 2
"""Visits of nodes that may wait for their turn while others are chosen that may turn out to be needless."""
WINDOW = 8
"""Cycles for which a cycle without a node to test is remembered."""


class RunAhead(Component):
    """Says a cycle later whether visits may be chosen that may turn out to be needless (docs/traversal_unit.md).

    Ports:

    - `backlog`: requests wait in front of a cache, many reads for the memory, or entries for the stacks.
    - `starved`: in this cycle the node test has none to test.
    - `nodes_waiting`: visits of nodes from the stacks that wait for their turn.
    - `allowed`: they may be chosen.
    """

    def __init__(self) -> None:
        super().__init__({"backlog": In(1), "starved": In(1), "nodes_waiting": In(range(POPS + 1)), "allowed": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        remembered = Signal(range(WINDOW + 1))  # for so many cycles more, that the node test was starved
        m.d.sync += [
            remembered.eq(Mux(self.starved, WINDOW, remembered - (remembered != 0))),
            self.allowed.eq(~self.backlog & ((self.nodes_waiting < FEW) | (remembered != 0))),
        ]
        return m

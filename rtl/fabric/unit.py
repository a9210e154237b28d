"""What every unit of the catalogue is: a component with a stream of operands, a stream of results, and other ports."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, ClassVar

from amaranth import Const, Value
from amaranth.lib import stream, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.interfaces import Unit
from lightloom.golden_model.contract.names import OF_PORTS, check_name
from lightloom.rtl.fabric.counters import COUNTER_BITS, Counter
from lightloom.rtl.fabric.layouts import packet_of

STREAM_PORTS = {
    "clk": "clock, rising edge",
    "rst": "synchronous reset, active high: clears what is in the pipeline",
    "i__valid": "operands are offered",
    "i__ready": "operands offered at this rising edge are taken",
    "i__payload": "operands, and their tag in the highest bits",
    "o__valid": "a result is offered, and stays until it is taken",
    "o__ready": "a result offered at this rising edge is taken",
    "o__payload": "the result, and its operands' tag in the highest bits",
}
"""The ports that every unit has, and what they mean."""


class Role(Enum):
    """What software does with a port that is not one of a stream, of the memory or of a bus.

    A port's meaning goes on from the words in brackets; with them it is a sentence.
    """

    CONTROL = "control"
    """It sets it ("Sets the ...")."""
    STROBE = "strobe"
    """It makes it high for one cycle ("Writing 1 ...")."""
    STATUS = "status"
    """It reads it ("Is 1 while ..." of one bit, "Says ..." of more)."""
    COUNTER = "counter"
    """It reads how often something has happened ("Counts ...")."""
    INTERRUPT = "interrupt"
    """It is called by it."""


@dataclass(frozen=True, kw_only=True)
class Port:
    """Such a port, declared where the unit is."""

    width: int = 1
    role: Role
    meaning: str
    values: Mapping[str, int] = field(default_factory=dict)
    """Names of its values, where they have names."""
    tie: int | None = None
    """What an input may be tied to where nothing drives it; None: something has to."""
    reset: int = 0
    """Of a control behind registers: what it is until software sets it."""

    @property
    def member(self) -> wiring.Member:
        """It as a member of a signature."""
        return (In if self.role in (Role.CONTROL, Role.STROBE) else Out)(self.width)


def counter_ports(counters: Iterable[Counter]) -> dict[str, Port]:
    """Ports `count_<name>` for counters."""
    return {f"count_{one.name}": Port(width=COUNTER_BITS, role=Role.COUNTER, meaning=one.meaning) for one in counters}


@dataclass(frozen=True)
class Event:
    """What software may be told of by an interrupt: its name, and what has happened when a level of the unit rises."""

    name: str
    meaning: str
    level: Callable[[Any], Value]


TAKEN = frozenset({"i", "o", "clk", "rst", "m_axi", "s_axi", "unit", "ports", "tag_width"})
"""What no port of a unit may be called: what every unit has, beside the members of `UnitComponent`."""


class UnitComponent(wiring.Component):
    """The hardware of a unit.

    Ports: `i` and `o`, streams of the unit's payloads with a tag; where there is a memory port, `m_axi`; where it is
    behind a bus, `s_axi`; and `ports`. Inside another unit it is a module of its own, written once however many there
    are of it.
    """

    EVENTS: ClassVar[tuple[Event, ...]] = ()
    """Of its ports."""

    latency: int | None = None
    """Cycles from operands to their result, where nothing stalls; None where they depend on more than the unit."""
    initiation_interval: int | None = None
    """Cycles from one operation to the next, None as for `latency`."""

    def __init__(
        self,
        unit: Unit,
        tag_width: int,
        *,
        memory: wiring.Signature | None = None,
        bus: wiring.Signature | None = None,
        ports: Mapping[str, Port] = MappingProxyType({}),
        float_width: int = 32,
    ):
        """Raises ValueError for names of ports that cannot be used."""
        for name in ports:
            check_name(f"unit {unit.name}: port", name, OF_PORTS)
            if name in TAKEN or hasattr(UnitComponent, name):
                raise ValueError(f"unit {unit.name}: port {name}: every unit has something of this name already")
        self.unit = unit
        self.tag_width = tag_width
        self.ports = ports
        super().__init__(
            {
                "i": In(stream.Signature(packet_of(unit.input, tag_width, float_width))),
                "o": Out(stream.Signature(packet_of(unit.output, tag_width, float_width))),
                **({} if memory is None else {"m_axi": Out(memory)}),
                **({} if bus is None else {"s_axi": In(bus)}),
                **{name: port.member for name, port in ports.items()},
            }
        )

    @property
    def forgetting(self) -> Value:
        """Whether operations that are under way are being dropped."""
        return Const(0)

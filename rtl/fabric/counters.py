"""Counters of events: declared beside what happens, counted in one place of a unit."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from amaranth import Module, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

COUNTER_BITS = 48


@dataclass(frozen=True)
class Counter:
    """A counter: its name, what it counts, and when, a signal of the component that declares it."""

    name: str
    meaning: str
    event: Callable[[Any], Value]


def within(part: Callable[[Any], Any], counters: Iterable[Counter], what: str = "") -> list[Counter]:
    """The counters of a part as those of the whole, of which `part` gives the part.

    `what` says which part it is, where there are several of a kind: its first word begins the names of the counters.
    """
    prefix, which = (f"{what.split()[0]}_", f"{what}: ") if what else ("", "")

    def inside(one: Counter) -> Counter:
        return Counter(prefix + one.name, which + one.meaning, lambda whole: one.event(part(whole)))

    return [inside(one) for one in counters]


class Counters(wiring.Component):
    """Counters of COUNTER_BITS bits, which wrap around.

    Ports: `event_<name>`, one more of it in this cycle; `clear`, all become 0; `count_<name>`. Events come late in a
    cycle, so they are counted, and counters cleared, in the next.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        super().__init__(
            {
                "clear": In(1),
                **{f"event_{name}": In(1) for name in self.names},
                **{f"count_{name}": Out(COUNTER_BITS) for name in self.names},
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        clear = Signal()
        m.d.sync += clear.eq(self.clear)
        for name in self.names:
            count, event = getattr(self, f"count_{name}"), Signal(name=f"was_{name}")
            m.d.sync += event.eq(getattr(self, f"event_{name}"))
            with m.If(clear):
                m.d.sync += count.eq(0)
            with m.Elif(event):
                m.d.sync += count.eq(count + 1)
        return m

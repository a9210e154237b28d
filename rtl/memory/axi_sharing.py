"""What the arbiters of AXI4 ports share: addresses of several masters in turn, and answers to whom their ids name."""

from typing import Any

from amaranth import Cat, Module, Mux, Signal, Value

from lightloom.rtl.fabric.one_hot import any_of, next_of, number_of
from lightloom.rtl.fabric.queues import Buffer


def addresses_in_turn(m: Module, arbiter: Any, channel: str, asks: Value, addresses: Buffer) -> Signal:
    """Addresses through a buffer to the port, in turn among the masters that `asks` names, a bit each.

    The id at the port is the master's with the master's number above it. Returns who is taken from, a bit each, when
    the buffer takes something.
    """
    port, masters = arbiter.m_axi, arbiter.masters
    names = [name for name, _ in port.signature.payload(channel)]
    m.d.comb += addresses.i.valid.eq(asks.any())
    chosen = next_of(m, "asker", asks, addresses.i.valid & addresses.i.ready)
    for name in sorted(names, key=f"{channel}id".__eq__):  # the id last
        each = [Mux(chosen[k], getattr(master, name), 0) for k, master in enumerate(masters)]
        whole = Cat(any_of(each), number_of(chosen)) if name == f"{channel}id" else any_of(each)
        m.d.comb += addresses.i.payload[name].eq(whole)
    for k, master in enumerate(masters):
        m.d.comb += getattr(master, f"{channel}ready").eq(chosen[k] & addresses.i.ready)
    to_port(m, port, channel, addresses)
    return chosen


def to_port(m: Module, port: Any, channel: str, buffer: Buffer) -> None:
    """What a buffer offers is what a channel of the port offers."""
    m.d.comb += [
        getattr(port, f"{channel}valid").eq(buffer.o.valid),
        buffer.o.ready.eq(getattr(port, f"{channel}ready")),
    ]
    m.d.comb += [getattr(port, name).eq(buffer.o.payload[name]) for name, _ in port.signature.payload(channel)]


def answers_to_masters(m: Module, arbiter: Any, channel: str, answers: Buffer) -> None:
    """Answers through a buffer to the masters that the numbers in their ids name; taken and dropped, if they name none.

    A master that does not take its answer holds up the others'.
    """
    port, masters = arbiter.m_axi, arbiter.masters
    names = [name for name, _ in port.signature.payload(channel)]
    number = getattr(port, f"{channel}id")[len(getattr(masters[0], f"{channel}id")) :]
    somebody = number < len(masters)
    m.d.comb += [
        answers.i.valid.eq(getattr(port, f"{channel}valid") & somebody),
        getattr(port, f"{channel}ready").eq(answers.i.ready),
    ]
    m.d.comb += [answers.i.payload[name].eq(getattr(port, name)) for name in names]
    ready = []
    for k, master in enumerate(masters):
        mine = Signal(name=f"mine{k}")
        answer = {name: answers.o.payload[name][: len(getattr(master, name))] for name in names}
        number = answers.o.payload[f"{channel}id"][len(answer[f"{channel}id"]) :]
        m.d.comb += [
            mine.eq(number == k if len(number) else 1),
            getattr(master, f"{channel}valid").eq(answers.o.valid & mine),
        ]
        m.d.comb += [getattr(master, name).eq(value) for name, value in answer.items()]
        ready.append(mine & getattr(master, f"{channel}ready"))
    m.d.comb += answers.o.ready.eq(any_of(ready))

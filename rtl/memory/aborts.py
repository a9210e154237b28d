"""When an abort of a memory port is over."""

from collections.abc import Iterable
from typing import Any

from amaranth import Module, Mux, Signal, Value
from amaranth.lib.wiring import In, Out

from lightloom.rtl.fabric.one_hot import any_of

ABORT = {"abort": In(1), "tick": In(1), "timed": In(1), "aborting": Out(1)}
"""Ports of whatever ends what is under way at a memory port.

`abort`, a strobe: nothing new begins from the next cycle on. `aborting` is high from then until all that had begun is
over; another `abort` meanwhile only makes it last as long as that is high. `timed` and `tick` say when that is: while
`timed` is low, when all that was asked for has come; while it is high, when from one `tick` to the next nothing was
offered and nothing came, however much has come.
"""


def end_of_abort(m: Module, unit: Any, *, stirs: Iterable[Value], awaited: Value) -> Value:
    """Drives `aborting` of a unit with the ports of ABORT; the result is high when an abort that is under way is over.

    `stirs`: something is offered, by either side. `awaited`: something is offered, which AXI does not let go, or has
    not come that was asked for. Without ticks only that counts; with them only silence: whether a memory that has not
    kept to what it was asked for will do so yet, no count can tell, nor a bit for each id.
    """
    silent = Signal()
    silence = Signal()  # since the last tick
    over = Signal()
    m.d.comb += [
        silent.eq(~any_of((unit.abort, *stirs))),
        over.eq(Mux(unit.timed, unit.tick & silence & silent, ~awaited)),
    ]
    m.d.sync += [
        silence.eq(silent & (silence | unit.tick)),
        unit.aborting.eq(unit.abort | (unit.aborting & ~over)),
    ]
    return unit.aborting & over

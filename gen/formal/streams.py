"""What is true of every stream: payloads wait, and what goes in comes out once, in order, with its tag."""

from typing import Any

from amaranth import Signal, Value

from lightloom.gen.formal.bench import Bench


def held(bench: Bench, name: str, valid: Any, ready: Any, payload: Any) -> None:
    """A transfer that is offered stays, with its payload, until it is taken."""
    payload = Value.cast(payload)
    waits = bench.past(valid & ~ready, f"{name}_waits")
    before = bench.past(payload, f"{name}_payload")
    bench.require(f"{name}_valid_holds", ~waits | valid)
    bench.require(f"{name}_payload_holds", ~waits | (payload == before))


class Tracker:
    """Follows one transfer, any one, from the input to the output of whatever keeps the order.

    Attributes: `count`, how many are inside; `follows`, the followed one is inside; `ahead`, how many are before it;
    `payload`, what it is. Requires: nothing comes out that did not go in; the followed one comes out when all before it
    have, and unchanged. As the solver chooses which one is followed, that holds for all of them: none is lost, made up,
    doubled or overtaken.
    """

    def __init__(self, bench: Bench, *, most: int, enters: Any, incoming: Any, leaves: Any, offers: Any, outgoing: Any):
        """`most`: greatest number inside. `enters`, `leaves`: a transfer happens. `offers`: the output is valid."""
        incoming, outgoing = Value.cast(incoming), Value.cast(outgoing)
        m = bench.m
        self.count = Signal(range(most + 2), name="inside")
        self.follows = Signal(name="follows")
        self.ahead = Signal(range(most + 2), name="ahead")
        self.payload = Signal(len(incoming), name="followed", reset_less=True)
        picks = Signal(name="picks")
        m.d.comb += picks.eq(bench.any("pick") & enters & ~self.follows)
        m.d.sync += self.count.eq(self.count + enters - leaves)
        with m.If(picks):
            m.d.sync += [self.follows.eq(1), self.ahead.eq(self.count - leaves), self.payload.eq(incoming)]
        with m.Elif(self.follows & leaves):
            with m.If(self.ahead == 0):
                m.d.sync += self.follows.eq(0)
            with m.Else():
                m.d.sync += self.ahead.eq(self.ahead - 1)
        self.picks = picks
        """The transfer that goes in becomes the followed one."""
        bench.require("nothing_made_up", ~offers | (self.count != 0))
        bench.require("room", self.count <= most)
        bench.require("in_place", ~self.follows | (self.ahead < self.count))
        bench.require("unchanged", ~(offers & self.follows & (self.ahead == 0)) | (outgoing == self.payload))
        bench.reach("followed_one_leaves", self.follows & leaves & (self.ahead == 0))
        bench.reach("full", self.count == most)


def buffer_invariant(bench: Bench, tracker: Tracker, name: str) -> None:
    """The tracked transfer is in the registers of a buffer, the submodule `name`."""
    second, kept = bench.inner(f"{name}/held"), bench.inner(f"{name}/kept")
    first = bench.inner(f"{name}/o__valid")
    bench.require("count_is_registers", tracker.count == first + second)
    bench.require("first_before_second", first | ~second)
    bench.require("second_is_kept", ~tracker.follows | (tracker.ahead == 0) | (kept == tracker.payload))

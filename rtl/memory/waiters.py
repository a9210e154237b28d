"""Requests that wait for the same block: a list for each miss, without searching (`rtl.memory.block_cache`)."""

from collections.abc import Callable
from dataclasses import dataclass

from amaranth import Module, Mux, Signal, Value
from amaranth.lib import data, stream
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.memory import Ram, RegisterFile
from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import FreeList, PassingQueue, number_width


def waiter(*, line_width: int, tag_width: int) -> data.StructLayout:
    """A request whose block is in a line, or whose read had an error; the `last` one that waits for this line."""
    return data.StructLayout({"line": line_width, "error": 1, "tag": tag_width, "last": 1})


@dataclass(frozen=True)
class _Head:
    """The head of the next list: whether it is known, `taken` when it goes on its way, and what it is."""

    known: Signal
    taken: Signal
    number: Value
    line: Value
    error: Value


class Waiters(Component):
    """Collects requests by the miss that they wait for, and gives those of a miss one a cycle when its block has come.

    A list is linked from its newest request to its oldest, in a RAM of `requests` entries; of each miss only the newest
    is known. Ports:

    - `ready`: there is a free entry. `add` puts a request with `tag` on the list of miss `miss`, whose only one it is
      if `first`.
    - `filled`: the block of miss `filled_miss` is in line `filled_line`, or `filled_error`. A request may be added to
      its list in the same cycle at the latest.
    - `ended`: the read of miss `filled_miss` is over; as a rule with `filled`. Where `filled` comes without it, there
      is no further event until `passed`, so that no more than one of each miss is on its way.
    - `free`, `free_miss`: the miss's number may be used again, which is after both.
    - `o`: stream of `waiter`. It does not wait for anything but `o.ready`.
    """

    def __init__(self, *, misses: int, requests: int, tag_width: int, line_width: int):
        self.misses, self.requests = misses, requests
        self.miss_width, self.number_width = number_width(misses), number_width(requests)
        self.tag_width, self.line_width = tag_width, line_width
        super().__init__(
            {
                "ready": Out(1),
                "add": In(1),
                "miss": In(self.miss_width),
                "tag": In(tag_width),
                "first": In(1),
                "filled": In(1),
                "ended": In(1),
                "passed": Out(1),
                "filled_miss": In(self.miss_width),
                "filled_line": In(line_width),
                "filled_error": In(1),
                "free": Out(1),
                "free_miss": Out(self.miss_width),
                "o": Out(stream.Signature(waiter(line_width=line_width, tag_width=tag_width))),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.numbers = numbers = FreeList(self.requests)
        entry = data.StructLayout({"tag": self.tag_width, "older": self.number_width, "last": 1})
        m.submodules.entries = entries = Ram(entry, max(self.requests, 2))
        m.submodules.newest = newest = RegisterFile(self.number_width, max(self.misses, 2), reads=2)

        newest_number = self._add(m, numbers, entries, newest)
        head = self._begin(m, newest, newest_number)
        self._walk(m, numbers, entries, head)
        return m

    def _add(self, m: Module, numbers: FreeList, entries: Ram, newest: RegisterFile) -> Callable[[Value, Value], Value]:
        """New requests to the lists. Returns what the newest number of a miss is, by the miss and what was read."""
        # Adding takes two cycles, so that the number of the miss, which comes late, has one for the look at the list.
        added = Signal()
        m.d.comb += [self.ready.eq(numbers.o.valid), numbers.o.ready.eq(self.add)]
        m.d.sync += added.eq(self.add)
        miss = register(m, self.add, self.miss, "miss_d1")
        number = register(m, self.add, numbers.o.payload, "number_d1")
        asked, before = newest.read(0)
        link: data.View = entries.w_data
        m.d.comb += [
            asked.eq(miss),
            newest.w_en.eq(added),
            newest.w_addr.eq(miss),
            newest.w_data.eq(number),
            entries.w_en.eq(added),
            entries.w_addr.eq(number),
            link.tag.eq(register(m, self.add, self.tag, "tag_d1")),
            link.older.eq(before),
            link.last.eq(register(m, self.add, self.first, "first_d1")),
        ]

        def newest_number(of: Value, read: Value) -> Value:
            """What was added a cycle ago is not to be read yet."""
            return Mux(added & (miss == of), number, read)

        return newest_number

    def _begin(self, m: Module, newest: RegisterFile, newest_number: Callable[[Value, Value], Value]) -> _Head:
        """The head of the next list."""
        # The lists whose block has come, in that order. One may be here a cycle after `filled`, and what was added with
        # that is then on its way to the list: it is the newest.
        done = data.StructLayout({"miss": self.miss_width, "line": self.line_width, "error": 1, "list": 1, "ended": 1})
        m.submodules.lists = lists = PassingQueue(done, self.misses)
        asked, head = newest.read(1)
        begin = Signal()
        taken = Signal()
        load = Signal()
        next_list = lists.o.payload
        m.d.comb += [
            lists.i.valid.eq(self.filled | self.ended),
            lists.i.payload.list.eq(self.filled),
            lists.i.payload.ended.eq(self.ended),
            lists.i.payload.miss.eq(self.filled_miss),
            lists.i.payload.line.eq(self.filled_line),
            lists.i.payload.error.eq(self.filled_error),
            lists.o.ready.eq(~begin | taken),
            load.eq(lists.o.valid & lists.o.ready),
            asked.eq(next_list.miss),
            self.free.eq(load & next_list.ended),
            self.passed.eq(load & ~next_list.ended),
            self.free_miss.eq(next_list.miss),
        ]
        with m.If(lists.o.ready):
            m.d.sync += begin.eq(lists.o.valid & next_list.list)
        head_number = newest_number(next_list.miss, head)
        begin_number = register(m, load, head_number, "begin_number")
        begin_line = register(m, load, next_list.line, "begin_line")
        begin_error = register(m, load, next_list.error, "begin_error")
        return _Head(begin, taken, begin_number, begin_line, begin_error)

    def _walk(self, m: Module, numbers: FreeList, entries: Ram, head: _Head) -> None:
        """Answers along a list."""
        # Along a list: the RAM's output is the request that is answered, and names the one after it.
        walked: data.View = entries.r_data
        ends = Signal()
        moves = Signal()
        following = Signal(self.number_width)
        m.d.comb += [
            moves.eq(~self.o.valid | self.o.ready),
            ends.eq(~self.o.valid | walked.last),
            head.taken.eq(head.known & moves & ends),
            following.eq(walked.older),
            entries.r_en.eq(moves),
            entries.r_addr.eq(following),
        ]
        with m.If(ends):
            m.d.comb += following.eq(head.number)
        with m.If(moves):
            m.d.sync += self.o.valid.eq(~ends | head.known)
        m.d.comb += [
            self.o.payload.line.eq(register(m, head.taken, head.line, "line")),
            self.o.payload.error.eq(register(m, head.taken, head.error, "error")),
            self.o.payload.tag.eq(walked.tag),
            self.o.payload.last.eq(walked.last),
            numbers.i.valid.eq(self.o.valid & self.o.ready),
            numbers.i.payload.eq(register(m, moves, following, "walked")),
        ]

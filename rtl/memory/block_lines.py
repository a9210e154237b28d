"""Which block is in which line of a cache, and which line is given to the next (`rtl.memory.block_cache`).

The state of a line is four flip-flops: `present` (its label counts), `pending` (its data is awaited), `locked`
(requests wait for it or are being answered: it must stay) and `used` (it was hit since it came). The labels are in
RAMs, one a way.
"""

from dataclasses import dataclass

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import data
from amaranth.lib.wiring import Component, In, Out

from lightloom.rtl.fabric.memory import Ram, write_first
from lightloom.rtl.fabric.one_hot import any_of, lowest, number_of
from lightloom.rtl.fabric.pipeline import register
from lightloom.rtl.fabric.queues import number_width

BLOCK_NUMBER_BITS = 32
RANDOM_BITS, RANDOM_TAPS = 16, 0b1011_0100_0000_0000
"""A Galois shift register of 16 bits and greatest period; the taps are those of x^16 + x^14 + x^13 + x^11 + 1."""


@dataclass(frozen=True)
class _LookedUp:
    """A block: its number without the set's bits, its set, as a number and as a mask; and those of the next block."""

    name: Signal
    row: Signal
    mask: Signal
    read_name: Signal
    read_row: Signal


@dataclass(frozen=True)
class _States:
    """What is known of the lines: a vector over the sets for each way."""

    present: list[Signal]
    pending: list[Signal]
    locked: list[Signal]
    used: list[Signal]


@dataclass(frozen=True)
class _Here:
    """Of the set that is looked up, a bit a way: it has the block; it holds any; it may not go; it was used."""

    match: Signal
    present: Signal
    locked: Signal
    used: Signal


class BlockLines(Component):
    """Looks up a block a cycle, in two steps.

    Ports: `look` takes up `block`, whose labels are read; `step` takes it on, and from the next cycle, until the next
    `step`, the outputs describe that block by the state of the lines in each cycle. `found`: it is in line `line`, or,
    if `awaited`, on the way there as miss `miss`. Otherwise `available` says whether a line may be given to it,
    `victim` which one, `evicts` that another block is there.

    What happens to the block that the outputs describe: `touch` marks its line as used, `allocate` gives it the line
    `victim` as miss `allocate_miss`; then `step` is high, too. What happens to any line: `filled` (with `filled_error`:
    its block is not there after all), `release` (nobody waits for it any more). `invalidate` forgets all blocks.
    """

    def __init__(self, *, sets: int, ways: int, misses: int):
        self.sets, self.ways, self.misses = sets, ways, misses
        self.line_width = number_width(sets * ways)
        self.set_bits = (sets - 1).bit_length()
        line, miss = self.line_width, number_width(misses)
        super().__init__(
            {
                "look": In(1),
                "step": In(1),
                "block": In(BLOCK_NUMBER_BITS),
                "found": Out(1),
                "line": Out(line),
                "awaited": Out(1),
                "miss": Out(miss),
                "available": Out(1),
                "victim": Out(line),
                "evicts": Out(1),
                "touch": In(1),
                "allocate": In(1),
                "allocate_miss": In(miss),
                "filled": In(1),
                "filled_line": In(line),
                "filled_error": In(1),
                "release": In(1),
                "release_line": In(line),
                "invalidate": In(1),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        at = self._looked_up(m)
        chosen = Signal(self.ways)  # the way of the victim
        same, misses = self._labels(m, at, chosen)
        vectors = (
            [Signal(self.sets, name=f"{state}{way}") for way in range(self.ways)]
            for state in ("present", "pending", "locked", "used")
        )
        states = _States(*vectors)
        here = self._found(m, at, states, same, misses)
        all_used = Signal()
        self._victim(m, at.row, here, chosen, all_used)
        self._change(m, at, states, here.match, chosen, all_used)
        return m

    def _looked_up(self, m: Module) -> _LookedUp:
        """The block that is looked up, and the one behind it, of which the labels are being read."""
        read_name = register(m, self.look, self.block[self.set_bits :], "read_name")
        read_row = register(m, self.look, set_of(self.block, self.set_bits), "read_row")
        name, row = register(m, self.step, read_name, "name"), register(m, self.step, read_row, "row")
        mask = register(m, self.step, (Const(1) << read_row)[: self.sets], "at")
        return _LookedUp(name, row, mask, read_name, read_row)

    def _labels(self, m: Module, at: _LookedUp, chosen: Signal) -> tuple[Signal, list[Signal]]:
        """Whether each way's label is the block's, and the misses in them.

        A label is the block's number above the set's bits, which follow from it, and the miss that it is or was.
        """
        name, row, read_name, read_row = at.name, at.row, at.read_name, at.read_row
        label = data.StructLayout({"name": len(name), "miss": len(self.miss)})
        # A label that is written while the next block's labels are there replaces the one that was read.
        same_row = Signal()
        same_name = Signal()
        m.d.comb += [same_row.eq(read_row == row), same_name.eq(read_name == name)]
        same = Signal(self.ways)
        awaited_misses = []
        for way in range(self.ways):
            m.submodules[f"labels{way}"] = labels = Ram(label, self.sets)
            m.d.comb += [
                labels.w_en.eq(self.allocate & chosen[way]),
                labels.w_addr.eq(row),
                labels.w_data.name.eq(name),
                labels.w_data.miss.eq(self.allocate_miss),
                labels.r_en.eq(self.look),
                labels.r_addr.eq(set_of(self.block, self.set_bits)),
            ]
            read = write_first(m, labels, f"read_label{way}")
            replaced = Signal(name=f"replaced{way}")
            m.d.comb += replaced.eq(labels.w_en & same_row)
            with m.If(self.step):
                m.d.sync += same[way].eq(Mux(replaced, same_name, read.name == read_name))
            miss = Mux(replaced, self.allocate_miss, read.miss)
            awaited_misses.append(register(m, self.step, miss, f"miss{way}"))
        return same, awaited_misses

    def _found(self, m: Module, at: _LookedUp, states: _States, same: Signal, misses: list[Signal]) -> _Here:
        """What is known of the block, and of the lines that it may be in."""

        def here(kind: str, vectors: list[Signal]) -> Signal:
            """The bits of the set that is looked up, one a way."""
            bits = Signal(self.ways, name=kind)
            m.d.comb += bits.eq(Cat((vector & at.mask).any() for vector in vectors))
            return bits

        match = Signal(self.ways)
        is_present, is_locked, is_used = (
            here("is_present", states.present),
            here("is_locked", states.locked),
            here("is_used", states.used),
        )
        m.d.comb += [
            match.eq(is_present & same),
            self.found.eq(match.any()),
            self.awaited.eq((match & here("is_pending", states.pending)).any()),
            self.line.eq(Cat(at.row, number_of(match))),
            self.miss.eq(any_of(Mux(match[way], misses[way], 0) for way in range(self.ways))),
        ]
        return _Here(match, is_present, is_locked, is_used)

    def _victim(self, m: Module, row: Signal, here: _Here, chosen: Signal, all_used: Signal) -> None:
        """Of the lines that may go and were not used, the first from a random one on."""
        random = Signal(RANDOM_BITS, init=1)
        m.d.sync += random.eq((random >> 1) ^ Mux(random[0], RANDOM_TAPS, 0))
        start = Signal(range(max(self.ways, 2)))
        m.d.comb += start.eq((random[:8] * self.ways) >> 8)
        from_start = Signal(self.ways)
        m.d.sync += from_start.eq(Const((1 << self.ways) - 1, self.ways) << start)
        unused = Signal(self.ways)
        candidates = Signal(self.ways)
        later = Signal(self.ways)
        m.d.comb += [
            self.available.eq(~here.locked.all()),
            unused.eq(~here.locked & ~here.used),
            all_used.eq(~unused.any()),
            candidates.eq(Mux(all_used, ~here.locked, unused)),
            later.eq(candidates & from_start),
            chosen.eq(Mux(later.any(), lowest(m, "later", later), lowest(m, "any", candidates))),
            self.victim.eq(Cat(row, number_of(chosen))),
            self.evicts.eq((chosen & here.present).any()),
        ]

    def _change(
        self, m: Module, at: _LookedUp, states: _States, match: Signal, chosen: Signal, all_used: Signal
    ) -> None:
        """What becomes of lines."""

        def vectors_of(line: Value, valid: Value, name: str) -> list[Value]:
            """The bit of a line, in a vector over the sets for each way."""
            its_row = Signal(self.sets, name=name)
            m.d.comb += its_row.eq(Const(1, self.sets) << line[: self.set_bits])
            return [Mux(valid & (line[self.set_bits :] == way), its_row, 0) for way in range(self.ways)]

        filled = vectors_of(self.filled_line, self.filled, "filled_row")
        released = vectors_of(self.release_line, self.release, "release_row")
        keeps = Signal(self.sets)
        m.d.comb += keeps.eq(Mux(self.invalidate, 0, ~Const(0, self.sets)))
        for way in range(self.ways):
            gone = Mux(self.filled_error, filled[way], 0)
            given, touched, forgotten = (
                Signal(self.sets, name=f"{event}{way}") for event in ("given", "touched", "forgotten")
            )
            m.d.comb += [
                given.eq(Mux(self.allocate & chosen[way], at.mask, 0)),
                touched.eq(Mux(self.touch & match[way], at.mask, 0)),
                forgotten.eq(Mux(self.allocate & (all_used | chosen[way]), at.mask, 0)),
            ]
            m.d.sync += [
                states.present[way].eq((states.present[way] & ~gone | given) & keeps),
                states.pending[way].eq(states.pending[way] & ~filled[way] | given),
                states.locked[way].eq(states.locked[way] & ~released[way] | given),
                states.used[way].eq((states.used[way] & ~forgotten | touched) & keeps),
            ]


def set_of(block: Value, bits: int) -> Value:
    """The set of a block: the exclusive or of all its number's pieces of `bits` bits.

    With the bits above the lowest piece the set gives that piece back, so a label needs only those.
    """
    result = block[:bits]
    for first in range(bits, len(block), bits):
        result = result ^ block[first : first + bits]
    return result

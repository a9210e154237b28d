"""An AXI4 memory for benches, cycle by cycle, in whatever simulator.

It answers late, in any order and mixed, with errors and wrong bursts where it is told to, and stalls all channels. It
watches what only a memory can know; whether the rules of AXI are kept is for the checker to say that stands beside the
port (`rtl.memory.axi_checker`).
"""

import random
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from lightloom.golden_model.contract.axi_rules import rule_of
from lightloom.golden_model.contract.formats import BLOCK_BYTES
from lightloom.verif.bins.coverage import StreamCycles

OKAY, SLVERR, DECERR = 0, 2, 3
READ = ("arready", "rvalid", "rid", "rdata", "rresp", "rlast")
WRITE = ("awready", "wready", "bvalid", "bid", "bresp")
"""What a slave drives."""
AHEAD = 64
"""Beats of data that are taken before their address."""


@dataclass(frozen=True, kw_only=True)
class Manner:
    """How the memory answers."""

    latency: tuple[int, int] = (1, 1)
    """Least and greatest number of cycles to the first answer, of which there is one at least: from a read's address,
    or from the last beat of a write."""
    stall: float = 0.0
    """In what part of the cycles no address and no data is accepted, and in what part no new answer is given."""
    reorder: bool = False
    """Bursts of different ids overtake each other; without, they are answered in their order."""
    interleave: bool = False
    """Beats of different read bursts come mixed."""


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """How a block is answered that is not answered as it was asked for."""

    beats: int
    """So many come, or none. Of a write: 1 for an answer, or 0 for none."""
    last: frozenset[int] = frozenset()
    """Which of them have RLAST, from 0 up."""
    after: int = 0
    """Cycles that the first of them waits longer than another burst's."""


def wrong_ends(beats: int) -> dict[str, tuple[Wrong, bool]]:
    """Ways in which RLAST can be wrong in a block of `beats`: the answer, and whether a beat shows that it is over."""
    whole = frozenset({beats - 1})
    ends = {
        "no RLAST": (Wrong(beats=beats), False),
        "a beat too many": (Wrong(beats=beats + 1, last=whole | {beats}), True),
    }
    for more in (1, 3):
        ends[f"RLAST {more} beats late"] = (Wrong(beats=beats + more, last=frozenset({beats - 1 + more})), True)
    for k in sorted({0, 1, beats // 2, beats - 2} & set(range(beats - 1))):
        ends[f"RLAST on beat {k}"] = (Wrong(beats=beats, last=frozenset({k})), False)
        ends[f"RLAST on beat {k}, too"] = (Wrong(beats=beats, last=whole | {k}), True)
        ends[f"{k + 1} beats"] = (Wrong(beats=k + 1, last=frozenset({k})), False)
    return ends


Content = Callable[[int, int], int | None]
"""Gives so many bytes at an address as a number, or None where nothing is."""


def hashed(address: int, size: int) -> int:
    """The content of a memory of which every aligned 32-bit word is a hash of its address."""
    return sum(((address + k) * 2654435761 & 0xFFFF_FFFF) << (8 * k) for k in range(0, size, 4))


class Regions(dict[int, bytes]):
    """The content of a memory that has bytes from some addresses on, and nothing elsewhere."""

    def __call__(self, address: int, size: int) -> int | None:
        for base, content in self.items():
            if base <= address < base + len(content):
                return int.from_bytes(content[address - base : address - base + size], "little")
        return None


@dataclass(eq=False)
class Burst:
    """A burst that was accepted; `given` beats of it have been, in the end `beats`."""

    id: int
    address: int
    beats: int
    wait: int
    """Cycles to its first answer."""
    last: frozenset[int]
    late: bool
    from_cycle: int | None = None
    """When that may come; of a write, once its data is whole."""
    given: int = 0
    data: list[tuple[int, int]] = field(default_factory=list)
    """Of a write: its beats so far, and their strobes."""
    answered: bool = True


class AxiSlave:
    """Memory whose master reads and writes whole blocks of 64 bytes.

    Where its `content` has nothing the answer is DECERR; if it is `strict`, nobody may ask for that. What was written
    lies over it, from the cycle on in which the write's answer is offered. `errors` are responses by the address of a
    beat, or of a block that is written, which then is not; data that comes with an error is random. Blocks at an
    address in `wrong` are answered as that says.

    `reads`, `asked`: addresses and ids of all reads that were accepted; `beats` of them were taken. `writes`, those
    that were answered: (address, data, strobes, response). `under_way`: bursts that are not over. A master must not
    have two reads of an id under way, the first of which still gets beats.

    To be used in each cycle: `offers` at its beginning, `sees` when all has settled.
    """

    def __init__(self, lanes: int, *, rng: random.Random, content: Content = hashed, strict: bool = False) -> None:
        """`lanes`: bytes of the bus."""
        self.lanes, self.rng, self.content, self.strict = lanes, rng, content, strict
        self.manner = Manner()
        self.errors: dict[int, int] = {}
        self.wrong: dict[int, Wrong] = {}
        self.written: dict[int, int] = {}
        """Byte address to byte."""
        self.reads: list[int] = []
        self.asked: list[int] = []
        self.writes: list[tuple[int, int, int, int]] = []
        self.cycle = self.beats = 0
        self.overtaken = self.mixed = 0
        self.most_under_way = 0
        self.cycles = StreamCycles("addresses", "data")
        self.forget()

    @property
    def bursts(self) -> int:
        """Read bursts that were accepted."""
        return len(self.reads)

    @property
    def under_way(self) -> int:
        return len(self._ids) + len(self._writes)

    def forget(self) -> None:
        """A reset: nothing is under way."""
        self._order: list[Burst] = []  # reads that get beats
        self._engaged: Burst | None = None
        self._ids: set[int] = set()  # of reads that are not over
        self._beat: dict[str, int] | None = None
        self._ends = False
        self._writes: list[Burst] = []  # that are not answered
        self._data: deque[tuple[int, int]] = deque()  # beats without an address
        self._answer: dict[str, int] | None = None
        self.keeps_rules = True
        """It has not answered as `wrong` says."""

    def fails(self, address: int, response: int = SLVERR) -> None:
        """One of the beats of a block that is read gets that response."""
        self.errors[address + self.lanes * self.rng.randrange(BLOCK_BYTES // self.lanes)] = response

    # --- what it does -------------------------------------------------------------------------------------------------

    def offers(self, channels: tuple[str, ...] = READ) -> dict[str, int]:
        """What it drives in this cycle, on the channels that are there."""
        shown: dict[str, int] = {}
        if "arready" in channels:
            if self._beat is None and not self._stalls():
                self._choose_beat()
            shown |= {"arready": int(not self._stalls()), "rvalid": int(self._beat is not None), **(self._beat or {})}
        if "awready" in channels:
            if self._answer is None and not self._stalls():
                self._choose_answer()
            room = len(self._data) < AHEAD
            shown |= {"awready": int(not self._stalls()), "wready": int(room and not self._stalls())}
            shown |= {"bvalid": int(self._answer is not None), **(self._answer or {})}
        return shown

    def _stalls(self) -> bool:
        return self.rng.random() < self.manner.stall

    def _burst(self, identity: int, address: int, beats: int, answer: Wrong) -> Burst:
        least, most = self.manner.latency
        latency = least if least == most else self.rng.randint(least, most)
        return Burst(identity, address, beats, latency + answer.after, answer.last, answer.after > 0)

    def _ready(self, bursts: list[Burst]) -> list[Burst]:
        """Of each id the first burst, if it may be answered now; without `reorder` only the first of all.

        Those that wait longer than they should do not count as that.
        """
        firsts = {burst.id: burst for burst in reversed(bursts)}
        among = [burst for burst in bursts if burst is firsts[burst.id]]
        if not self.manner.reorder:
            inorder = [burst for burst in bursts if not burst.late][:1]
            among = [burst for burst in among if burst.late or burst in inorder]
        return [burst for burst in among if burst.from_cycle is not None and burst.from_cycle <= self.cycle]

    def _choose_beat(self) -> None:
        burst = self._engaged
        if burst is None or self.manner.interleave:
            ready = self._ready(self._order)
            if not ready:
                return
            chosen = self.rng.choice(ready) if self.manner.reorder else ready[0]
            self.mixed += burst is not None and chosen is not burst
            self.overtaken += chosen is not self._order[0] and chosen.given == 0
            burst = chosen
        address = burst.address + burst.given * self.lanes
        data, response = self._read(address)
        self._beat = {"rid": burst.id, "rdata": data, "rresp": response, "rlast": int(burst.given in burst.last)}
        burst.given += 1
        self._ends = burst.given == burst.beats
        self._engaged = None if self._ends else burst
        if self._ends:
            self._order.remove(burst)

    def _read(self, address: int) -> tuple[int, int]:
        content = self.content(address, self.lanes)
        response = self.errors.get(address, OKAY if content is not None else DECERR)
        if content is None or response != OKAY:
            return self.rng.getrandbits(8 * self.lanes), response
        for lane in range(self.lanes) if self.written else ():
            if (byte := self.written.get(address + lane)) is not None:
                content = content & ~(0xFF << 8 * lane) | byte << 8 * lane
        return content, response

    def _choose_answer(self) -> None:
        ready = self._ready(self._writes)
        if not ready:
            return
        burst = self.rng.choice(ready) if self.manner.reorder else ready[0]
        self.overtaken += burst is not self._writes[0]
        self._writes.remove(burst)
        missing = self.content(burst.address, BLOCK_BYTES) is None
        response = self.errors.get(burst.address, DECERR if missing else OKAY)
        self._answer = {"bid": burst.id, "bresp": response}
        data = sum(beat << 8 * self.lanes * k for k, (beat, _) in enumerate(burst.data))
        strobes = sum(strobe << self.lanes * k for k, (_, strobe) in enumerate(burst.data))
        self.writes.append((burst.address, data, strobes, response))
        for byte in range(BLOCK_BYTES) if response == OKAY else ():
            if strobes >> byte & 1:
                self.written[burst.address + byte] = data >> 8 * byte & 0xFF

    # --- what it sees -------------------------------------------------------------------------------------------------

    def sees(self, shown: dict[str, int], get: Callable[[str], int]) -> None:
        """The end of a cycle in which it drove `shown`; `get` gives a signal that the master drives."""
        self.cycle += 1
        if "arready" in shown:
            asked, given = bool(get("arvalid")), bool(shown["rvalid"])
            accepted, taken = asked and bool(shown["arready"]), given and bool(get("rready"))
            self.cycles.add(asked, accepted, given, taken)
            if accepted:
                self._accept_read(get("araddr"), get("arid"))
            if taken:
                self.beats += 1
                if self._ends:
                    assert self._beat is not None
                    self._ids.discard(self._beat["rid"])
                self._beat = None
        if "awready" in shown:
            if shown["awready"] and get("awvalid"):
                self._accept_write(get("awaddr"), get("awid"))
            if shown["wready"] and get("wvalid"):
                self._data.append((get("wdata"), get("wstrb")))
            self._give_data()
            if shown["bvalid"] and get("bready"):
                self._answer = None
        self.most_under_way = max(self.most_under_way, self.under_way)

    def _accept_read(self, address: int, identity: int) -> None:
        where = f"cycle {self.cycle}: block at {address:#x}, id {identity:#x}"
        assert identity not in self._ids, f"{where}: a burst of this id is under way"
        beats = range(address, address + BLOCK_BYTES, self.lanes)
        there = self.content(address, self.lanes) is not None or any(beat in self.errors for beat in beats)
        assert there or not self.strict, f"{where}: nothing is there"
        wrong = self.wrong.get(address)
        answer = wrong or Wrong(beats=len(beats), last=frozenset({len(beats) - 1}))
        self.reads.append(address)
        self.asked.append(identity)
        self.keeps_rules &= wrong is None
        if answer.beats:
            burst = self._burst(identity, address, answer.beats, answer)
            burst.from_cycle = self.cycle - 1 + burst.wait
            self._order.append(burst)
            self._ids.add(identity)

    def _accept_write(self, address: int, identity: int) -> None:
        where = f"cycle {self.cycle}: block at {address:#x}, id {identity:#x}"
        there = self.content(address, BLOCK_BYTES) is not None or address in self.errors
        assert there or not self.strict, f"{where}: nothing is there"
        answer = self.wrong.get(address, Wrong(beats=1))
        self._writes.append(self._burst(identity, address, BLOCK_BYTES // self.lanes, answer))
        self._writes[-1].answered = answer.beats > 0

    def _give_data(self) -> None:
        """Beats to their bursts, which come in the order of the addresses."""
        for burst in list(self._writes):
            while self._data and len(burst.data) < burst.beats:
                burst.data.append(self._data.popleft())
            if len(burst.data) == burst.beats and burst.from_cycle is None:
                burst.from_cycle = self.cycle - 1 + burst.wait
                if not burst.answered:
                    self._writes.remove(burst)

    def check(self, rules: Iterable[int]) -> None:
        """Fails for the first rule of AXI that the checker beside the port says the master, or the slave, has broken.

        Its own rules a slave that answers as `wrong` says may break.
        """
        master, slave = rules
        assert not master, f"cycle {self.cycle}: the master breaks {rule_of(master)}"
        assert not (slave and self.keeps_rules), f"cycle {self.cycle}: the slave breaks {rule_of(slave)}"

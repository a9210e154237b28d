"""What may be seen at an AXI4 port, cycle by cycle: random traffic that keeps all rules, and faults put into it.

A trace is a list of cycles, each with the values of all signals of a port by AXI's names, and `rst`. It is made without
any hardware: master and slave are the few lines below, so that nothing which is tried with a trace has made it.
"""

import random
from collections import defaultdict, deque
from dataclasses import dataclass, field

Cycle = dict[str, int]

CHANNELS: dict[str, tuple[str, ...]] = {
    "aw": ("awaddr", "awid", "awlen", "awsize", "awburst"),
    "w": ("wdata", "wstrb", "wlast"),
    "b": ("bid", "bresp"),
    "ar": ("araddr", "arid", "arlen", "arsize", "arburst"),
    "r": ("rdata", "rid", "rresp", "rlast"),
}
FIXED, INCR, WRAP, RESERVED = range(4)
PAGE, BLOCK_BYTES = 4096, 64
RESPONSES = (0, 0, 0, 2, 3)
"""OKAY as a rule, SLVERR and DECERR."""


@dataclass(frozen=True, kw_only=True)
class Port:
    """The port, and what may be under way at it."""

    blocks: bool
    """Bursts are whole blocks, and no id has two reads under way."""
    data_width: int = 128
    id_width: int = 2
    address_width: int = 40
    reads: int = 4
    """Read bursts of an id."""
    writes: int = 16
    """Write bursts in all."""
    ahead: int = 16
    """Bursts, or beats where bursts are not blocks, of data before their addresses."""

    @property
    def lanes(self) -> int:
        return self.data_width // 8

    def burst(self, rng: random.Random) -> "Burst":
        """Any burst that may be."""
        identity = rng.randrange(1 << self.id_width)
        full = self.lanes.bit_length() - 1
        if self.blocks:
            address = rng.randrange(1 << self.address_width) & -BLOCK_BYTES
            return Burst(identity, address, BLOCK_BYTES // self.lanes, full, INCR)
        size = rng.choice((full, rng.randint(0, full)))
        kind = rng.choice((INCR, INCR, FIXED, WRAP))
        page, offset = rng.randrange(1 << self.address_width) & -PAGE, rng.randrange(PAGE)
        if kind == WRAP:
            return Burst(identity, page + (offset & -(1 << size)), rng.choice((2, 4, 8, 16)), size, kind)
        most = 16 if kind == FIXED else min(256, (PAGE - (offset & -(1 << size))) >> size)
        beats = most if rng.random() < 0.01 else rng.choice((1, rng.randint(1, min(most, 8))))
        return Burst(identity, page + offset, beats, size, kind)


@dataclass
class Burst:
    """A burst, and how far it is."""

    id: int
    address: int
    beats: int
    size: int
    kind: int
    given: int = 0

    def asked(self, channel: str) -> Cycle:
        values = (self.address, self.id, self.beats - 1, self.size, self.kind)
        return dict(zip(CHANNELS[channel], values, strict=True))

    def lanes_of(self, beat: int, lanes: int) -> range:
        """Which bytes of the bus a beat has."""
        width, address = 1 << self.size, self.address
        if beat and self.kind == INCR:
            address = (address & -width) + beat * width
        elif self.kind == WRAP:
            whole = width * self.beats
            base = address & -whole
            address = base + (address - base + beat * width) % whole
        return range(address % lanes, (address & -width) % lanes + width)


@dataclass
class Traffic:
    """A master and a slave, both of which stall, and what passes between them."""

    port: Port
    rng: random.Random
    cycles: list[Cycle] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.offers: dict[str, Cycle | None] = dict.fromkeys(CHANNELS)
        self.reading: dict[int, deque[Burst]] = defaultdict(deque)
        self.fresh: deque[Burst] = deque()
        """Write bursts whose addresses are not offered yet."""
        self.unsent: deque[Burst] = deque()
        """Those whose data is not all offered."""
        self.addressed = self.whole = self.answered = 0
        """Bursts whose address, whose data, and whose answer has been taken."""
        self.lead = 0
        """Beats of data that were taken, less those of bursts whose address was."""
        self.order: list[Burst] = []
        """All bursts to be written, in order."""
        self.unanswered: dict[int, deque[int]] = defaultdict(deque)
        """By id, the numbers of bursts without an answer whose address was taken."""
        self.willing = {channel: self.rng.choice((0.4, 0.7, 1.0)) for channel in CHANNELS}

    def run(self, count: int) -> list[Cycle]:
        """Two cycles of reset, then `count` cycles of traffic."""
        self.cycles += [self._cycle(reset=True) for _ in range(2)]
        for _ in range(count):
            for channel, offer in self.offers.items():
                if offer is None and self.rng.random() < self.willing[channel]:
                    self.offers[channel] = getattr(self, f"_offer_{channel}")()
            self.cycles.append(self._cycle())
            for channel, offer in self.offers.items():
                if offer is not None and self.cycles[-1][f"{channel}ready"]:
                    self.offers[channel] = None
                    getattr(self, f"_take_{channel}")(offer)
        return self.cycles

    def _cycle(self, *, reset: bool = False) -> Cycle:
        cycle = {"rst": int(reset)}
        for channel, names in CHANNELS.items():
            offer = self.offers[channel]
            cycle[f"{channel}valid"] = int(offer is not None)
            cycle[f"{channel}ready"] = int(not reset and self.rng.random() < self.willing[channel])
            cycle |= offer if offer is not None else dict.fromkeys(names, 0)
        return cycle

    # --- reads ----------------------------------------------------------------------------------------------------

    def _offer_ar(self) -> Cycle | None:
        burst = self.port.burst(self.rng)
        most = 1 if self.port.blocks else self.port.reads
        return burst.asked("ar") if len(self.reading[burst.id]) < most else None

    def _take_ar(self, offer: Cycle) -> None:
        address, identity, length, size, kind = offer.values()
        self.reading[identity].append(Burst(identity, address, length + 1, size, kind))

    def _offer_r(self) -> Cycle | None:
        ready = [bursts[0] for bursts in self.reading.values() if bursts]
        if not ready:
            return None
        burst = self.rng.choice(ready)
        data, last = self.rng.getrandbits(self.port.data_width), int(burst.given + 1 == burst.beats)
        return {"rdata": data, "rid": burst.id, "rresp": self.rng.choice(RESPONSES), "rlast": last}

    def _take_r(self, offer: Cycle) -> None:
        bursts = self.reading[offer["rid"]]
        bursts[0].given += 1
        if offer["rlast"]:
            bursts.popleft()

    # --- writes ---------------------------------------------------------------------------------------------------

    def _next_write(self) -> None:
        burst = self.port.burst(self.rng)
        for bursts in (self.fresh, self.unsent, self.order):
            bursts.append(burst)

    def _offer_aw(self) -> Cycle | None:
        if self.addressed - self.answered >= self.port.writes:
            return None
        if not self.fresh:
            self._next_write()
        return self.fresh.popleft().asked("aw")

    def _take_aw(self, offer: Cycle) -> None:
        self.unanswered[offer["awid"]].append(self.addressed)
        self.lead -= self.order[self.addressed].beats
        self.addressed += 1

    def _offer_w(self) -> Cycle | None:
        room = self.addressed - self.whole + self.port.ahead if self.port.blocks else self.port.ahead - self.lead
        if room <= 1:
            return None
        if not self.unsent:
            self._next_write()
        burst, lanes = self.unsent[0], self.port.lanes
        mine = sum(1 << lane for lane in burst.lanes_of(burst.given, lanes))
        strobes = mine & self.rng.choice((mine, self.rng.getrandbits(lanes)))
        burst.given += 1
        last = int(burst.given == burst.beats)
        if last:
            self.unsent.popleft()
        return {"wdata": self.rng.getrandbits(self.port.data_width), "wstrb": strobes, "wlast": last}

    def _take_w(self, offer: Cycle) -> None:
        self.lead += 1
        self.whole += offer["wlast"]

    def _offer_b(self) -> Cycle | None:
        ready = [identity for identity, numbers in self.unanswered.items() if numbers and numbers[0] < self.whole]
        return {"bid": self.rng.choice(ready), "bresp": self.rng.choice(RESPONSES)} if ready else None

    def _take_b(self, offer: Cycle) -> None:
        self.unanswered[offer["bid"]].popleft()
        self.answered += 1


def legal_trace(port: Port, seed: int, cycles: int) -> list[Cycle]:
    """A trace that keeps all rules."""
    return Traffic(port, random.Random(seed)).run(cycles)

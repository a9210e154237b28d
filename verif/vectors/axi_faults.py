"""Faults of masters and slaves at an AXI4 port: traces that keep all rules but for one thing, and which it breaks.

A fault takes a random place in a trace that it fits, changes what is seen there, and says which rule has to be named.
"""

import random
from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from lightloom.verif.vectors.axi_traces import (
    BLOCK_BYTES,
    CHANNELS,
    FIXED,
    INCR,
    PAGE,
    RESERVED,
    WRAP,
    Burst,
    Cycle,
    Port,
    legal_trace,
)

CYCLES = 500
TAIL = 200
"""Cycles of the trace that follow a fault: some rules need a few to be found broken."""
Change = Callable[[list[Cycle], Port, random.Random], int]
"""Puts a fault into a trace; the cycle of it."""


class NoPlaceError(Exception):
    """The trace has no place for the fault; another one may have."""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault of a master or a slave."""

    name: str
    rule: str
    """Of AXI_RULES: what has to be named."""
    change: Change
    blocks: bool = False
    """At a port of whole blocks; otherwise at one of any bursts."""

    def port(self) -> Port:
        return Port(blocks=self.blocks)

    def trace(self, seed: int) -> tuple[list[Cycle], int]:
        """A trace with the fault, and its cycle."""
        for attempt in range(100):
            rng = random.Random(f"{seed} {self.name} {attempt}")
            trace = legal_trace(self.port(), rng.getrandbits(32), CYCLES)
            try:
                where = self.change(trace, self.port(), rng)
            except NoPlaceError:
                continue
            return trace[: where + TAIL], where
        raise AssertionError(f"seed {seed}: no trace has a place for the fault {self.name!r}")


# --- places -----------------------------------------------------------------------------------------------------------


def place(trace: list[Cycle], rng: random.Random, fits: Callable[[int], bool]) -> int:
    """A random cycle that fits, neither at the beginning nor at the end."""
    places = [k for k in range(len(trace) // 4, len(trace) - TAIL) if fits(k)]
    if not places:
        raise NoPlaceError
    return rng.choice(places)


def waits(trace: list[Cycle], channel: str) -> Callable[[int], bool]:
    """Something is offered in this cycle that was not taken in the one before."""
    valid, ready = f"{channel}valid", f"{channel}ready"
    return lambda k: bool(trace[k - 1][valid] and not trace[k - 1][ready])


def begins(trace: list[Cycle], channel: str) -> Callable[[int], bool]:
    """Something is offered in this cycle that was not in the one before."""
    return lambda k: bool(trace[k][f"{channel}valid"]) and not waits(trace, channel)(k)


def idle(trace: list[Cycle], channel: str) -> Callable[[int], bool]:
    return lambda k: not trace[k][f"{channel}valid"]


def change_offer(trace: list[Cycle], k: int, channel: str, **values: int) -> int:
    """Changes what is offered from cycle `k` on, as long as it waits."""
    for cycle in trace[k:]:
        cycle |= values
        if cycle[f"{channel}ready"]:
            break
    return k


class UnderWay:
    """What is under way before each cycle of a trace."""

    def __init__(self, trace: list[Cycle], port: Port):
        self.reads: list[dict[int, list[Burst]]] = []
        """By id, bursts whose last beat was not taken."""
        self.writes: list[dict[int, list[bool]]] = []
        """By id, of bursts whose address was taken and whose answer was not, whether their data was taken."""
        self.beat: list[int] = []
        """The number of the next beat of data, in its burst."""
        self.whole: list[int] = []
        """Bursts whose data was taken."""
        self.lengths: list[int] = []
        """Beats of all write bursts, in their order."""
        self.behind: list[int] = []
        """Bursts whose address was taken and whose data was not, less those of which it is the other way round."""
        reads: dict[int, deque[Burst]] = defaultdict(deque)
        writes: dict[int, deque[int]] = defaultdict(deque)
        addressed = whole = beat = 0
        for cycle in trace:
            self.reads.append({key: list(bursts) for key, bursts in reads.items() if bursts})
            self.writes.append({key: [n < whole for n in numbers] for key, numbers in writes.items() if numbers})
            self.beat.append(beat)
            self.behind.append(addressed - whole)
            self.whole.append(whole)
            moves = {channel: cycle[f"{channel}valid"] and cycle[f"{channel}ready"] for channel in CHANNELS}
            if moves["r"]:
                burst = reads[cycle["rid"]][0]
                reads[burst.id][0] = Burst(burst.id, 0, burst.beats, 0, 0, burst.given + 1)
                if cycle["rlast"]:
                    reads[burst.id].popleft()
            if moves["ar"]:
                reads[cycle["arid"]].append(Burst(cycle["arid"], 0, cycle["arlen"] + 1, 0, 0))
            if moves["b"]:
                writes[cycle["bid"]].popleft()
            if moves["w"]:
                beat = 0 if cycle["wlast"] else beat + 1
                whole += cycle["wlast"]
            if moves["aw"]:
                writes[cycle["awid"]].append(addressed)
                self.lengths.append(cycle["awlen"] + 1)
                addressed += 1


# --- the faults -------------------------------------------------------------------------------------------------------


def withdrawn(channel: str) -> Change:
    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        k = place(trace, rng, waits(trace, channel))
        trace[k][f"{channel}valid"] = 0
        return k

    return change


def changed(name: str) -> Change:
    channel = next(key for key, names in CHANNELS.items() if name in names)

    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        k = place(trace, rng, waits(trace, channel))
        width = {
            "data": port.data_width,
            "strb": port.lanes,
            "last": 1,
            "addr": port.address_width,
            "id": port.id_width,
        }
        trace[k][name] ^= 1 << rng.randrange(width.get(name.removeprefix(channel), 2))
        return k

    return change


def in_reset(channel: str) -> Change:
    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        quiet = [{**cycle, **{f"{each}valid": 0 for each in CHANNELS}, "rst": 1} for cycle in trace[:3]]
        quiet[1 + rng.randrange(2)][f"{channel}valid"] = 1
        del trace[CYCLES // 2 :]
        trace += [dict(cycle) for cycle in quiet]
        return len(trace) - 2

    return change


def asked(channel: str, values: Callable[[Port, random.Random], tuple[int, ...]]) -> Change:
    """An address that may not be: (address, id, length, size, burst)."""

    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        k = place(trace, rng, begins(trace, channel))
        return change_offer(trace, k, channel, **dict(zip(CHANNELS[channel], values(port, rng), strict=True)))

    return change


def full(port: Port) -> int:
    return port.lanes.bit_length() - 1


ADDRESSES: dict[str, tuple[str, bool, Callable[[Port, random.Random], tuple[int, ...]]]] = {
    "a reserved burst": ("burst", False, lambda port, rng: (64, 0, 0, full(port), RESERVED)),
    "a block that wraps": ("burst", True, lambda port, rng: (64, 0, BLOCK_BYTES // port.lanes - 1, full(port), WRAP)),
    "beats wider than the bus": ("size", False, lambda port, rng: (64, 0, 0, full(port) + 1, INCR)),
    "narrow beats of a block": (
        "size",
        True,
        lambda port, rng: (64, 0, BLOCK_BYTES // port.lanes - 1, full(port) - 1, INCR),
    ),
    "17 beats at one address": ("length", False, lambda port, rng: (64, 0, 16, full(port), FIXED)),
    "a wrap of 3 beats": ("length", False, lambda port, rng: (64, 0, 2, full(port), WRAP)),
    "half a block": ("length", True, lambda port, rng: (64, 0, BLOCK_BYTES // port.lanes // 2 - 1, full(port), INCR)),
    "a wrap from within a beat": ("alignment", False, lambda port, rng: (65, 0, 3, full(port), WRAP)),
    "an address within a block": (
        "alignment",
        True,
        lambda port, rng: (port.lanes, 0, BLOCK_BYTES // port.lanes - 1, full(port), INCR),
    ),
    "a burst across 4 KB": ("boundary", False, lambda port, rng: (3 * PAGE - port.lanes, 0, 1, full(port), INCR)),
    "a narrow burst across 4 KB": ("boundary", False, lambda port, rng: (PAGE - 100, 0, 100, 0, INCR)),
}
"""What is asked for: the rule, whether it is wrong of blocks alone, and the address channel's payload."""


def second_burst_of_an_id(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)
    k = place(trace, rng, lambda k: bool(begins(trace, "ar")(k) and trace[k]["arready"] and under_way.reads[k]))
    return change_offer(trace, k, "ar", arid=rng.choice(list(under_way.reads[k])))


def too_many_writes(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """The master goes on with addresses while there are no answers."""
    k = place(trace, rng, lambda k: True)
    burst = port.burst(rng).asked("aw")
    for cycle in trace[k:]:
        cycle |= {"awvalid": 1, "awready": 1, "bvalid": 0, "wvalid": 0, **burst}
    return k


def answer(channel: str, k: int, trace: list[Cycle], **values: int) -> int:
    """An answer where there was none, for a cycle."""
    trace[k] |= {f"{channel}valid": 1, f"{channel}ready": 1, **values}
    return k


def beat_of_no_burst(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)
    ids = range(1 << port.id_width)

    def free(k: int) -> list[int]:
        return [identity for identity in ids if identity not in under_way.reads[k]]

    k = place(trace, rng, lambda k: idle(trace, "r")(k) and bool(free(k)))
    return answer("r", k, trace, rid=rng.choice(free(k)), rlast=1, rresp=0)


def beat_too_many(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """Once more the last beat of a burst, behind which the id has none."""
    under_way = UnderWay(trace, port)

    def fits(k: int) -> bool:
        last = trace[k - 1]
        ends = last["rvalid"] and last["rready"] and last["rlast"]
        return bool(ends and idle(trace, "r")(k) and last["rid"] not in under_way.reads[k])

    k = place(trace, rng, fits)
    return answer("r", k, trace, **{name: trace[k - 1][name] for name in CHANNELS["r"]})


def last_of_read(early: bool) -> Change:
    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        k = place(trace, rng, lambda k: begins(trace, "r")(k) and bool(trace[k]["rlast"]) != early)
        return change_offer(trace, k, "r", rlast=int(early))

    return change


def reads_out_of_order(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """Of two bursts of an id the second one is answered first, and is the shorter one."""
    under_way = UnderWay(trace, port)

    def first_beats(k: int) -> list[int]:
        pairs = {key: bursts[:2] for key, bursts in under_way.reads[k].items() if len(bursts) > 1}
        return [key for key, (one, other) in pairs.items() if not one.given and one.beats > other.beats == 1]

    k = place(trace, rng, lambda k: idle(trace, "r")(k) and bool(first_beats(k)))
    return answer("r", k, trace, rid=rng.choice(first_beats(k)), rlast=1, rresp=0)


def last_of_write(early: bool) -> Change:
    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        k = place(trace, rng, lambda k: begins(trace, "w")(k) and bool(trace[k]["wlast"]) != early)
        return change_offer(trace, k, "w", wlast=int(early))

    return change


def writes_out_of_order(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """Of two bursts the data of the second one comes first: a single beat, and the first one has more."""
    under_way = UnderWay(trace, port)
    beats = under_way.lengths

    def fits(k: int) -> bool:
        number = under_way.whole[k]
        first = begins(trace, "w")(k) and under_way.beat[k] == 0
        return first and number + 1 < len(beats) and beats[number] > 1 == beats[number + 1]

    k = place(trace, rng, fits)
    last = next(j for j, cycle in enumerate(trace) if j > k and begins(trace, "w")(j) and cycle["wlast"])
    change_offer(trace, last, "w", wlast=0)
    return change_offer(trace, k, "w", wlast=1)


def single_beat(trace: list[Cycle], port: Port) -> Callable[[int], bool]:
    """The only beat of a burst whose address has not come, and nor does another one in this cycle."""
    under_way = UnderWay(trace, port)

    def fits(k: int) -> bool:
        first = begins(trace, "w")(k) and under_way.beat[k] == 0 and trace[k]["wlast"]
        room = sum(map(len, under_way.writes[k].values())) < port.writes // 2
        return bool(first and room and idle(trace, "aw")(k) and under_way.behind[k] == 0)

    return fits


def strobe_outside(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """A narrow burst, of which a beat has a strobe of another byte."""
    k = place(trace, rng, single_beat(trace, port))
    lane = rng.randrange(port.lanes)
    change_offer(trace, k, "w", wstrb=1 << (lane ^ rng.choice((1, 2, 4, 8))))
    narrow = {"awaddr": lane, "awid": 0, "awlen": 0, "awsize": 0, "awburst": INCR}
    return answer("aw", k, trace, **narrow)


def strobe_before_the_address(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """An address that is not at the beginning of a beat, and a strobe of the byte before it."""
    k = place(trace, rng, single_beat(trace, port))
    lane = rng.randrange(1, port.lanes)
    change_offer(trace, k, "w", wstrb=1 << lane - 1)
    return answer("aw", k, trace, awaddr=lane, awid=0, awlen=0, awsize=full(port), awburst=INCR)


def data_without_addresses(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """The master goes on with data, and there are no addresses."""
    under_way = UnderWay(trace, port)

    def fits(k: int) -> bool:
        fresh = under_way.beat[k] == 0 and not any(waits(trace, channel)(k) for channel in ("aw", "w", "b"))
        return fresh and (port.blocks or under_way.behind[k] <= 0)

    k = place(trace, rng, fits)
    beats = BLOCK_BYTES // port.lanes if port.blocks else 1
    for number, cycle in enumerate(trace[k:]):
        last = int(number % beats == beats - 1)
        cycle |= {"awvalid": 0, "wvalid": 1, "wready": 1, "wstrb": 0, "wlast": last, "bvalid": 0}
    return k


def free_of_writes(under_way: UnderWay, port: Port, k: int) -> list[int]:
    return [identity for identity in range(1 << port.id_width) if identity not in under_way.writes[k]]


def answer_of_no_burst(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)
    k = place(trace, rng, lambda k: idle(trace, "b")(k) and bool(free_of_writes(under_way, port, k)))
    return answer("b", k, trace, bid=rng.choice(free_of_writes(under_way, port, k)), bresp=0)


def second_answer(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)

    def fits(k: int) -> bool:
        last = trace[k - 1]
        gone = last["bvalid"] and last["bready"] and last["bid"] not in under_way.writes[k]
        return bool(gone and idle(trace, "b")(k))

    k = place(trace, rng, fits)
    return answer("b", k, trace, bid=trace[k - 1]["bid"], bresp=0)


def answer_with_another_id(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)
    k = place(trace, rng, lambda k: begins(trace, "b")(k) and bool(free_of_writes(under_way, port, k)))
    return change_offer(trace, k, "b", bid=rng.choice(free_of_writes(under_way, port, k)))


def answer_before_the_data(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    under_way = UnderWay(trace, port)

    def early(k: int) -> list[int]:
        return [identity for identity, whole in under_way.writes[k].items() if not whole[0]]

    k = place(trace, rng, lambda k: idle(trace, "b")(k) and bool(early(k)))
    return answer("b", k, trace, bid=rng.choice(early(k)), bresp=0)


def answer_with_the_last_beat(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """In the cycle in which that is taken."""
    under_way = UnderWay(trace, port)

    def ends(k: int) -> list[int]:
        cycle = trace[k]
        if not (cycle["wvalid"] and cycle["wready"] and cycle["wlast"] and under_way.behind[k] == 1):
            return []
        return [identity for identity, whole in under_way.writes[k].items() if whole == [False]]

    k = place(trace, rng, lambda k: idle(trace, "b")(k) and bool(ends(k)))
    return answer("b", k, trace, bid=ends(k)[0], bresp=0)


def answer_before_the_address(trace: list[Cycle], port: Port, rng: random.Random) -> int:
    """The data of a burst is whole, its address waits."""
    under_way = UnderWay(trace, port)

    def early(k: int) -> bool:
        cycle = trace[k]
        return bool(under_way.behind[k] < 0 and cycle["awvalid"] and cycle["awid"] not in under_way.writes[k])

    k = place(trace, rng, lambda k: idle(trace, "b")(k) and early(k))
    return answer("b", k, trace, bid=trace[k]["awid"], bresp=0)


def exclusive(channel: str) -> Change:
    def change(trace: list[Cycle], port: Port, rng: random.Random) -> int:
        return change_offer(trace, place(trace, rng, begins(trace, channel)), channel, **{f"{channel}resp": 1})

    return change


def _faults() -> Iterator[Fault]:
    for channel, names in CHANNELS.items():
        yield Fault(name=f"{channel}valid withdrawn", rule=f"{channel}_withdrawn", change=withdrawn(channel))
        yield Fault(name=f"{channel}valid in a reset", rule=f"{channel}_in_reset", change=in_reset(channel))
        for name in names:
            yield Fault(name=f"{name} changed", rule=f"{channel}_changed", change=changed(name))
    for channel in ("ar", "aw"):
        for name, (rule, blocks, values) in ADDRESSES.items():
            change = asked(channel, values)
            yield Fault(name=f"{channel}: {name}", rule=f"{channel}_{rule}", change=change, blocks=blocks)
    for name, rule, change, blocks in (
        ("a second burst of an id", "ar_too_many", second_burst_of_an_id, True),
        ("more writes than there may be", "aw_too_many", too_many_writes, True),
        ("a beat of no burst", "r_unasked", beat_of_no_burst, False),
        ("a beat too many", "r_unasked", beat_too_many, True),
        ("RLAST too early", "r_last_early", last_of_read(True), False),
        ("no RLAST", "r_last_missing", last_of_read(False), False),
        ("no RLAST of a block", "r_last_missing", last_of_read(False), True),
        ("bursts of an id out of order", "r_last_early", reads_out_of_order, False),
        ("EXOKAY to a read", "r_exclusive", exclusive("r"), False),
        ("WLAST too early", "w_last_early", last_of_write(True), False),
        ("WLAST of a block too early", "w_last_early", last_of_write(True), True),
        ("no WLAST", "w_last_missing", last_of_write(False), False),
        ("no WLAST of a block", "w_last_missing", last_of_write(False), True),
        ("data in another order than addresses", "w_last_early", writes_out_of_order, False),
        ("a strobe beside a narrow beat", "w_strobe", strobe_outside, False),
        ("a strobe before the address", "w_strobe", strobe_before_the_address, False),
        ("data without addresses", "w_too_far", data_without_addresses, False),
        ("blocks without addresses", "w_too_far", data_without_addresses, True),
        ("an answer to no write", "b_unasked", answer_of_no_burst, False),
        ("a second answer", "b_unasked", second_answer, False),
        ("an answer with another id", "b_unasked", answer_with_another_id, False),
        ("an answer before the address", "b_unasked", answer_before_the_address, False),
        ("an answer before the data", "b_early", answer_before_the_data, False),
        ("an answer with the last beat", "b_early", answer_with_the_last_beat, True),
        ("EXOKAY to a write", "b_exclusive", exclusive("b"), False),
    ):
        yield Fault(name=name, rule=rule, change=change, blocks=blocks)


FAULTS = {fault.name: fault for fault in _faults()}
"""By name."""

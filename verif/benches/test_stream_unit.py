"""The bench of every unit that has one input stream, one output stream, and results in order.

What differs between units is the model, which `golden_model.models` names, and the operands, which the run brings
along.
"""

import itertools
import json
import os
import random

import cocotb
import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.verif.drivers.stream import Exchange, StreamDriver, pattern

NEVER = itertools.repeat(False)


class Scoreboard:
    """Operands as payloads with tags, and what has to come back for each."""

    def __init__(self) -> None:
        run = json.loads(os.environ["LIGHTLOOM_BENCH"])
        self.unit = PURE[run["unit"]]
        self.latency: int = run["latency"]
        self.interval: int = run["initiation_interval"]
        self.seed: int = run["seed"]
        self.operands = bitpack.unpack(np.load(run["operands"]), self.unit.input)
        tags = np.arange(len(self.operands)) % (1 << run["tag_width"])
        self.payloads = payloads(self.operands, tags)
        self.expected = payloads(model_results(run["unit"], self.operands, run["config"]), tags)

    def check(self, seen: Exchange, first: int, count: int) -> None:
        """Operands `first` to `first + count` went in, so exactly their results came out, in order, in all bits."""
        expected = self.expected[first : first + count]
        for k, (got, wanted) in enumerate(zip(seen.received, expected, strict=False)):
            assert got == wanted, (
                f"{self.unit.name}, seed {self.seed}, operation {first + k}: operands {self.payloads[first + k]:#x}, "
                f"result {got:#x}, model {wanted:#x} (tag in the highest bits)"
            )
        assert len(seen.received) == count, f"{count} operations gave {len(seen.received)} results"


def payloads(array: np.ndarray, tags: np.ndarray) -> list[int]:
    """A structured array and tags, record by record, to payload integers."""
    width = bitpack.width(array.dtype)
    rows = bitpack.pack(array)
    return [int.from_bytes(row.tobytes(), "little") | (int(tag) << width) for row, tag in zip(rows, tags, strict=True)]


async def started(dut: object) -> tuple[Scoreboard, StreamDriver, random.Random]:
    board, streams = Scoreboard(), StreamDriver(dut)
    cocotb.log.info("%s, seed %d, %d operands", board.unit.name, board.seed, len(board.operands))
    await streams.start()
    return board, streams, random.Random(board.seed)


@cocotb.test()
async def full_rate(dut: object) -> None:
    """Never stalled: an operation every initiation interval, each result exactly `latency` cycles later."""
    board, streams, rng = await started(dut)
    seen = await streams.exchange(board.payloads, give=pattern("always", rng), take=pattern("always", rng))
    board.check(seen, 0, len(board.payloads))
    gaps = {after - before for before, after in itertools.pairwise(seen.sent_at)}
    assert gaps == {board.interval}, f"{gaps} cycles between operations, declared {board.interval}"
    latencies = {out - into for into, out in zip(seen.sent_at, seen.received_at, strict=True)}
    assert latencies == {board.latency}, f"latencies {latencies}, declared {board.latency}"


@cocotb.test()
@cocotb.parametrize(
    sides=[("half", "half"), ("always", "bursts"), ("bursts", "always"), ("bursts", "bursts"), ("rare", "rare")]
)
async def stalled(dut: object, sides: tuple[str, str]) -> None:
    """Either side stalls at random: nothing is lost, doubled, reordered or changed while it waits."""
    board, streams, rng = await started(dut)
    count = len(board.payloads) // (4 if "rare" in sides else 1)
    give, take = (pattern(name, rng) for name in sides)
    seen = await streams.exchange(board.payloads[:count], give=give, take=take)
    board.check(seen, 0, count)


@cocotb.test()
async def blocked_output(dut: object) -> None:
    """With nobody taking results the unit fills up and stops accepting; then everything accepted comes out."""
    board, streams, rng = await started(dut)
    blocked = 3 * board.latency + 20
    seen = await streams.exchange(
        board.payloads, give=pattern("always", rng), take=NEVER, until=lambda cycle: cycle == blocked
    )
    held = len(seen.sent_at)
    assert not seen.received
    assert held <= board.latency + 1, f"{held} operations in {board.latency} stages"
    drained = await streams.exchange([], give=NEVER, take=pattern("half", rng), expected=held)
    board.check(drained, 0, held)


@cocotb.test()
async def reset_in_flight(dut: object) -> None:
    """A reset drops what is in the pipeline, and the unit works on as new."""
    board, streams, rng = await started(dut)
    half = len(board.payloads) // 2
    cycles = board.latency + rng.randint(1, 30)
    await streams.exchange(
        board.payloads[half:], give=pattern("always", rng), take=NEVER, until=lambda cycle: cycle == cycles
    )
    await streams.reset()
    seen = await streams.exchange(board.payloads[:half], give=pattern("half", rng), take=pattern("half", rng))
    board.check(seen, 0, half)

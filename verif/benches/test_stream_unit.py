"""The bench of every unit that has one input stream, one output stream, and results in order.

What differs between units is the model, which `golden_model.models` names, and the operands, which the run brings
along.
"""

import itertools
from typing import Any

import cocotb
import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.golden_model.models import model_results
from lightloom.verif.benches.bench import Bench
from lightloom.verif.drivers.stream import Exchange


class StreamBench(Bench):
    """A unit, operands as payloads with tags, and what has to come back for each."""

    def __init__(self, dut: Any) -> None:
        super().__init__(dut)
        run = self.run
        self.unit = PURE[run["unit"]]
        self.latency: int = run["latency"]
        self.interval: int = run["initiation_interval"]
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


@cocotb.test()
async def full_rate(dut: Any) -> None:
    """Never stalled: an operation every initiation interval, each result exactly `latency` cycles later."""
    bench = StreamBench(dut)
    await bench.start()
    seen = await bench.exchange(bench.payloads, "always", "always")
    bench.check(seen, 0, len(bench.payloads))
    gaps = {after - before for before, after in itertools.pairwise(seen.sent_at)}
    assert gaps == {bench.interval}, f"{gaps} cycles between operations, declared {bench.interval}"
    latencies = {out - into for into, out in zip(seen.sent_at, seen.received_at, strict=True)}
    assert latencies == {bench.latency}, f"latencies {latencies}, declared {bench.latency}"


@cocotb.test()
@cocotb.parametrize(
    sides=[("half", "half"), ("always", "bursts"), ("bursts", "always"), ("bursts", "bursts"), ("rare", "rare")]
)
async def stalled(dut: Any, sides: tuple[str, str]) -> None:
    """Either side stalls at random: nothing is lost, doubled, reordered or changed while it waits."""
    bench = StreamBench(dut)
    await bench.start()
    count = len(bench.payloads) // (4 if "rare" in sides else 1)
    bench.check(await bench.exchange(bench.payloads[:count], *sides), 0, count)


@cocotb.test()
async def blocked_output(dut: Any) -> None:
    """With nobody taking results the unit fills up and stops accepting; then everything accepted comes out."""
    bench = StreamBench(dut)
    await bench.start()
    blocked = 3 * bench.latency + 20
    seen = await bench.exchange(bench.payloads, "always", "never", until=lambda cycle: cycle == blocked)
    held = len(seen.sent_at)
    assert not seen.received
    assert held <= bench.latency + 1, f"{held} operations in {bench.latency} stages"
    drained = await bench.exchange([], "never", "half", expected=held)
    bench.check(drained, 0, held)


@cocotb.test()
async def reset_in_flight(dut: Any) -> None:
    """A reset drops what is in the pipeline, and the unit works on as new."""
    bench = StreamBench(dut)
    await bench.start()
    half = len(bench.payloads) // 2
    cycles = bench.latency + bench.rng.randint(1, 30)
    await bench.exchange(bench.payloads[half:], "always", "never", until=lambda cycle: cycle == cycles)
    await bench.reset()
    bench.check(await bench.exchange(bench.payloads[:half]), 0, half)

"""The memory of the simulations: its bench on both simulators, broken memories, unusable images, and its speed."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lightloom.sim import toolchain
from lightloom.sim.runner import BenchError, run_cocotb
from tests import ROOT
from tests.simulators import SIMULATORS, needs_icarus

SIM = ROOT / "sim"
VERILOG = (SIM / "axi_memory.v").read_text(encoding="utf-8")
SEED = 38
MEMORY_BITS, QUEUE, ID_WIDTH = 14, 40, 4
IMAGE_BYTES = 12_345
"""Less than the memory, and no whole number of words."""
PORTS = ["clk", "rst", "latency", "bandwidth", "reorder", "interleave", "stall", "seed"]
PORTS += ["error_enable", "error_first", "error_last", "violation", "read_bursts", "read_beats", "busy_cycles"]
PORTS += ["arvalid", "arready", "araddr", "arid", "arlen", "arsize", "arburst"]
PORTS += ["rvalid", "rready", "rdata", "rid", "rresp", "rlast"]


def random_image(path: Path, size: int) -> Path:
    path.write_bytes(np.random.default_rng(SEED).bytes(size))
    return path


def bench(
    folder: Path,
    simulator: str,
    data_width: int,
    *,
    image_bytes: int = IMAGE_BYTES,
    verilog: str = VERILOG,
    only: str | None = None,
    served: Path | None = None,
) -> int:
    """Runs verif/benches/test_axi_memory.py, or its tests whose names match `only`, on a random image.

    The memory serves that image, or `served`.
    """
    image = random_image(folder / "image.bin", image_bytes)
    description = {"image": str(image), "memory_bits": MEMORY_BITS, "queue": QUEUE, "seed": SEED}
    return run_cocotb(
        "axi_memory",
        {"axi_memory.v": verilog},
        simulator,
        module="lightloom.verif.benches.test_axi_memory",
        public_ports=PORTS,
        parameters={"DATA_WIDTH": data_width, "MEMORY_BITS": MEMORY_BITS, "QUEUE": QUEUE, "ID_WIDTH": ID_WIDTH},
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description), **({"COCOTB_TEST_FILTER": only} if only else {})},
        plusargs=[f"+image={served or image}"],
        seed=SEED,
        folder=folder,
    )


@pytest.mark.parametrize(
    ("simulator", "data_width"),
    [
        ("verilator", 128),
        ("verilator", 1024),
        pytest.param("icarus", 256, marks=[pytest.mark.icarus, needs_icarus]),
    ],
)
def test_bench(simulator: str, data_width: int, tmp_path: Path) -> None:
    assert bench(tmp_path, simulator, data_width) == 26


@needs_icarus
@pytest.mark.icarus
@pytest.mark.parametrize(
    ("original", "mutant", "only", "message"),
    [
        ("rdata <= turned(memory[", "rdata <= (memory[", "data_of_any_read", "expected 0x"),
        ("first >> LANE_BITS >= image_words", "1'b0", "data_of_any_read", "Cannot convert|LogicArray|expected 0x"),
        ("waits = turn[slot] != now_turn[id[slot]];", "waits = 0;", "reorder=100", "expected 0x"),
        ("&& !(waits && reorder != 0)", "&& !waits", "reorder=0/interleave=1", "AssertionError"),
        ("if (engaged && !interleave)", "if (1'b0)", "reorder=100/interleave=0", "AssertionError"),
        ("if ((!rvalid || rready) &&", "if (", "stalled", "a waiting beat changed"),
        ("{48'd0, latency} - 1", "{48'd0, latency}", "latency", r"latency \d+: "),
        ("BEAT_COST = 256", "BEAT_COST = 255", "bandwidth", r"beat \d+ after"),
        ("under_way} < QUEUE", "under_way} <= QUEUE", "bursts_under_way", "AssertionError"),
        ("refused[tail] = arburst != INCR ||", "refused[tail] =", "errors", "expected 0xdeadbeef"),
        ("engaged = 0;", "", "reset_in_flight", "AssertionError"),
    ],
    ids=["bytes", "rest", "order", "in turn", "mixed", "hold", "latency", "bandwidth", "queue", "burst", "reset"],
)
def test_bench_catches_a_broken_memory(original: str, mutant: str, only: str, message: str, tmp_path: Path) -> None:
    assert VERILOG.count(original) == 1
    broken = VERILOG.replace(original, mutant)
    with pytest.raises(BenchError, match=message):
        bench(tmp_path, "icarus", 128, verilog=broken, only=only)


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_images_that_cannot_be_served(simulator: str, tmp_path: Path) -> None:
    missing = tmp_path / "missing.bin"
    with pytest.raises(
        BenchError, match=r"axi_memory: .*/missing\.bin: cannot be read; name a memory image with \+image="
    ):
        bench(tmp_path, simulator, 128, served=missing, only="latency")
    large = random_image(tmp_path / "large.bin", (1 << MEMORY_BITS) + 1)
    with pytest.raises(
        BenchError, match=r"axi_memory: .*/large\.bin: 16385 bytes are more than the memory holds, 16384;"
    ):
        bench(tmp_path, simulator, 128, served=large, only="latency")


@needs_icarus
@pytest.mark.icarus
def test_both_simulators_make_the_same_choices(tmp_path: Path) -> None:
    offered = []
    for simulator in ("verilator", "icarus"):
        folder = tmp_path / simulator
        folder.mkdir()
        bench(folder, simulator, 128, only="reset_in_flight")
        offered.append(json.loads((folder / "offered.json").read_text()))
    assert len(offered[0]) == 80
    assert offered[0] == offered[1]


def test_an_image_as_large_as_the_memory(tmp_path: Path) -> None:
    assert bench(tmp_path, "verilator", 128, image_bytes=1 << MEMORY_BITS, only="latency|errors") == 2


def test_speed_with_the_default_parameters(tmp_path: Path) -> None:
    verilator = toolchain.verilator()
    image = random_image(tmp_path / "image.bin", 5_000_000)
    options = ["--cc", "--prefix", "Vaxi_memory", "-O3", "--x-initial", "fast", "--no-timing", "-Wall"]
    command = [verilator.binary, *options, "--Mdir", str(tmp_path), str(SIM / "axi_memory.v")]
    toolchain.run(command, env=verilator.env)
    binary = tmp_path / "axi_memory"
    sources = [str(source) for source in [*tmp_path.glob("*.cpp"), SIM / "axi_memory.cpp"]]
    compile_ = [toolchain.compiler(), "-std=c++17", "-O1", "-DDATA_WIDTH=512", *verilator.include_options]
    compile_ += ["-I", str(tmp_path), *sources, str(toolchain.verilated_runtime()), "-pthread", "-o", str(binary)]
    toolchain.run(compile_)
    cycles = 200_000
    for latency, reorder, stall in [(100, 0, 0), (200, 100, 0), (400, 100, 64)]:
        run = [str(binary), str(image), str(cycles), str(latency), str(reorder), str(stall), f"+image={image}"]
        done = subprocess.run(run, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        bursts, beats, rate, start = done.stdout.split()
        print(
            f"latency {latency}, reorder {reorder}, stall {stall}: {rate} cycles/s, {beats} beats, {start} s to start"
        )
        # A burst under way of 256 waits `latency` cycles; a stall takes a quarter of the cycles.
        expected = min(1 - stall / 256, 256 / latency)
        assert 0.9 * expected * cycles < int(beats) <= int(bursts) <= expected * cycles + 256
        assert float(rate) > 200_000, "slower than what it is to serve"

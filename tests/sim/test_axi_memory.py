"""The memory of the simulations: its bench on both simulators, broken memories, unusable images, and its speed."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from amaranth import Signal
from amaranth.lib.wiring import Out

from lightloom.gen.watched import Port, watched
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.memory.axi import Axi
from lightloom.sim import toolchain
from lightloom.sim.runner import BenchError, run_cocotb
from tests import ROOT
from tests.simulators import SIMULATORS, needs_icarus

SIM = ROOT / "sim"
VERILOG = (SIM / "axi_memory.v").read_text(encoding="utf-8")
SEED = 38
MEMORY_BITS, QUEUE, WRITES, ID_WIDTH = 14, 40, 24, 4
IMAGE_BYTES = 12_345
"""Less than the memory, and no whole number of words."""
WRITABLE = [(0x1234, 0x1234), (0x1239, 0x1300), (0x2000, 0x37FF)]
"""Regions, first and last byte: with odd ends, and one behind the image that does not reach the end of the memory."""


def ports_of_memory(data_width: int) -> dict[str, Port]:
    """The ports of module axi_memory."""
    widths = {"clk": 1, "rst": 1, "latency": 16, "bandwidth": 9, "reorder": 8, "interleave": 1, "stall": 8, "seed": 32}
    widths |= {"error_enable": 1, "write_error_enable": 1, "error_first": 40, "error_last": 40}
    ports = {name: Port("input", width) for name, width in widths.items()}
    for port in Axi(address_width=40, data_width=min(data_width, 512), id_width=ID_WIDTH).ports:
        for name, member in port.members.items():
            wide = {"data": data_width, "strb": data_width // 8}.get(name[1:], Signal(member.shape).shape().width)
            ports[name] = Port("input" if member.flow == Out else "output", wide)
    counters = ("read_bursts", "read_beats", "busy_cycles", "write_bursts", "write_beats")
    return ports | {"violation": Port("output", 1)} | {name: Port("output", 64) for name in counters}


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
    regions: Path | None = None,
) -> int:
    """Runs the benches of the memory, or their tests whose names match `only`, on a random image.

    The memory serves that image, or `served`; what may be written is WRITABLE, or what the file `regions` says.
    """
    image = random_image(folder / "image.bin", image_bytes)
    if regions is None:
        regions = folder / "regions.txt"
        regions.write_text("".join(f"{first:x} {last:x}\n" for first, last in WRITABLE))
    description = {"image": str(image), "memory_bits": MEMORY_BITS, "queue": QUEUE, "writes": WRITES, "seed": SEED}
    description["writable"] = WRITABLE
    parameters = {"DATA_WIDTH": data_width, "MEMORY_BITS": MEMORY_BITS, "QUEUE": QUEUE, "WRITES": WRITES}
    parameters["ID_WIDTH"] = ID_WIDTH
    ports = ports_of_memory(data_width)
    sources, top = {"axi_memory.v": verilog}, "axi_memory"
    if data_width <= 512:  # what the checker watches
        limits = {"blocks": False, "reads": 64, "writes": 64, "ahead": 512}
        text = watched("axi_memory", ports, prefix="", parameters=parameters, **limits)
        sources, top, parameters = sources | {"watched.v": text}, "axi_memory_watched", {}
    return run_cocotb(
        top,
        sources,
        simulator,
        module=",".join(f"lightloom.verif.benches.{name}" for name in ("test_axi_memory", "test_axi_memory_writes")),
        public_ports=[*ports, *([*RULE_PORTS, "axi_forget"] if data_width <= 512 else [])],
        parameters=parameters,
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description), **({"COCOTB_TEST_FILTER": only} if only else {})},
        plusargs=[f"+image={served or image}", f"+writable={regions}"],
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
    assert bench(tmp_path, simulator, data_width) == 44


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
        ("if ((!rvalid || rready) &&", "if (", "[.]stalled", "a waiting beat changed"),
        ("due[tail] = latency == 0", "due[tail] = 1'b1", "[.]latency/|[.]latency$", r"latency \d+: "),
        ("BEAT_COST = 256", "BEAT_COST = 255", "bandwidth", r"beat \d+ after"),
        ("under_way} < QUEUE", "under_way} <= QUEUE", "bursts_under_way", "AssertionError"),
        ("refused[tail] = arburst != INCR ||", "refused[tail] =", "errors", "expected 0xdeadbeef"),
        ("engaged = 0;", "", "reset_in_flight", "AssertionError"),
        ("& ~turned(mask)) |", "& 0) |", "data_of_any_write", "assert "),
        ("turned(beat_data[place] & mask)", "turned(beat_data[place])", "errors_of_writes", "expected 0x"),
        ("wturn[wslot] == wnow_turn[wid[wslot]]", "1'b1", "writes_stalled.*100", "expected 0x"),
        ("wrandom[47:40] < reorder ?", "1'b0 ?", "writes_stalled.*100", "AssertionError"),
        ("if (wslot == filling) wscanning", "if (wslot == wtail) wscanning", "writes_stalled", "before the data"),
        ("& ~writable[first", "& ~{LANES{1'b1}} & ~writable[first", "bytes_that_may_not", "AssertionError"),
        ("if (response == OKAY && strobes != 0)", "if (strobes != 0)", "errors_of_writes", "expected 0x"),
        ("wunder_way} < WRITES", "wunder_way} <= WRITES", "writes_under_way", "AssertionError"),
        ("beat_next = 0;", "", "counters_of_writes", "AssertionError|hangs|violation"),
        ("whead != filling && (!bvalid || bready)", "whead != filling && (1'b1)", "writes_stalled", "changed|none"),
    ],
    ids=[
        *("bytes", "rest", "order", "in turn", "mixed", "hold", "latency", "bandwidth", "queue", "burst", "reset"),
        *("beside", "strobes", "write order", "overtaken", "half", "map", "failed", "writes", "write reset", "answer"),
    ],
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


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_regions_that_cannot_be(simulator: str, tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"axi_memory: .*/missing\.txt: cannot be read; name a file of regions with"):
        bench(tmp_path, simulator, 128, regions=tmp_path / "missing.txt", only="latency")
    for text, message in (("0 10\n20 1f\n", "0+20 to 0+1f is no region"), ("0 4000\n", "0+0 to 0+4000 is no region")):
        (tmp_path / "regions.txt").write_text(text)
        with pytest.raises(BenchError, match=f"axi_memory: .*/regions.txt: {message} of the memory"):
            bench(tmp_path, simulator, 128, regions=tmp_path / "regions.txt", only="latency")


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


@needs_icarus
@pytest.mark.icarus
def test_both_simulators_answer_writes_alike(tmp_path: Path) -> None:
    offered = []
    for simulator in ("verilator", "icarus"):
        folder = tmp_path / simulator
        folder.mkdir()
        bench(folder, simulator, 128, only="counters_of_writes")
        offered.append(json.loads((folder / "answered.json").read_text()))
    assert len(offered[0]) == 60
    assert offered[0] == offered[1]


def test_an_image_as_large_as_the_memory(tmp_path: Path) -> None:
    assert bench(tmp_path, "verilator", 128, image_bytes=1 << MEMORY_BITS, only="latency|errors") == 4


def test_speed_with_the_default_parameters(tmp_path: Path) -> None:
    verilator = toolchain.verilator()
    image = random_image(tmp_path / "image.bin", 5_000_000)
    options = ["--cc", "--prefix", "Vaxi_memory", "-O3", "--x-initial", "fast", "--no-timing", "-Wall"]
    command = [verilator.binary, *options, "--Mdir", str(tmp_path), str(SIM / "axi_memory.v")]
    toolchain.run(command, env=verilator.env)
    binary = tmp_path / "axi_memory"
    sources = [str(source) for source in [*tmp_path.glob("*.cpp"), SIM / "axi_memory.cpp"]]
    compile_ = [toolchain.compiler(), "-std=c++17", "-O1", "-DDATA_WIDTH=512", *verilator.include_options]
    compile_ += ["-I", str(tmp_path), *sources, *toolchain.verilated_runtime(), "-pthread", "-o", str(binary)]
    toolchain.run(compile_)
    cycles = 200_000
    regions = tmp_path / "regions.txt"
    regions.write_text(f"0 {image.stat().st_size - 1:x}\n")
    for latency, reorder, stall, writes in [(100, 0, 0, 0), (200, 100, 0, 0), (400, 100, 64, 0), (100, 100, 64, 100)]:
        run = [str(binary), str(image), *map(str, (cycles, latency, reorder, stall, writes)), f"+image={image}"]
        run += [f"+writable={regions}"] if writes else []
        done = subprocess.run(run, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        bursts, beats, written, rate, start = done.stdout.split()
        what = f"latency {latency}, reorder {reorder}, stall {stall}, writes {writes}"
        print(f"{what}: {rate} cycles/s, {beats} beats, {written} writes, {start} s to start")
        # A write waits for its address and its data, which stall apart, and at most 64 are under way.
        assert writes == 0 or 0.15 * cycles < int(written) < cycles * writes / 256 + 1000
        # A burst under way of 256 waits `latency` cycles; a stall takes a quarter of the cycles.
        expected = min(1 - stall / 256, 256 / latency)
        assert 0.9 * expected * cycles < int(beats) <= int(bursts) <= expected * cycles + 256
        assert float(rate) > (50_000 if writes else 200_000), "slower than what it is to serve"

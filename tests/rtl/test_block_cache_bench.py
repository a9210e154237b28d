"""The block cache on the memory of the simulations: its bench, many requests through C++; its Verilog is clean."""

import json
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lightloom.gen.verilog import convert
from lightloom.gen.watched import checker
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.fabric.queues import number_width
from lightloom.rtl.memory.axi import AxiRead
from lightloom.rtl.memory.block_cache import BlockCache
from lightloom.sim import toolchain, verilated
from lightloom.sim.runner import BenchError, run_cocotb
from tests import ROOT
from tests.gen.test_lint import WAIVERS, lint
from tests.simulators import SIMULATORS, needs_icarus

SIM = ROOT / "sim"
SYSTEM, MEMORY = SIM / "block_cache_system.v", SIM / "axi_memory.v"
SEED = 64
CACHES: dict[str, dict[str, int]] = {
    "least": {"sets": 2, "ways": 1, "misses": 1, "requests": 1, "data_width": 32},
    "small": {"sets": 4, "ways": 3, "misses": 6, "requests": 12, "data_width": 128},
    "large": {"sets": 64, "ways": 6, "misses": 48, "requests": 256, "data_width": 512},
}
PORTS = ["clk", "rst", "i__valid", "i__ready", "i__payload", "o__valid", "o__ready", "o__payload", "base", "invalidate"]
PORTS += ["prefetch__valid", "prefetch__block", "prefetching"]
PORTS += ["latency", "bandwidth", "reorder", "interleave", "stall", "seed", "error_enable", "error_first", "error_last"]
PORTS += ["violation", *RULE_PORTS, "read_bursts", "hits", "misses", "merges", "stalls", "evictions"]


@cache
def verilog(cache: str, tag_width: int) -> str:
    return convert(BlockCache(**CACHES[cache], tag_width=tag_width), "block_cache")


def checker_of(cache: str) -> str:
    shape = CACHES[cache]
    widths = {"data_width": shape["data_width"], "id_width": number_width(shape["misses"])}
    return checker(AxiRead(address_width=40, **widths))


def macros(cache: str, tag_width: int) -> dict[str, int]:
    shape = CACHES[cache]
    return {"TAG_BITS": tag_width, "DATA_BITS": shape["data_width"], "ID_BITS": number_width(shape["misses"])}


STEP = r"seed 64: block cache, step \d+, block \w+, fails (True|False): .* its state before: set \d, may hold \["
"""The first request that the model does not explain."""


def random_image(path: Path, blocks: int) -> Path:
    path.write_bytes(np.random.default_rng(SEED).bytes(blocks * 64))
    return path


def bench(folder: Path, simulator: str, cache: str, count: int, text: str | None = None, only: str = "") -> int:
    """Runs verif/benches/test_block_cache.py with `count` requests a test, or its tests whose names match `only`."""
    base = 0x1000
    image = random_image(folder / "image.bin", base // 64 + 2 * CACHES[cache]["sets"] * CACHES[cache]["ways"] + 100)
    description = {"image": str(image), "base": base, "count": count, "seed": SEED}
    description |= {name: CACHES[cache][name] for name in ("sets", "ways")}
    defines = "".join(f"`define {name} {value}\n" for name, value in macros(cache, 16).items())
    return run_cocotb(
        "block_cache_system",
        {
            "block_cache_system.v": defines + SYSTEM.read_text(encoding="utf-8"),
            "axi_memory.v": MEMORY.read_text(encoding="utf-8"),
            "block_cache.v": verilog(cache, 16) if text is None else text,
            "axi_checker.v": checker_of(cache),
        },
        simulator,
        module="lightloom.verif.benches.test_block_cache",
        public_ports=PORTS,
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description), **({"COCOTB_TEST_FILTER": only} if only else {})},
        plusargs=[f"+image={image}"],
        seed=SEED,
        folder=folder,
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_bench(simulator: str, tmp_path: Path) -> None:
    assert bench(tmp_path, simulator, "small", {"verilator": 600, "icarus": 200}[simulator]) == 14


@pytest.mark.parametrize("cache", CACHES)
def test_hundreds_of_thousands_of_requests(cache: str, tmp_path: Path) -> None:
    defines = [f"{name}={value}" for name, value in macros(cache, 10).items()]
    harness = SIM / "block_cache_system.cpp"
    text = verilog(cache, 10) + checker_of(cache)
    binary = verilated.build(cache, text, top=SYSTEM, others=[MEMORY], harness=harness, defines=defines)
    image = random_image(tmp_path / "image.bin", 9000)
    few = 20 if cache == "least" else 1

    def cycles(kind: str, count: int, *settings: int) -> int:
        command = [str(binary), str(image), kind, str(count), *map(str, settings), f"+image={image}"]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, f"{' '.join(command)}: {done.stderr}"
        return int(done.stdout.split()[0])

    # Stalls of both sides; latency, reorder, interleave, stalls of the memory; blocks prefetched.
    for settings in [(7, 100, 64, 1, 60, 40), (9, 0, 128, 1, 0, 0), (0, 37, 90, 0, 128, 255), (0, 100, 0, 0, 0, 0)]:
        cycles("rays", 100_000 // few, *settings)
    if cache == "large":
        # Half of the requests hit, and all misses are under way for about the latency: their number bounds the rate.
        assert cycles("half", 100_000, 0, 100, 0, 0, 0, 0) < 50_000 * 110 / CACHES[cache]["misses"]
        assert cycles("apart", 50_000, 0, 100, 0, 0, 0, 0) < 50_000 * 110 / CACHES[cache]["misses"]
        # With a fast memory there is an answer every cycle, whether they hit or not.
        assert cycles("apart", 50_000, 0, 0, 0, 0, 0, 0) < 50_000 * 1.001
        # Of a hot block, answers that have waited and hits of the same cycles come one after the other: a cycle in 98.
        assert cycles("rays", 100_000, 0, 0, 0, 0, 0, 0) < 100_000 * 1.011


@needs_icarus
@pytest.mark.icarus
@pytest.mark.parametrize(
    ("original", "mutant", "only", "message"),
    [
        # Answers have to wait, or they are out before the block that took the line is written.
        ("assign is_locked[0] = |", "assign is_locked[0] = 1'b0 &", "run=3", "wanted 0x"),
        (
            "assign at_end = { is_place1, is_place0 } == 2'h3;",
            "assign at_end = 1'b1;",
            "run=0",
            "error 1|Cannot convert|LogicArray",
        ),
        ("assign wrong = ", "assign wrong = 1'b0 & ", "errors", "block 3: error 0"),
        ("assign i__ready = ~ kept_valid;", "assign i__ready = 1'b1;", "run=2", "hangs"),
        ("if (answers) answer_tag", "if (1'b1) answer_tag", "run=5", "a waiting result changed"),
        (".r_en(entries_r_en)", ".r_en(1'b1)", "run=3", "answered twice|wanted 0x|hangs|never made"),
        ("assign is_used[1] = |", "assign is_used[1] = 1'b0 &", "step_by_step", STEP),
        ("assign evicts = |", "assign evicts = 1'b0 &", "step_by_step", STEP),
    ],
    ids=["lock", "beats", "error", "lost", "unstable", "list", "used", "evicts"],
)
def test_bench_catches_a_broken_cache(original: str, mutant: str, only: str, message: str, tmp_path: Path) -> None:
    text = verilog("small", 16)
    assert text.count(original) == 1
    with pytest.raises(BenchError, match=message):
        bench(
            tmp_path, "icarus", "small", 600 if message is STEP else 80, text=text.replace(original, mutant), only=only
        )


@pytest.mark.parametrize("cache", CACHES)
def test_verilog_is_clean(cache: str, tmp_path: Path) -> None:
    source = tmp_path / "block_cache.v"
    source.write_text(verilog(cache, 9))
    assert "initial" not in source.read_text()
    assert lint(WAIVERS, source, top="block_cache") == ""


@needs_icarus
@pytest.mark.icarus
def test_verilog_is_clean_for_icarus(tmp_path: Path) -> None:
    source = tmp_path / "block_cache.v"
    source.write_text(verilog("small", 9))
    command = [toolchain.icarus(), "-g2001", "-Wall", "-tnull", "-s", "block_cache", str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

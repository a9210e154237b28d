# amaranth: UnusedElaboratable=no
# (a stage is also made only to ask for its ports and its latency)
"""The leaf stage: its bench on both simulators, and what it is made of."""

import functools
import json
import subprocess
from pathlib import Path

import pytest

from lightloom.gen.verilog import convert, ports_of
from lightloom.golden_model.contract.formats import TRACE_ERRORS
from lightloom.rtl.config import PRESETS, Config
from lightloom.rtl.intersection.ray_time import RayTime
from lightloom.rtl.intersection.ray_triangle import RayTriangle, RayTriangleHalf
from lightloom.rtl.traversal.leaf import LeafStage
from lightloom.rtl.traversal.records import ERROR_BITS
from lightloom.sim import toolchain
from lightloom.sim.runner import run_cocotb
from tests import ROOT
from tests.simulators import needs_icarus

SEED = 1997
WAIVERS = ROOT / "gen" / "lint.vlt"
PAGE = ROOT / "docs" / "leaf_stage.md"
RAYS = {"verilator": 800, "icarus": 60}


@functools.cache
def verilog(config: Config) -> str:
    return convert(LeafStage(config), "leaf_stage")


ICARUS = [pytest.mark.icarus, needs_icarus]


@pytest.mark.parametrize(
    ("contexts", "interval", "simulator"),
    [
        *(pytest.param(*shape, "verilator") for shape in ((4, 1), (16, 1), (8, 2))),
        pytest.param(8, 2, "icarus", marks=ICARUS),
        # For every day the same on Verilator, with many more rays.
        *(pytest.param(*shape, "icarus", marks=[*ICARUS, pytest.mark.long]) for shape in ((4, 1), (16, 1))),
    ],
)
def test_bench(simulator: str, contexts: int, interval: int, tmp_path: Path) -> None:
    config = PRESETS["tiny"].but(contexts=contexts, triangle_interval=interval)
    stage = LeafStage(config)
    description = {
        "contexts": contexts,
        "latency": stage.latency,
        "interval": interval,
        "start_latency": stage.start_latency,
        "rays": RAYS[simulator],
        "seed": SEED + contexts,
    }
    ports = [name for name, _, _ in ports_of(stage)]
    passed = run_cocotb(
        "leaf_stage",
        {"leaf_stage.v": verilog(config)},
        simulator,
        module="lightloom.verif.benches.test_leaf_stage",
        public_ports=["clk", "rst", *ports],
        extra_env={"LIGHTLOOM_BENCH": json.dumps(description)},
        seed=SEED,
        folder=tmp_path,
    )
    assert passed == 9


@pytest.mark.parametrize("preset", PRESETS)
def test_latency_is_the_cores_and_seven_cycles(preset: str) -> None:
    config = PRESETS[preset]
    latency = LeafStage(config).latency
    core = RayTriangle(config) if config.triangle_test.interval == 1 else RayTriangleHalf(config)
    assert latency == core.latency + RayTime(config).latency + 7
    assert f"\n| {preset} | {latency} |\n" in PAGE.read_text(encoding="utf-8")


def test_every_error_has_a_code() -> None:
    assert max(TRACE_ERRORS.values()) < 1 << ERROR_BITS


@needs_icarus
@pytest.mark.parametrize("preset", ["tiny", "base"])
def test_lint(preset: str, tmp_path: Path) -> None:
    source = tmp_path / "leaf_stage.v"
    source.write_text(verilog(PRESETS[preset]))
    verilator = toolchain.verilator()
    command = [verilator.binary, "--lint-only", "-Wall", "--top-module", "leaf_stage", str(WAIVERS), str(source)]
    done = subprocess.run(command, env=verilator.env, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    command = [toolchain.icarus(), "-g2001", "-Wall", "-tnull", "-s", "leaf_stage", str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

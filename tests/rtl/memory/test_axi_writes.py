"""The writers of blocks behind their arbiter: their bench on both simulators, and what it has to find broken."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from lightloom.gen.verilog import convert
from lightloom.gen.watched import checker
from lightloom.golden_model.contract.axi_rules import RULE_PORTS
from lightloom.rtl.memory.axi import AxiWrite
from lightloom.rtl.memory.axi_write_arbiter import AxiWriteArbiter
from lightloom.rtl.memory.axi_writer import AxiWriter
from lightloom.sim.runner import BenchError, run_cocotb
from tests import ROOT
from tests.simulators import SIMULATORS, needs_icarus

SEED = 712
SIM = ROOT / "sim"
ID_BITS = 3
"""At the memory's port: a bit of them is the arbiter's."""
REGIONS = [(0x1000, 0x17FF), (0x2040, 0x293F)]
PORTS = ["clk", "rst", "abort", "aborting", "latency", "reorder", "stall", "seed", "violation", *RULE_PORTS]
PORTS += ["write_error_enable", "error_first", "error_last", "write_bursts", "write_beats"]
PORTS += ["arvalid", "arready", "araddr", "arid", "arlen", "arsize", "arburst"]
PORTS += ["rvalid", "rready", "rdata", "rid", "rresp", "rlast"]
PORTS += [f"i{k}__{name}" for k in range(2) for name in ("valid", "ready", "payload")]
OF_A_WRITER = ("base", "limit", "idle", "clear", "error", "error_block", "abort", "aborting")
PORTS += [f"{name}{k}" for k in range(2) for name in OF_A_WRITER]


@cache
def emitted(data_width: int) -> Mapping[str, str]:
    """The modules of the system that are made here: name to Verilog."""
    widths = {"address_width": 40, "data_width": data_width}
    writer = AxiWriter(writes=12, **widths, id_width=ID_BITS - 1)
    arbiter = AxiWriteArbiter(2, writes=24, **widths, id_width=ID_BITS - 1)
    return {
        "axi_writer": convert(writer, "axi_writer"),
        "axi_write_arbiter": convert(arbiter, "axi_write_arbiter"),
        "axi_checker": checker(AxiWrite(**widths, id_width=ID_BITS)),
    }


def bench(
    folder: Path, simulator: str, data_width: int, *, count: int, texts: Mapping[str, str] | None = None, only: str = ""
) -> int:
    """Runs verif/benches/test_axi_writes.py with `count` blocks a test and writer, or its tests that match `only`."""
    image, regions = folder / "image.bin", folder / "regions.txt"
    image.write_bytes(bytes(1 << 14))
    regions.write_text("".join(f"{first:x} {last:x}\n" for first, last in REGIONS))
    payload = 34 + 512 + 64
    macros = {"DATA_BITS": data_width, "ID_BITS": ID_BITS, "PAYLOAD_BITS": payload}
    defines = "".join(f"`define {name} {value}\n" for name, value in macros.items())
    top = "axi_writes_system"
    return run_cocotb(
        top,
        {
            f"{top}.v": defines + (SIM / f"{top}.v").read_text(encoding="utf-8"),
            "axi_memory.v": (SIM / "axi_memory.v").read_text(encoding="utf-8"),
            **{f"{name}.v": text for name, text in (texts or emitted(data_width)).items()},
        },
        simulator,
        module="lightloom.verif.benches.test_axi_writes",
        public_ports=PORTS,
        extra_env={
            "LIGHTLOOM_BENCH": json.dumps({"regions": REGIONS, "count": count, "seed": SEED}),
            **({"COCOTB_TEST_FILTER": only} if only else {}),
        },
        plusargs=[f"+image={image}", f"+writable={regions}"],
        seed=SEED,
        folder=folder,
    )


@pytest.mark.parametrize("data_width", [64, 512])
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_bench(simulator: str, data_width: int, tmp_path: Path) -> None:
    assert bench(tmp_path, simulator, data_width, count={"verilator": 150, "icarus": 40}[simulator]) == 15


@needs_icarus
@pytest.mark.icarus
@pytest.mark.parametrize(
    ("module", "original", "mutant", "only", "message"),
    [
        ("axi_writer", "assign idle = ! under_way", "assign idle = ! m_axi_awvalid", "fence", "bytes differ"),
        ("axi_writer", "assign allowed = ", "assign allowed = 1'b1 | ", "outside", "the memory says why"),
        (
            "axi_writer",
            "m_axi_wlast = beat == 3'h7",
            "m_axi_wlast = beat == 3'h6",
            "arrive/run=0",
            "w_last_early|the memory",
        ),
        (
            "axi_write_arbiter",
            "aborting ? last : ",
            "aborting ? 1'b0 : ",
            "arbiter/memory=far",
            "w_last_missing|the memory",
        ),
    ],
    ids=["fence", "bounds", "beats", "abort"],
)
def test_bench_catches_what_is_broken(
    module: str, original: str, mutant: str, only: str, message: str, tmp_path: Path
) -> None:
    texts = dict(emitted(64))
    assert texts[module].count(original) == 1
    texts[module] = texts[module].replace(original, mutant)
    with pytest.raises(BenchError, match=message):
        bench(tmp_path, "icarus", 64, count=40, texts=texts, only=only)

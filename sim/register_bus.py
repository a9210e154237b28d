"""A program in C with the registers of a unit that has a memory: compiled, and linked with the Verilated system."""

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from lightloom.gen.watched import axi_of, checker, ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.axi_rules import AXI_RULES
from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.rtl.config import Config
from lightloom.sim import verilated
from lightloom.sim.emitted import emitted

HERE = Path(__file__).parent
TOP, HARNESS, MEMORY = (HERE / name for name in ("register_bus.v", "register_bus.cpp", "axi_memory.v"))
WARNINGS = ("-Wall", "-Wextra", "-Werror")


def compiled(
    program: Path,
    unit: str,
    config: Config,
    *,
    includes: Sequence[Path],
    memory_bits: int = 20,
    verilog: str | None = None,
) -> Path:
    """The binary of a program in C that uses `register_bus.h`, with a unit of a configuration behind it.

    `includes` are folders of the program's other headers; the memory has 2**memory_bits bytes; `verilog` replaces the
    unit's text. No warning is let pass. Raises CalledProcessError where the program does not compile.
    """
    text = emitted(unit, config, bus="axi4-lite") if verilog is None else verilog
    ports = ports_of(text, f"{unit}_axi4_lite")
    defines = {
        "QUERY_BITS": bitpack.width(UNITS[unit].input),
        "RESULT_BITS": bitpack.width(UNITS[unit].output),
        "TAG_BITS": config.streams.tag_width,
        "BUS_ADDRESS_BITS": ports["s_axi_awaddr"].width,
        "ADDRESS_BITS": ports["m_axi_araddr"].width,
        "AXI_BITS": ports["m_axi_rdata"].width,
        "ID_BITS": ports["m_axi_arid"].width,
        "MEMORY_BITS": memory_bits,
        "RULE_BITS": len(AXI_RULES).bit_length(),
    }
    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        part = Path(scratch) / "program.o"
        paths = [f"-I{folder}" for folder in (HERE, *includes)]
        command = ["gcc", "-std=gnu11", "-O1", *WARNINGS, *paths, "-c", str(program), "-o", str(part)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return verilated.build(
            "registers",
            text + checker(axi_of(ports)),
            top=TOP,
            others=[MEMORY],
            harness=HARNESS,
            defines=[f"{name}={value}" for name, value in defines.items()],
            optimised=False,
            objects=[part],
        )

"""A program in C with the registers of a unit that has a memory: compiled, and linked with the Verilated system."""

import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.rtl.config import Config
from lightloom.sim.emitted import emitted
from lightloom.sim.system import System

HERE = Path(__file__).parent
HARNESS = HERE / "register_bus.cpp"
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
    with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
        part = Path(scratch) / "program.o"
        paths = [f"-I{folder}" for folder in (HERE, *includes)]
        command = ["gcc", "-std=gnu11", "-O1", *WARNINGS, *paths, "-c", str(program), "-o", str(part)]
        subprocess.run(command, check=True, capture_output=True, text=True)
        return System(
            f"{unit}_axi4_lite",
            text,
            input=UNITS[unit].input,
            output=UNITS[unit].output,
            tag_width=config.streams.tag_width,
            memory_bits=memory_bits,
            level=0,
            harness=HARNESS,
            objects=[part],
        ).binary

"""Which simulators this machine has, for tests that need one."""

import shutil

import pytest

from lightloom.sim import toolchain
from lightloom.sim.waves import LIBRARIES
from tests.needs import needs

needs_icarus = needs(shutil.which("iverilog") is not None, "Icarus Verilog is missing: apt install iverilog")
needs_gcc = needs(shutil.which("gcc") is not None, "no C compiler: apt install gcc")
needs_waves = needs(
    all(toolchain.has_header(header) for header in LIBRARIES),
    f"headers for waves are missing: apt install {' '.join(LIBRARIES.values())}",
)

SIMULATORS = ["verilator", pytest.param("icarus", marks=[pytest.mark.icarus, needs_icarus])]

"""Which simulators this machine has, for tests that need one."""

import os
import shutil

import pytest

from lightloom.sim import toolchain
from lightloom.sim.waves import LIBRARIES

needs_icarus = pytest.mark.skipif(
    shutil.which("iverilog") is None and not os.environ.get("CI"),
    reason="Icarus Verilog is missing: apt install iverilog",
)
"""In continuous integration a missing simulator is a failure, not a reason to leave tests out."""

needs_gcc = pytest.mark.skipif(
    shutil.which("gcc") is None and not os.environ.get("CI"),
    reason="no C compiler: apt install gcc",
)

needs_waves = pytest.mark.skipif(
    not all(toolchain.has_header(header) for header in LIBRARIES) and not os.environ.get("CI"),
    reason=f"headers for waves are missing: apt install {' '.join(LIBRARIES.values())}",
)

SIMULATORS = ["verilator", pytest.param("icarus", marks=[pytest.mark.icarus, needs_icarus])]

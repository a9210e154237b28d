"""Which simulators this machine has, for tests that need one."""

import os
import shutil

import pytest

needs_icarus = pytest.mark.skipif(
    shutil.which("iverilog") is None and not os.environ.get("CI"),
    reason="Icarus Verilog is missing: apt install iverilog",
)
"""In continuous integration a missing simulator is a failure, not a reason to leave tests out."""

SIMULATORS = ["verilator", pytest.param("icarus", marks=[pytest.mark.icarus, needs_icarus])]

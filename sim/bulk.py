"""The bulk vector harness: a C++ loop around a Verilated unit, binary operands in, binary results out."""

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from lightloom.gen.manifest import manifest
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import PURE, Unit
from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim import verilated
from lightloom.sim.emitted import emitted

HARNESS = Path(__file__).with_name("bulk.cpp")
TOP = Path(__file__).with_name("bulk.v")
CHUNK = 1 << 20
"""Vectors a process: bounds the size of the operand and result files."""


class BulkError(AssertionError):
    """The unit broke the stream's rules: a wrong tag, a lost or extra result, a hang."""


class BulkUnit:
    """A Verilated unit that takes operand arrays.

    Parameters: `unit`, a name of `golden_model.contract.interfaces.PURE` or, with its `verilog`, a unit of one's own;
    `config`, the hardware parameters; `verilog`, a text other than the emitted one, of any initiation interval if it is
    not `optimised`: then the simulator is compiled in a fraction of the time, which is enough for a run of thousands.
    Builds the simulator, or finds it in the cache. Raises InputError for an unknown unit or a missing tool.

    Attributes after `run`: `throughput` (vectors/s of the simulation, on one core, without packing), `cycles` (clock
    cycles of the last run), `latency` (cycles from the first operand to its result; exact where nothing stalled).
    """

    def __init__(
        self, unit: str | Unit, config: Config = PRESETS["base"], *, verilog: str | None = None, optimised: bool = True
    ):
        if isinstance(unit, str) and unit not in PURE:
            raise InputError(f"{unit}: no such unit; known are {', '.join(sorted(PURE))}")
        self.unit = PURE[unit] if isinstance(unit, str) else unit
        self.config = config
        self.verilog = emitted(self.unit.name, config) if verilog is None else verilog
        """The text that is simulated; tests pass a deliberately broken one."""
        self._binaries: dict[bool, Path] = {}
        # A unit that does not take an operation every cycle stalls its input by itself, and one that is not in the
        # catalogue may; who is in a hurry builds once.
        known = isinstance(unit, str)
        self._stalling = not (optimised and known) or manifest(self.unit.name, config)["initiation_interval"] > 1
        self._optimised = optimised
        self._binary(stalls=self._stalling)
        self.throughput = 0.0
        self.cycles = 0
        self.latency = 0

    def run(self, operands: np.ndarray, *, stall_seed: int | None = None) -> np.ndarray:
        """Operands (N,) of the unit's input dtype to results (N,) of its output dtype, in order.

        Without `stall_seed` an operand is offered every cycle and every result taken at once; with it (1 to 2**63 - 1)
        both sides stall at random. Raises BulkError where the unit breaks the stream's rules.
        """
        if operands.dtype != self.unit.input:
            raise TypeError(f"{self.unit.name} takes operands of dtype {self.unit.input}, not {operands.dtype}")
        if stall_seed is not None and not 0 < stall_seed < 1 << 63:
            raise ValueError("stall_seed must be 1 to 2**63 - 1")
        results = np.empty(len(operands), dtype=self.unit.output)
        seconds = 0.0
        self.cycles = 0
        binary = self._binary(stalls=self._stalling or stall_seed is not None)
        with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
            for start in range(0, len(operands), CHUNK):
                chunk = operands[start : start + CHUNK]
                results[start : start + CHUNK], cycles, elapsed = self._chunk(
                    binary, Path(scratch), chunk, stall_seed or 0
                )
                self.cycles += cycles
                seconds += elapsed
        self.throughput = len(operands) / seconds if seconds else 0.0
        return results

    def _chunk(self, binary: Path, scratch: Path, operands: np.ndarray, seed: int) -> tuple[np.ndarray, int, float]:
        source, target = scratch / "operands", scratch / "results"
        words = bitpack.words(self.unit.output)
        bitpack.pack(operands).tofile(source)
        with target.open("wb") as file:
            file.truncate(len(operands) * words * 4)
        command = [str(binary), str(source), str(target), str(len(operands)), str(seed)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise BulkError(f"{self.unit.name} (stall seed {seed}): {done.stderr.strip() or done.returncode}")
        cycles, latency, elapsed = done.stdout.split()
        self.latency = int(latency)
        packed = np.fromfile(target, dtype=np.uint32).reshape(-1, words)
        return bitpack.unpack(packed, self.unit.output), int(cycles), float(elapsed)

    def _binary(self, stalls: bool) -> Path:
        """The simulator that may stall, or the one that never does; built at the first use."""
        if stalls not in self._binaries:
            self._binaries[stalls] = self._build(stalls)
        return self._binaries[stalls]

    def _build(self, stalls: bool) -> Path:
        defines = [
            f"UNIT={self.unit.name}",
            f"INPUT_BITS={bitpack.width(self.unit.input)}",
            f"OUTPUT_BITS={bitpack.width(self.unit.output)}",
            f"TAG_BITS={self.config.streams.tag_width}",
            *(["STALLS"] if stalls else []),
        ]
        return verilated.build(
            self.unit.name, self.verilog, top=TOP, harness=HARNESS, defines=defines, level=2 if self._optimised else 0
        )

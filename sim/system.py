"""A whole system around any unit, in C++: its streams, its ports, and the memory of the simulations behind it.

What the harness has to know is what the unit's Verilog declares: `System` finds its streams, its memory port, the bus
that it may be behind, and of all other ports the controls, statuses and counters. None of them needs C++ of its own.
"""

import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lightloom.gen.watched import Port, axi_of, checker, ports_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.axi_rules import AXI_RULES, rule_of
from lightloom.golden_model.host.errors import InputError
from lightloom.sim import verilated

HERE = Path(__file__).parent
TOP, HARNESS, HEADER, MEMORY = (HERE / name for name in ("system.v", "system_run.cpp", "system.h", "axi_memory.v"))
STREAMS = ("clk", "rst", "i__valid", "i__ready", "i__payload", "o__valid", "o__ready", "o__payload")
COUNT = "count_"
"""Begins the names of outputs that are counters."""
FIGURES = ("read_bursts", "read_beats", "busy_cycles", "write_bursts", "write_beats")
"""What the memory counts, in the order of the top's port."""
PATIENCE = 10_000_000
"""Cycles without an operand taken or a result given, if nobody knows better."""


class RunError(AssertionError):
    """The unit broke the rules of its streams or of AXI: a tag that is no operand's, a lost result, a hang."""


class Place(NamedTuple):
    """Some bits of the top's controls or statuses."""

    low: int
    width: int


@dataclass(frozen=True, kw_only=True)
class Manner:
    """How the memory answers: its inputs (docs/axi_memory.md)."""

    latency: int = 100
    bandwidth: int = 256
    reorder: int = 0
    interleave: int = 0
    stall: int = 0
    seed: int = 1
    error_enable: int = 0
    write_error_enable: int = 0
    error_first: int = 0
    error_last: int = 0


@dataclass(frozen=True, kw_only=True)
class Content:
    """What lies in the memory."""

    base: int = 0
    """Byte address of `image`; all else is 0."""
    image: bytes = b""
    writable: Sequence[tuple[int, int]] = ()
    """First and last byte of regions that may be written; a byte outside of them breaks a rule."""
    read_back: tuple[int, int] | None = None
    """First and last byte of what is looked at in the end: whole words of the bus."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SystemRun:
    """What came out of a run."""

    results: np.ndarray
    """(N,) of the unit's output dtype, in the order of the operands."""
    cycles: int
    """From the first operand that was taken to the last result."""
    counters: dict[str, int]
    """The unit's, without "count_"."""
    statuses: dict[str, int]
    """The unit's other outputs, when the first operand was offered."""
    figures: dict[str, int]
    """The memory's, in these cycles."""
    most_in_flight: int
    """Operands that were in the unit at a time, at most."""
    throughput: float
    """Cycles/s of the simulation, on one core."""
    memory: bytes = b""
    """What was to be read back."""


def strobe(control: str) -> list[str]:
    """A step of `System.run`: a control is 1 for a cycle."""
    return ["strobe", control]


def until(statuses: Sequence[str], failure: str) -> list[str]:
    """A step of `System.run`: one of the statuses becomes other than 0. `failure` says what happens if none does."""
    return ["await", failure, *statuses]


@dataclass(frozen=True)
class Shape:
    """The ports of a unit as the top has them."""

    ports: Mapping[str, Port]
    controls: dict[str, Place] = field(default_factory=dict)
    statuses: dict[str, Place] = field(default_factory=dict)
    counters: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, ports: Mapping[str, Port]) -> "Shape":
        shape = cls(ports)
        address = shape._address_width
        widths = {"latency": 16, "bandwidth": 9, "reorder": 8, "interleave": 1, "stall": 8, "seed": 32}
        widths |= {"error_enable": 1, "write_error_enable": 1, "error_first": address, "error_last": address}
        for name, width in widths.items() if shape.has_memory else ():
            shape._place(shape.controls, f"memory.{name}", width)
        for name, port in ports.items():
            if name in STREAMS or name.startswith(("m_axi_", "s_axi_")) or (name == "irq" and shape.has_bus):
                continue
            if port.direction == "input":
                shape._place(shape.controls, name, port.width)
            elif name.startswith(COUNT):
                shape.counters.append(name.removeprefix(COUNT))
            else:
                shape._place(shape.statuses, name, port.width)
        return shape

    @staticmethod
    def _place(places: dict[str, Place], name: str, width: int) -> None:
        places[name] = Place(sum(one.width for one in places.values()), width)

    @property
    def has_memory(self) -> bool:
        return "m_axi_arvalid" in self.ports or "m_axi_awvalid" in self.ports

    @property
    def has_bus(self) -> bool:
        return "s_axi_awvalid" in self.ports

    @property
    def _address_width(self) -> int:
        return axi_of(self.ports).ports[0].address_width if self.has_memory else 0

    def connections(self) -> str:
        """Of the unit's ports to parts of the top's, as Verilog."""
        parts = [f".{name}(set[{low}+:{width}])," for name, (low, width) in self.controls.items() if "." not in name]
        parts += [f".{name}(statuses[{low}+:{width}])," for name, (low, width) in self.statuses.items()]
        widths = [self.ports[COUNT + name].width for name in self.counters]
        parts += [
            f".{COUNT}{name}(counters[{64 * k}+:{width}]),"
            for k, (name, width) in enumerate(zip(self.counters, widths, strict=True))
        ]
        return "".join(parts)

    def defines(self) -> dict[str, int | str]:
        """Macros of the top and the harness."""
        macros: dict[str, int | str] = {
            "CONTROL_BITS": sum(one.width for one in self.controls.values()) or 1,
            "STATUS_BITS": sum(one.width for one in self.statuses.values()) or 1,
            "COUNTER_NUMBER": len(self.counters),
            "COUNTER_BITS": 64 * len(self.counters) or 1,
            "PORTS": self.connections(),
        }
        if self.has_bus:
            macros |= {"BUS": 1, "BUS_ADDRESS_BITS": self.ports["s_axi_awaddr"].width}
        if self.has_memory:
            axi = axi_of(self.ports).ports[0]
            macros |= {"MEMORY": 1, "ADDRESS_BITS": axi.address_width, "AXI_BITS": axi.data_width}
            macros |= {"ID_BITS": axi.id_width, "RULE_BITS": len(AXI_RULES).bit_length()}
            macros |= {
                name: 1
                for name, signal in (("READS", "arvalid"), ("WRITES", "awvalid"))
                if f"m_axi_{signal}" in self.ports
            }
            places = {name.removeprefix("memory."): place for name, place in self.controls.items() if "." in name}
            macros |= {f"MEMORY_{name.upper()}": f"{low},{width}" for name, (low, width) in places.items()}
        return macros


class System:
    """A unit's Verilog, Verilated, with a memory behind it where it has a port for one.

    `input` and `output` are the dtypes of its streams. The memory holds 2**memory_bits bytes. `level` is that of
    `sim.verilated.build`. `harness` is the C++ that runs it, and `objects` what is linked with it (`sim.register_bus`).
    Builds the simulator, or finds it in the cache. Raises InputError for a missing tool.
    """

    def __init__(
        self,
        module: str,
        verilog: str,
        *,
        input: np.dtype,
        output: np.dtype,
        tag_width: int,
        memory_bits: int = 20,
        level: int = 2,
        harness: Path = HARNESS,
        objects: Sequence[Path] = (),
    ):
        self.module, self.input, self.output = module, input, output
        self.shape = Shape.of(ports_of(verilog, module))
        self.memory_bytes = 1 << memory_bits
        defines = self.shape.defines() | {
            "UNIT": module,
            "INPUT_BITS": bitpack.width(input),
            "OUTPUT_BITS": bitpack.width(output),
            "TAG_BITS": tag_width,
            "MEMORY_BITS": memory_bits,
        }
        others = [MEMORY] if self.shape.has_memory else []
        self.binary = verilated.build(
            module,
            verilog + (checker(axi_of(self.shape.ports)) if others else ""),
            top=TOP,
            others=others,
            harness=harness,
            headers=[HEADER],
            defines=[f"{name}={value}" for name, value in defines.items()],
            level=level,
            objects=objects,
        )

    def run(
        self,
        operands: np.ndarray,
        *,
        controls: Mapping[str, int] | None = None,
        steps: Sequence[Sequence[str]] = (),
        manner: Manner | None = None,
        content: Content | None = None,
        stall_seed: int | None = None,
        patience: int = PATIENCE,
        working: Sequence[str] = (),
    ) -> SystemRun:
        """Operands (N,) of the unit's input dtype to what comes out.

        `controls` are set from the reset on, the others are 0; `steps` (`strobe`, `until`) come before the first
        operand. With a `stall_seed` (1 to 2**63 - 1) both sides of the streams stall at random. A unit hangs where for
        long neither an operand is taken, nor a result given, nor the memory is used, nor one of the counters that are
        called `working` moves; and where for `patience` cycles no operand is taken and no result given. Raises
        RunError where the unit breaks a rule, InputError where the image is larger than the memory.
        """
        content, manner, controls = content or Content(), manner or Manner(), dict(controls or {})
        self._check(operands, content, stall_seed)
        if self.shape.has_memory:
            controls = {f"memory.{name}": value for name, value in asdict(manner).items()} | controls
        words = bitpack.words(self.output)
        with tempfile.TemporaryDirectory(prefix="lightloom-") as scratch:
            folder = Path(scratch)
            bitpack.pack(operands).tofile(folder / "operands")
            with (folder / "results").open("wb") as file:
                file.truncate(len(operands) * words * 4)
            command = [str(self.binary), "operands", "results", str(len(operands)), str(stall_seed or 0), str(patience)]
            command += self._steps(controls, steps, working)
            command += self._memory(folder, content) if self.shape.has_memory else []
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
            if done.returncode:
                raise RunError(f"{self.module} ({controls}): {_failure(done)}")
            packed = np.fromfile(folder / "results", dtype=np.uint32).reshape(-1, words)
            memory = _read_back(folder / "written") if content.read_back else b""
        return self._told(done.stdout, bitpack.unpack(packed, self.output), memory)

    def _check(self, operands: np.ndarray, content: Content, stall_seed: int | None) -> None:
        if operands.dtype != self.input:
            raise TypeError(f"operands are of dtype {self.input}, not {operands.dtype}")
        if stall_seed is not None and not 0 < stall_seed < 1 << 63:
            raise ValueError("stall_seed must be 1 to 2**63 - 1")
        if content.base + len(content.image) > self.memory_bytes:
            raise InputError(
                f"{len(content.image):,} bytes at {content.base:,} are more than the simulated memory holds, "
                f"{self.memory_bytes:,}"
            )

    def _steps(self, controls: Mapping[str, int], steps: Sequence[Sequence[str]], working: Sequence[str]) -> list[str]:
        """What the harness is told to do before the first operand."""
        told: list[str] = []
        for name, value in controls.items():
            told += ["set", *map(str, self.shape.controls[name]), str(int(value))]
        for kind, *of in steps:
            if kind == "strobe":
                told += ["strobe", str(self.shape.controls[of[0]].low)]
            else:
                places = [str(number) for name in of[1:] for number in self.shape.statuses[name]]
                told += ["await", of[0], str(len(of) - 1), *places]
        for name in working:
            told += ["watch", str(self.shape.counters.index(name))]
        return told

    def _memory(self, folder: Path, content: Content) -> list[str]:
        """Files of the memory, and how it is told of them."""
        with (folder / "image").open("wb") as file:
            file.seek(content.base)
            file.write(content.image)
        told = ["+image=image"]
        if content.writable:
            (folder / "regions").write_text("".join(f"{first:x} {last:x}\n" for first, last in content.writable))
            told.append("+writable=regions")
        if content.read_back:
            told += [
                "+written=written",
                *(f"+{name}={at:x}" for name, at in zip(("from", "to"), content.read_back, strict=True)),
            ]
        return told

    def _told(self, text: str, results: np.ndarray, memory: bytes) -> SystemRun:
        lines = [line.split() for line in text.splitlines()]
        figure = dict(lines)
        bits = sum(int(word, 16) << 32 * k for k, word in enumerate(figure["statuses"].strip(",").split(",")))
        numbers = {kind: [int(value) for name, value in lines if name == kind] for kind in ("counter", "figure")}
        return SystemRun(
            results=results,
            cycles=int(figure["cycles"]),
            counters=dict(zip(self.shape.counters, numbers["counter"], strict=True)),
            statuses={name: bits >> low & ((1 << width) - 1) for name, (low, width) in self.shape.statuses.items()},
            figures=dict(zip(FIGURES, numbers["figure"], strict=True)),
            most_in_flight=int(figure["most_in_flight"]),
            throughput=int(figure["simulated"]) / float(figure["seconds"]),
            memory=memory,
        )


def _failure(done: "subprocess.CompletedProcess[str]") -> str:
    """What a run that ended badly says, in one line."""
    lines = done.stdout.splitlines()
    said = [line for line in lines if line.startswith("axi_memory:")][:1]
    rules = [line.split()[1:] for line in lines if line.startswith("axi_rules ")]
    broken = [rule_of(int(number)) for numbers in rules for number in numbers if int(number)]
    return "; ".join([done.stderr.strip() or str(done.returncode), *broken, *said])


def _read_back(path: Path) -> bytes:
    """The bytes of a file of $writememh, in which a word's first byte is the highest."""
    words = [line for line in path.read_text().splitlines() if not line.startswith(("@", "//"))]
    return bytes.fromhex("".join(words))

"""Synthesis of a unit's Verilog with Yosys: what it is made of, in gates without a process and in cells of a library.

In steps, each in a folder and each leaving files that the next one reads, so that a unit is elaborated once for all
libraries:

    elaborate   <unit>.v -> gates.il: gates of Yosys's own, flip-flops, memories that are kept out
    count       <unit>.v -> gate equivalents
    parts       <unit>.v -> gate equivalents of its modules
    mapped      gates.il -> mapped.v, cells of a library, and their area

What is counted is said in docs/synthesis.md.
"""

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from lightloom.gen.flow import fanout, libraries, tools
from lightloom.gen.flow.fanout import Buffer
from lightloom.gen.flow.libraries import Library
from lightloom.gen.flow.memories import Memory, cut_out
from lightloom.rtl.fabric.memory import KINDS

MEMORY = re.compile(r"^\s*reg (?:\[[^\]]*\] )?\S+ \[[^\]]*\];", re.MULTILINE)
"""An array in the emitted Verilog."""

FLIP_FLOP = re.compile(r"\$_\w*DFF\w*_")
"""Flip-flops among Yosys's own cells."""

# Not `share`, which proves for hours that parts of large units are not used at once, and finds nothing in small ones.
# -noabc: the technology-independent mapping in `synth` turns prefix adders into chains, which the one to the library
# does not undo.
SYNTH = "synth -noabc -noshare -booth -top {top}"

# The count of the literature: two-input NANDs and NORs, and inverters, a gate being four transistors.
COUNT = "abc -g cmos2\nopt_clean -purge\ntee -q -o {file} stat -json\n"
TRANSISTORS = {"$_NAND_": 4, "$_NOR_": 4, "$_NOT_": 2, "$_DFF_P_": 16}
TRANSISTORS_A_GATE = 4

# Every register as a plain flip-flop: its enable and its reset become gates that are counted like all others.
PLAIN_FLIP_FLOPS = "dfflegalize -cell $_DFF_P_ x\nopt_clean\n"

FLATTEN = "setattr -mod -unset keep_hierarchy *\nflatten\n"

MAPPING = "strash\ndch\nmap -B 0.9\ntopo\nbuffer -N 8\nupsize\ndnsize\n"
"""ABC's steps to a library. Without the buffers, nets of high fan-out ruin the timing. Not `buffer -c`, which counts
the library's wire loads, where the timing has no wires: a large design then gets a buffer behind every gate."""


@dataclass(frozen=True)
class Part:
    """A module of the hierarchy: how often it is there, and its own gates (those of modules in it are theirs)."""

    module: str
    instances: int
    gates: int
    """Gate equivalents of one instance, its flip-flops among them."""


@dataclass(frozen=True)
class Elaborated:
    """A unit in Yosys's own gates, written to gates.il."""

    flip_flops: int
    memories: tuple[Memory, ...]
    """Those that were kept out of the gates."""

    @property
    def memory_bits(self) -> int:
        return sum(memory.bits for memory in self.memories)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "Elaborated":
        return cls(data["flip_flops"], tuple(Memory(**memory) for memory in data["memories"]))


@dataclass(frozen=True)
class Gates:
    """Two-input-gate equivalents: transistors of `abc -g cmos2` divided by four."""

    logic: int
    """Without flip-flops, as published figures are counted."""
    everything: int
    """With all flip-flops, their enables and resets."""


@dataclass(frozen=True)
class Mapped:
    """A unit in cells of a library; areas in the library's unit, square micrometres in all libraries known here."""

    cells: int
    area: float
    flip_flop_area: float


def elaborate(verilog: str, top: str, folder: Path, memory_bits: int) -> Elaborated:
    """Elaborates the module `top` and writes gates.il into `folder`.

    Memories of at least `memory_bits` bits with synchronous reads are kept out of the gates. Raises InputError where
    Yosys is missing.
    """
    (folder / "unit.v").write_text(verilog, encoding="utf-8")
    script, memories = _script(verilog, top, folder, memory_bits, "shared")
    tools.yosys(f"{script}write_rtlil gates.il\n{FLATTEN}tee -q -o gates.json stat -json\n", folder, "elaborate")
    cells = _cells(folder / "gates.json", top)
    return Elaborated(sum(cells.values()) - sum(_without_flip_flops(cells).values()), tuple(memories))


def count(verilog: str, top: str, folder: Path, memory_bits: int) -> Gates:
    """Gate equivalents of the module `top`, flattened first, as publications count them."""
    (folder / "unit.v").write_text(verilog, encoding="utf-8")
    elaborated, _ = _script(verilog, top, folder, memory_bits, "flat")
    logic, everything = (COUNT.format(file=name) for name in ("logic.json", "everything.json"))
    script = f"{elaborated}abc\nopt -fast\ndesign -save fast\n{logic}"
    tools.yosys(f"{script}design -load fast\n{PLAIN_FLIP_FLOPS}{everything}", folder, "count")
    return Gates(
        logic=_gates(_without_flip_flops(_cells(folder / "logic.json", top))),
        everything=_gates(_cells(folder / "everything.json", top)),
    )


HIERARCHY = {
    "flat": (" -flatten", ""),
    # All but what is there several times, or could be: the cores, whose modules are named <unit>_…
    "shared": (
        " -flatten",
        "setattr -mod -set keep_hierarchy 1 {top}_*\n"
        + "".join(f"setattr -mod -unset keep_hierarchy {{top}}_{kind}_*\n" for kind in KINDS),
    ),
    "hierarchical": ("", ""),
}
"""What is flattened: an option of `synth`, and what goes before it."""


def _script(verilog: str, top: str, folder: Path, memory_bits: int, name: str) -> tuple[str, list[Memory]]:
    """A script that leaves Yosys with the design's gates, and the memories that are not in it."""
    flatten, before = HIERARCHY[name]
    synth = SYNTH.format(top=top) + flatten
    read = f"read_verilog unit.v\nhierarchy -top {top}\n{before.format(top=top)}"
    # Where things come from in the Verilog is of no use to anybody, and most of the text of a design.
    forget = "setattr -unset src\nsetattr -unset src *\n"
    if not MEMORY.search(verilog):
        return f"{read}{synth}\n{forget}", []
    tools.yosys(f"{read}{synth} -run begin:fine\n{forget}write_json {name}.json\n", folder, name)
    file = folder / f"{name}.json"
    design = json.loads(file.read_text(encoding="utf-8"))
    memories = cut_out(design, memory_bits)
    file.write_text(json.dumps(design), encoding="utf-8")
    return f"read_json {name}.json\nhierarchy -top {top}\n{synth} -run fine:check\n", memories


def parts(verilog: str, top: str, folder: Path, memory_bits: int) -> list[Part]:
    """The modules of the unit, each synthesised on its own: those with most gates over all instances first."""
    (folder / "unit.v").write_text(verilog, encoding="utf-8")
    script, _ = _script(verilog, top, folder, memory_bits, "hierarchical")
    tools.yosys(f"{script}abc\nopt -fast\n{PLAIN_FLIP_FLOPS}{COUNT.format(file='modules.json')}", folder, "modules")
    modules = _stat(folder / "modules.json")["modules"]
    instances: Counter[str] = Counter()

    def visit(module: str) -> None:
        instances[module] += 1
        for kind, count in modules[module]["num_cells_by_type"].items():
            for _ in range(count if f"\\{kind}" in modules else 0):
                visit(f"\\{kind}")

    visit(f"\\{top}")
    found = [
        Part(module.lstrip("\\"), count, _gates(modules[module]["num_cells_by_type"]))
        for module, count in instances.items()
    ]
    return sorted(found, key=lambda part: (-part.instances * part.gates, part.module))


def mapped(folder: Path, elaborated: Path, library: Library, top: str) -> Mapped:
    """Maps gates.il of the folder `elaborated` to cells, and writes mapped.v into `folder`.

    The library's files are in `folder` already.
    """
    (folder / "gates.il").write_bytes((elaborated / "gates.il").read_bytes())
    (folder / "mapping.abc").write_text(MAPPING)
    known = fanout.buffers(library)
    # Else ABC takes the outputs of registers for as strong as can be, and leaves one that drives a hundred cells alone.
    (folder / "mapping.constr").write_text(f"set_driving_cell {known[0].cell}\n")
    sequential, gates = libraries.sequential(library), libraries.combinational(library)
    read = "\n".join(f"read_liberty -lib -ignore_miss_func {file}" for file in library.file_names)
    script = f"""read_rtlil gates.il
{read}
dfflibmap {_liberties(sequential)}
# Registers are named after what they hold, so that a critical path reads in the unit's own names.
splitnets
rename -wire -suffix _reg t:$_* %n
write_json registers.json
"""
    tools.yosys(script, folder, "registers")
    # Before mapping: else ABC takes the enable of all registers for the slowest net, and sizes nothing else.
    _spread(folder / "registers.json", known, fanout.HUGE)
    script = f"""read_json registers.json
# Cores one by one: ABC's sizing ends after a number of steps, which is too few for a large design in one piece.
abc {_liberties(gates)} -constr mapping.constr -script mapping.abc
{FLATTEN}opt_clean -purge
write_json netlist.json
"""
    tools.yosys(script, folder, "mapping")
    _spread(folder / "netlist.json", known, fanout.LARGE)
    script = f"""read_json netlist.json
opt_clean -purge
tee -q -o cells.json stat -json -top {top} {_liberties(library.file_names)}
write_verilog -noattr -noexpr -simple-lhs mapped.v
"""
    tools.yosys(script, folder, "netlist")
    for name in ("gates.il", "registers.json", "netlist.json"):
        (folder / name).unlink()
    found = _stat(folder / "cells.json")["modules"][f"\\{top}"]
    # Macros stand beside the cells; they have no area in any of the files.
    macros = sum(n for cell, n in found["num_cells_by_type"].items() if cell.startswith("ram_"))
    return Mapped(found["num_cells"] - macros, found["area"], found["sequential_area"])


def _spread(file: Path, known: list[Buffer], size: int) -> None:
    """Puts trees of buffers on the nets of all modules in a file of Yosys's JSON that have more than `size` cells."""
    design = json.loads(file.read_text(encoding="utf-8"))
    for module in design["modules"]:
        fanout.spread(design, module, known, size)
    file.write_text(json.dumps(design), encoding="utf-8")


def _liberties(names: list[str]) -> str:
    return " ".join(f"-liberty {name}" for name in names)


def _stat(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text(encoding="utf-8"))


def _cells(file: Path, top: str) -> dict[str, int]:
    return _stat(file)["modules"][f"\\{top}"]["num_cells_by_type"]


def _gates(cells: Mapping[str, int]) -> int:
    """Gate equivalents of cells; what is not of Yosys's own gates, such as flip-flops with enables, counts nothing."""
    return round(sum(TRANSISTORS.get(cell, 0) * count for cell, count in cells.items()) / TRANSISTORS_A_GATE)


def _without_flip_flops(cells: Mapping[str, int]) -> dict[str, int]:
    return {cell: count for cell, count in cells.items() if not FLIP_FLOP.fullmatch(cell)}

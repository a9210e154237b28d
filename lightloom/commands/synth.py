"""`lightloom synth`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lightloom.golden_model.host.errors import InputError
from lightloom.rtl.config import PRESETS
from lightloom.shared.inputs import at_least, choose
from lightloom.shared.options import Json, Seed, command

if TYPE_CHECKING:
    from lightloom.hardware.synthesis import Measured, Options, Source

VECTORS = 20_000
"""Operands a netlist of --check, besides the corner cases."""


@dataclass(frozen=True, kw_only=True)
class SynthOptions:
    """The options, in the order of the help text."""

    units: Annotated[
        list[str] | None, typer.Argument(metavar="UNIT", help="Names of units; all of them if none is given.")
    ] = None
    preset: Annotated[
        list[str] | None,
        typer.Option("--preset", metavar="|".join(PRESETS), help="Hardware parameters (repeatable), else base."),
    ] = None
    liberty: Annotated[
        list[Path] | None,
        typer.Option("--liberty", metavar="FILE", help="Liberty file of standard cells, also .gz (repeatable)."),
    ] = None
    pdk: Annotated[
        str | None, typer.Option("--pdk", metavar="ihp-sg13g2|asap7", help="A PDK whose files are below --pdk-root.")
    ] = None
    pdk_root: Annotated[Path | None, typer.Option("--pdk-root", metavar="DIR", help="Where the PDK is.")] = None
    corner: Annotated[str, typer.Option("--corner", metavar="typ|slow", help="The corner of the PDK.")] = "typ"
    clock: Annotated[
        float | None,
        typer.Option("--clock", metavar="NS", help="Clock period that is asked for; else 5 ns, or what suits the PDK."),
    ] = None
    macros: Annotated[
        list[Path] | None,
        typer.Option("--macros", metavar="FILE", help="Liberty file of memory macros, for an estimate (repeatable)."),
    ] = None
    memory_bits: Annotated[
        int, typer.Option("--memory-bits", metavar="N", help="Memories of fewer bits become flip-flops.")
    ] = 256
    access: Annotated[
        float, typer.Option("--access", metavar="PART", help="When a memory's word is there, in clock periods.")
    ] = 0.5
    setup: Annotated[
        float, typer.Option("--setup", metavar="PART", help="Set-up time of a memory's inputs, in clock periods.")
    ] = 0.1
    modules: Annotated[
        bool, typer.Option("--modules", help="Also find the area by module, which takes as long again.")
    ] = False
    check: Annotated[bool, typer.Option("--check", help="Simulate each mapped netlist against the golden model.")] = (
        False
    )
    seed: Seed = 1
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write netlists, timing reports and figures there.")
    ] = None
    json: Json = False

    @property
    def command(self) -> str:
        """The command line that does the same again, whatever is below --pdk-root."""
        chosen = [f"--preset {name}" for name in self.presets if self.presets != ["base"]]
        chosen += [f"--pdk {self.pdk} --pdk-root $PDK_ROOT --corner {self.corner}"] if self.pdk else []
        chosen += [f"--liberty {path.name}" for path in self.liberty or []]
        chosen += [f"--macros {path.name}" for path in self.macros or []]
        chosen += [f"--clock {self.clock:g}"] if self.clock is not None else []
        chosen += ["--check"] if self.check else []
        return " ".join(["lightloom synth", *(self.units or []), *chosen])

    @property
    def presets(self) -> list[str]:
        """Each once. Raises InputError for one that is not known."""
        return [choose(name, PRESETS, "preset") for name in dict.fromkeys(self.preset or ["base"])]


@command
def synth(options: SynthOptions) -> None:
    """Synthesise units with Yosys: gates, area by module, cells, flip-flops, memory bits, clock, critical path.

    Without a library: two-input-gate equivalents, as publications count them. With one: its cells and their area, and,
    where OpenSTA is installed, static timing before layout. Memories with synchronous reads are kept out and counted as
    bits. What was made is kept, so that a second run does only what is new.

    \b
    Examples:
      lightloom synth ray_triangle node_test
      lightloom synth float_add --preset tiny --preset base --preset full --modules
      lightloom synth ray_triangle --preset full --pdk asap7 --pdk-root pdks/asap7 --clock 1
      lightloom synth traversal --liberty cells.lib --macros ram_256x64.lib --json
      lightloom synth float_add --liberty cells.lib --check --out build/synth
    """
    from lightloom.hardware.synthesis import versions
    from lightloom.hardware.synthesis_tables import print_tables, write
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import print_json

    units = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(options.units or CATALOGUE)]
    jobs = [(unit, preset) for unit in units for preset in options.presets]
    source = _source(options.liberty or [], options.pdk, options.pdk_root, options.corner)
    made_with = versions()
    measured, checks = _measured(jobs, source, _how(options, source), options)
    report: dict[str, Any] = {
        "command": options.command,
        "versions": made_with,
        "rows": [one.row() for one in measured],
        "modules": [row for one in measured for row in one.modules()],
        "memories": [row for one in measured for row in one.memories()],
        "checks": checks,
    }
    if options.out is not None:
        write(options.out, measured, report)
    if options.json:
        print_json(report)
    else:
        print_tables(report, options.modules, source is not None)
        if options.out is not None:
            print(f"Written to {options.out}")
    if any(row["mismatches"] for row in checks):
        raise typer.Exit(1)


def _how(options: SynthOptions, source: "Source | None") -> "Options":
    """How units are synthesised. Raises InputError for what no unit can be synthesised with."""
    from lightloom.gen.flow.macros import read_macros
    from lightloom.hardware.synthesis import Options

    for option, part in (("--access", options.access), ("--setup", options.setup)):
        if not 0 <= part <= 1:
            raise InputError(f"{option} {part}: must be 0 to 1, parts of a clock period")
    if options.clock is not None and not options.clock > 0:
        raise InputError(f"--clock {options.clock}: must be above 0, in nanoseconds")
    if options.check and source is None:
        raise InputError("--check: needs a library; give --liberty or --pdk")
    return Options(
        memory_bits=at_least(options.memory_bits, 1, "--memory-bits"),
        access=options.access,
        setup=options.setup,
        macros=tuple(read_macros(options.macros or [])),
        parts=options.modules,
    )


def _measured(
    jobs: Sequence[tuple[str, str]], source: "Source | None", how: "Options", options: SynthOptions
) -> tuple[list["Measured"], list[dict[str, Any]]]:
    """Each unit with each preset of `jobs`, and with --check what its netlist computes, a row each."""
    from lightloom.golden_model.contract.interfaces import PURE
    from lightloom.hardware.netlist_check import check
    from lightloom.hardware.synthesis import measure
    from lightloom.shared.console import Progress

    measured, checks = [], []
    with Progress() as progress:
        for unit, preset in jobs:
            with progress.stage(f"{unit} {preset}", 2 if options.check else 1) as advance:
                measured.append(measure(unit, preset, source, how, options.clock))
                advance(1)
                if options.check and unit in PURE:
                    assert source is not None
                    row = {"unit": unit, "preset": preset, "library": source.name, "seed": options.seed}
                    checks.append(row | vars(check(measured[-1], source, VECTORS, options.seed)))
    return measured, checks


def _source(liberty: list[Path], pdk: str | None, root: Path | None, corner: str) -> "Source | None":
    """The library that the options name, None where they name none."""
    from lightloom.gen.flow.libraries import PDKS, PERIOD, of_pdk
    from lightloom.hardware.synthesis import Source

    if pdk is None:
        if root is not None:
            raise InputError(f"--pdk-root {root}: say which PDK it is, with --pdk {'|'.join(PDKS)}")
        for path in liberty:
            if not path.is_file():
                raise InputError(f"--liberty {path}: no such file")
        name = " + ".join(path.name.removesuffix(".gz").removesuffix(".lib") for path in liberty)
        return Source(name=name, files=tuple(liberty), period=PERIOD) if liberty else None
    choose(pdk, PDKS, "PDK")
    if liberty:
        raise InputError("--liberty: give either liberty files or a --pdk")
    if root is None:
        raise InputError(f"--pdk {pdk}: say where it is, with --pdk-root")
    name, files, period = of_pdk(pdk, root, corner)
    return Source(name=name, files=tuple(files), period=period)

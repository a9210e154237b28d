"""`lightloom synth`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lightloom.commands.options import Json, Seed
from lightloom.rtl.config import PRESETS
from lightloom.shared.inputs import at_least, choose

VECTORS = 20_000
"""Operands a netlist of --check, besides the corner cases."""


def synth(
    units: Annotated[
        list[str] | None, typer.Argument(metavar="UNIT", help="Names of units; all of them if none is given.")
    ] = None,
    preset: Annotated[
        list[str] | None,
        typer.Option("--preset", metavar="|".join(PRESETS), help="Hardware parameters (repeatable), else base."),
    ] = None,
    liberty: Annotated[
        list[Path] | None,
        typer.Option("--liberty", metavar="FILE", help="Liberty file of standard cells, also .gz (repeatable)."),
    ] = None,
    pdk: Annotated[
        str | None, typer.Option("--pdk", metavar="ihp-sg13g2|asap7", help="A PDK whose files are below --pdk-root.")
    ] = None,
    pdk_root: Annotated[Path | None, typer.Option("--pdk-root", metavar="DIR", help="Where the PDK is.")] = None,
    corner: Annotated[str, typer.Option("--corner", metavar="typ|slow", help="The corner of the PDK.")] = "typ",
    clock: Annotated[
        float | None,
        typer.Option("--clock", metavar="NS", help="Clock period that is asked for; else 5 ns, or what suits the PDK."),
    ] = None,
    macros: Annotated[
        list[Path] | None,
        typer.Option("--macros", metavar="FILE", help="Liberty file of memory macros, for an estimate (repeatable)."),
    ] = None,
    memory_bits: Annotated[
        int, typer.Option("--memory-bits", metavar="N", help="Memories of fewer bits become flip-flops.")
    ] = 256,
    access: Annotated[
        float, typer.Option("--access", metavar="PART", help="When a memory's word is there, in clock periods.")
    ] = 0.5,
    setup: Annotated[
        float, typer.Option("--setup", metavar="PART", help="Set-up time of a memory's inputs, in clock periods.")
    ] = 0.1,
    modules: Annotated[
        bool, typer.Option("--modules", help="Also find the area by module, which takes as long again.")
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Simulate each mapped netlist against the golden model.")
    ] = False,
    seed: Seed = 1,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Write netlists, timing reports and figures there.")
    ] = None,
    json: Json = False,
) -> None:
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
    from lightloom.gen.flow.macros import read_macros
    from lightloom.golden_model.contract.interfaces import UNITS
    from lightloom.golden_model.host.errors import InputError
    from lightloom.hardware import synthesis
    from lightloom.hardware.netlist_check import check as check_netlist
    from lightloom.hardware.synthesis_tables import print_tables, write
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, print_json

    names = [choose(name, CATALOGUE, "unit") for name in dict.fromkeys(units or CATALOGUE)]
    presets = [choose(name, PRESETS, "preset") for name in dict.fromkeys(preset or ["base"])]
    source = _source(liberty or [], pdk, pdk_root, corner)
    for option, part in (("--access", access), ("--setup", setup)):
        if not 0 <= part <= 1:
            raise InputError(f"{option} {part}: must be 0 to 1, parts of a clock period")
    options = synthesis.Options(
        memory_bits=at_least(memory_bits, 1, "--memory-bits"),
        access=access,
        setup=setup,
        macros=tuple(read_macros(macros or [])),
        parts=modules,
    )
    if clock is not None and not clock > 0:
        raise InputError(f"--clock {clock}: must be above 0, in nanoseconds")
    if check and source is None:
        raise InputError("--check: needs a library; give --liberty or --pdk")
    versions = synthesis.versions()
    jobs = [(unit, name) for unit in names for name in presets]
    measured, checks = [], []
    with Progress() as progress:
        for unit, name in jobs:
            with progress.stage(f"{unit} {name}", 2 if check else 1) as advance:
                measured.append(synthesis.measure(unit, name, source, options, clock))
                advance(1)
                if check and unit in UNITS:
                    assert source is not None
                    found = check_netlist(measured[-1], source, VECTORS, seed)
                    checks.append({"unit": unit, "preset": name, "library": source.name, "seed": seed, **vars(found)})
    chosen = [f"--preset {name}" for name in presets if presets != ["base"]]
    chosen += [f"--pdk {pdk} --pdk-root $PDK_ROOT --corner {corner}"] if pdk else []
    chosen += [f"--liberty {path.name}" for path in liberty or []] + [f"--macros {path.name}" for path in macros or []]
    chosen += [f"--clock {clock:g}"] if clock is not None else []
    chosen += ["--check"] if check else []
    report: dict[str, Any] = {
        "command": " ".join(["lightloom synth", *(units or []), *chosen]),
        "versions": versions,
        "rows": [one.row() for one in measured],
        "modules": [row for one in measured for row in one.modules()],
        "memories": [row for one in measured for row in one.memories()],
        "checks": checks,
    }
    if out is not None:
        write(out, measured, report)
    if json:
        print_json(report)
    else:
        print_tables(report, modules, source is not None)
        if out is not None:
            print(f"Written to {out}")
    if any(row["mismatches"] for row in checks):
        raise typer.Exit(1)


def _source(liberty: list[Path], pdk: str | None, root: Path | None, corner: str) -> Any:
    """The library that the options name, None where they name none."""
    from lightloom.gen.flow.libraries import PDKS, PERIOD, of_pdk
    from lightloom.golden_model.host.errors import InputError
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

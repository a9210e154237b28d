"""`lightloom sim`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from lightloom.rtl.config import PRESETS
from lightloom.shared.inputs import choose, seed_value
from lightloom.shared.options import Json


def sim(
    unit: Annotated[str, typer.Argument(metavar="UNIT", help="Name of a unit; `lightloom emit --list` shows them.")],
    icarus: Annotated[
        bool,
        typer.Option("--icarus", help="On Icarus Verilog, which knows what is undefined; slow, so fewer operands."),
    ] = False,
    waves: Annotated[bool, typer.Option("--waves", help="Record all signals, for GTKWave or Surfer.")] = False,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Seed of operands and stalls.")] = 2024,
    preset: Annotated[
        str | None,
        typer.Option("--preset", metavar="|".join(PRESETS), help="The hardware parameters; else those of its tests."),
    ] = None,
    only: Annotated[
        str | None, typer.Option("--only", metavar="REGEX", help="Only tests whose names this is found in.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="The folder of log and waves.", show_default="build/sim-UNIT"),
    ] = None,
    json: Json = False,
) -> None:
    """Run the cocotb bench of a unit: every result against the golden model, with both sides stalling.

    The exit code is 1 where a test fails; its line says why, the log all that was seen. The same seed gives the same
    run. The first run builds a simulator, which is kept.

    \b
    In DIR:
      log.txt         what cocotb printed
      results.xml     the tests, as JUnit writes them
      TOP.fst         with --waves, all signals
      TOP.gtkw        with --waves, a save file of GTKWave: the ports in groups, streams by their fields

    \b
    Examples:
      lightloom sim float_add
      lightloom sim ray_triangle --icarus --waves --out build/waves
      lightloom sim traversal --only nothing_stalled --seed 7
    """
    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.hardware.benches import Run, bench_of
    from lightloom.hardware.simulate import simulate
    from lightloom.rtl.catalogue import CATALOGUE
    from lightloom.shared.console import Progress, print_json

    bench = bench_of(choose(unit, CATALOGUE, "unit"))
    config = bench.fitted(PRESETS[choose(preset, PRESETS, "preset")]) if preset else bench.config
    out = out or Path("build") / f"sim-{unit}"
    simulator = "icarus" if icarus else "verilator"
    with Progress() as progress, whole_folder(out) as folder, progress.stage(f"{unit} on {simulator}"):
        run = Run(
            folder=folder, config=config, simulator=simulator, seed=seed_value(seed), only=_regex(only), waves=waves
        )
        seen = simulate(unit, run)
    files = {name: str(out / file) for name, file in seen.files.items()}
    report = {"unit": unit, "simulator": simulator, "preset": preset or bench.called, "seed": seed, **files}
    if json:
        print_json(report | {"passed": seen.passed, "tests": seen.tests})
    else:
        _show(report, seen.tests)
    if not seen.passed:
        raise typer.Exit(1)


def _regex(text: str | None) -> str | None:
    """A regular expression that can be one, or InputError."""
    import re

    from lightloom.golden_model.host.errors import InputError

    try:
        re.compile(text or "")
    except re.error as error:
        raise InputError(f"--only {text}: is no regular expression ({error})") from error
    return text


def _show(report: dict[str, Any], tests: list[Any]) -> None:
    from lightloom.shared.console import print_table

    rows = [[test["test"].rpartition(".")[2], test["passed"], test["seconds"], test["message"]] for test in tests]
    print_table(report["unit"], ["test", "passed", "seconds", "why not"], rows)
    for name, value in list(report.items())[1:]:
        print(f"{name}: {value}")

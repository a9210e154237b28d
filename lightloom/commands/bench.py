"""`lightloom bench`."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import typer

from lightloom.bench.suite import BENCHMARKS, LONG, Sizes, summary
from lightloom.golden_model.contract.interfaces import UNITS
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.host.parameters import described
from lightloom.rtl.config import PARAMETERS, parameters_of
from lightloom.shared.inputs import at_least, choose, whole_numbers
from lightloom.shared.options import Json

_DEFAULT = Sizes()
_PRESET = "base"
TRAVERSAL = "traversal"
NUMBERS: dict[str, Sequence[int]] = {
    **{name: PARAMETERS[name].values for name in ("width", "contexts", "units")},
    "latency": range(65536),
}
"""What the numbers of the options of `traversal` may be."""
VECTORS, RAYS = {"ray-triangle"}, {"tracing", TRAVERSAL}
"""The benchmarks whose size is that of --vectors, and of --rays."""
KNOWN = parameters_of(UNITS[TRAVERSAL])
"""What the traversal unit depends on."""
SETTABLE = [name for name in KNOWN if name not in (*NUMBERS, "tag_width")]
"""What --set may set: the tag is as wide as it has to be."""


def _help(says: str, name: str) -> str:
    return f"traversal: {says}, {described(NUMBERS[name])}."


def bench(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME", help=f"Benchmarks; all but `{'` and `'.join((*LONG, TRAVERSAL))}` if none is given."
        ),
    ] = None,
    vectors: Annotated[
        int | None,
        typer.Option("--vectors", metavar="N", help=f"Operands through the Verilated unit; else {_DEFAULT.vectors}."),
    ] = None,
    rays: Annotated[
        int | None,
        typer.Option(
            "--rays",
            metavar="N",
            help=f"Rays a scene, backend and kind of hit; else {_DEFAULT.rays}, or 10000 for the traversal unit.",
        ),
    ] = None,
    scene: Annotated[
        list[str] | None, typer.Option("--scene", metavar="SCENE", help="traversal: a scene (repeatable).")
    ] = None,
    width: Annotated[
        str | None, typer.Option("--width", metavar="W,W", help=_help("most children of a node", "width"))
    ] = None,
    contexts: Annotated[
        str | None, typer.Option("--contexts", metavar="N,N", help=_help("rays in a unit", "contexts"))
    ] = None,
    latency: Annotated[
        str | None, typer.Option("--latency", metavar="N,N", help="traversal: cycles that the memory takes.")
    ] = None,
    units: Annotated[
        str | None, typer.Option("--units", metavar="N,N", help=_help("units that share the memory port", "units"))
    ] = None,
    preset: Annotated[
        str, typer.Option("--preset", metavar="NAME", help="traversal: the other hardware parameters.")
    ] = _PRESET,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="traversal: a hardware parameter; see above (repeatable)."),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="traversal: the whole sweep, with 100000 rays compared a scene and width.")
    ] = False,
    json: Json = False,
) -> None:
    from lightloom.shared.console import Progress, print_json, print_table
    from lightloom.shared.provenance import machine, versions

    usual = [name for name in BENCHMARKS if name not in LONG]
    chosen = [choose(name, [*BENCHMARKS, TRAVERSAL], "benchmark") for name in dict.fromkeys(names or usual)]
    if rays is not None:
        at_least(rays, 1, "--rays")
    if vectors is not None:
        at_least(vectors, 1, "--vectors")
    sizes = Sizes(vectors=vectors or _DEFAULT.vectors, rays=rays or _DEFAULT.rays)
    numbers = {"width": width, "contexts": contexts, "latency": latency, "units": units}
    sweep = _sweep(scene, rays, preset, settings or [], full, **numbers)
    if TRAVERSAL not in chosen:
        others = {"scene": scene, "preset": preset != _PRESET, "set": settings, "full": full}
        for option in [name for name, given in (numbers | others).items() if given]:
            raise InputError(f"--{option}: is for the benchmark `{TRAVERSAL}`; name it, or leave the option out")
    for option, given, users in (("vectors", vectors, VECTORS), ("rays", rays, RAYS)):
        if given is not None and users.isdisjoint(chosen):
            named = " or ".join(f"`{name}`" for name in sorted(users))
            raise InputError(f"--{option}: is for the benchmark {named}; name it, or leave the option out")
    rows: list[dict[str, Any]] = []
    report: dict[str, Any] = {"results": rows}
    with Progress() as progress:
        for name in chosen:
            if name != TRAVERSAL:
                with progress.stage(name):
                    rows += list(BENCHMARKS[name](sizes))
        if TRAVERSAL in chosen:
            from lightloom.bench.traversal import measure

            with progress.stage(TRAVERSAL, sweep.runs) as advance:
                report[TRAVERSAL] = measure(sweep, advance)
    here = machine()
    if json:
        print_json({**report, "machine": here, "versions": versions()})
        return
    if rows:
        print_table(f"{here['processor']}, {here['cores']} cores", list(rows[0]), [list(row.values()) for row in rows])
    if TRAVERSAL in chosen:
        from lightloom.bench.traversal_page import tables

        for title, columns, cells in tables(report[TRAVERSAL]):
            print_table(title, columns, cells)


def _sweep(
    scenes: list[str] | None, rays: int | None, preset: str, settings: list[str], full: bool, **numbers: str | None
) -> Any:
    """The `Sweep` that is asked for: the quick or the full one, with what is given in its place."""
    from lightloom.bench.traversal import SWEPT, default_sweep
    from lightloom.rtl.config import PRESETS

    given: dict[str, Any] = {"preset": choose(preset, PRESETS, "preset")}
    if settings:
        given["settings"] = tuple(_setting(text) for text in settings)
        names = [name for name, _ in given["settings"]]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"--set {name}: is given {names.count(name)} times; give it once")
    if scenes:
        given["scenes"] = tuple(dict.fromkeys(scenes))
    if rays is not None:
        given["rays"] = rays
    for name, possible in NUMBERS.items():
        text = numbers[name]
        if text is not None:
            values = tuple(dict.fromkeys(whole_numbers(text, f"--{name}")))
            wrong = [value for value in values if value not in possible]
            if wrong:
                raise InputError(f"--{name} {text}: {wrong[0]} is not possible; it must be {described(possible)}")
            given[SWEPT[name]] = values
    return replace(default_sweep(full), **given)


def _setting(text: str) -> tuple[str, int]:
    """'node_sets=128' to ('node_sets', 128)."""
    name, equals, value = text.partition("=")
    if name in NUMBERS:
        raise InputError(f"--set {text}: {name} has an option of its own; give it as --{name} {value}".rstrip())
    if name in PARAMETERS and name not in KNOWN:
        raise InputError(f"--set {text}: the unit `{TRAVERSAL}` does not depend on {name}; leave it out")
    if name in PARAMETERS and name not in SETTABLE:
        raise InputError(f"--set {text}: {name} is not to be set; it follows from the others")
    choose(name, SETTABLE, "parameter")
    if not equals:
        raise InputError(f"--set {text}: give a name and a value, such as node_sets=128")
    try:
        return name, PARAMETERS[name].parsed(value)
    except InputError as error:
        raise InputError(f"--set {text}: {error}") from error


bench.__doc__ = "\n".join(
    [
        "Measure speed: Verilated units, golden model, emission.",
        "",
        "Runs on one core, `large-frames` also on two. The bunny is measured where `make meshes` has put it into",
        "build/meshes.",
        "",
        "\b",
        "Benchmarks:",
        *(f"  {name:<13} {summary(name)}" for name in BENCHMARKS),
        f"  {TRAVERSAL:<13} The traversal unit: cycles, utilisation, memory; its results against the golden model.",
        "",
        "`traversal` builds a simulator, which takes a minute or two, for each width, number of contexts and number of",
        "units; the next time it finds them. Its cycles are those of diffuse rays, nearest hit.",
        "",
        "\b",
        "Parameters for --set, and what they may be:",
        *(f"  {name:<28}  {PARAMETERS[name].allowed}" for name in SETTABLE),
        "",
        "\b",
        "Examples:",
        "  lightloom bench",
        "  lightloom bench tracing --rays 1000000",
        "  lightloom bench traversal --scene cornell-box --latency 0,50,100,200,400",
        "  lightloom bench traversal --full --json > build/traversal.json",
        "  lightloom bench --json > bench.json",
    ]
)

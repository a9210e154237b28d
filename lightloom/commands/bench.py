"""`lightloom bench`."""

from typing import Annotated

import typer

from lightloom.benchmarks import BENCHMARKS, Sizes, summary
from lightloom.commands.options import Json
from lightloom.inputs import at_least, choose

_DEFAULT = Sizes()


def bench(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help="Benchmarks; all of them if none is given.")
    ] = None,
    vectors: Annotated[
        int, typer.Option("--vectors", metavar="N", help="Operands through the Verilated unit.")
    ] = _DEFAULT.vectors,
    rays: Annotated[
        int, typer.Option("--rays", metavar="N", help="Rays a scene, backend and kind of hit.")
    ] = _DEFAULT.rays,
    json: Json = False,
) -> None:
    from lightloom.console import Progress, print_json, print_table
    from lightloom.machine import machine, versions

    chosen = [choose(name, BENCHMARKS, "benchmark") for name in dict.fromkeys(names or BENCHMARKS)]
    sizes = Sizes(vectors=at_least(vectors, 1, "--vectors"), rays=at_least(rays, 1, "--rays"))
    rows = []
    with Progress() as progress:
        for name in chosen:
            with progress.stage(name):
                rows += list(BENCHMARKS[name](sizes))
    if json:
        print_json({"results": rows, "machine": machine(), "versions": versions()})
    else:
        here = machine()
        print_table(f"{here['processor']}, {here['cores']} cores", list(rows[0]), [list(row.values()) for row in rows])


bench.__doc__ = "\n".join(
    [
        "Measure speed: Verilated units, golden model, emission.",
        "",
        "Runs on one core. The bunny is measured where `make meshes` has put it into build/meshes.",
        "",
        "\b",
        "Benchmarks:",
        *(f"  {name:<13} {summary(name)}" for name in BENCHMARKS),
        "",
        "\b",
        "Examples:",
        "  lightloom bench",
        "  lightloom bench tracing --rays 1000000",
        "  lightloom bench --json > bench.json",
    ]
)

"""Options and arguments that several commands share, and commands whose options are an object."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

Scene = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="`cornell-box`, or the path of an .obj, .ply, .glb, .gltf or .toml file.",
        show_default=False,
    ),
]
Bus = Annotated[
    str,
    typer.Option("--bus", metavar="BUS", help="Put units behind registers: axi4-lite.", show_default=False),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON on stdout instead of a table.")]
Seed = Annotated[
    int, typer.Option("--seed", metavar="N", help="Seed of everything random; the same seed, the same bits.")
]
Size = Annotated[str, typer.Option("--size", metavar="WxH", help="Width and height of a frame in pixels.")]
Traversal = Annotated[
    str,
    typer.Option(
        "--backend",
        metavar="auto|numpy|numba",
        help="What traces rays, tests visibility and smooths maps: NumPy, its compiled twin, or the latter where "
        "installed. The bits are the same.",
    ),
]
Threads = Annotated[
    int, typer.Option("--threads", metavar="N", help="Threads that trace rays and look at texels, with the same bits.")
]
Folder = Annotated[Path, typer.Option("--out", metavar="DIR", help="The folder that everything is written to.")]
Directions = Annotated[
    int, typer.Option("--directions", metavar="N", help="Rays for indirect light in a texel update (a power of two).")
]
LightSamples = Annotated[
    int, typer.Option("--light-samples", metavar="N", help="Shadow rays in a texel update, at most.")
]
Exposure = Annotated[
    float | None,
    typer.Option("--exposure", metavar="X", help="Factor from radiance to display; else from the first frame."),
]


def npz(option: str, name: str, text: str) -> Any:
    """A required option that names an .npz file."""
    return typer.Option(option, metavar=f"{name}.npz", help=text, show_default=False)


def command(run: Callable[[Any], None]) -> Callable[..., None]:
    """`run` as typer takes it, its argument being a dataclass whose fields are the options.

    So an option is declared once, and what works for the command takes all of them as one object.
    """
    (options,) = (kind for name, kind in get_type_hints(run).items() if name != "return")

    @functools.wraps(run)
    def function(**given: Any) -> None:
        run(options(**given))

    function.__annotations__ = get_type_hints(options, include_extras=True)
    vars(function)["__signature__"] = inspect.signature(options)
    return function

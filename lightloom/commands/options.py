"""Options and arguments that several commands share, and examples in help texts."""

from typing import Annotated, Any

import typer

Scene = Annotated[
    str,
    typer.Argument(
        metavar="SCENE",
        help="`cornell-box`, or the path of an .obj, .ply, .glb, .gltf or .toml file.",
        show_default=False,
    ),
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
        help="What traces the rays: NumPy, its compiled twin, or the latter if it is installed. The bits are the same.",
    ),
]


Threads = Annotated[
    int, typer.Option("--threads", metavar="N", help="Threads that trace rays, with the same bits for any number.")
]


def npz(option: str, name: str, text: str) -> Any:
    """A required option that names an .npz file."""
    return typer.Option(option, metavar=f"{name}.npz", help=text, show_default=False)

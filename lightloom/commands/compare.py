"""`lightloom compare`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lightloom.golden_model.host.errors import InputError
from lightloom.shared.options import Json

if TYPE_CHECKING:
    from lightloom.shared.difference import Difference


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="A .png, .exr or .npz file, or a folder of pictures.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="What A is held against: the reference, of the same kind.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Write difference.json and a picture of each difference here."),
    ] = None,
    json: Json = False,
) -> None:
    """Compare two results: bits, relative MSE, energy ratio, FLIP.

    A and B are two pictures, two .npz files (compared array by array), or two folders of pictures (compared by name).

    \b
    bits          values whose bits differ, and the first of them, in hex
    relative MSE  mean of (A-B)^2 / (B^2 + 0.01), in linear light
    energy ratio  sum of A over sum of B, in linear light
    FLIP          mean FLIP error, 0 (same) to 1: what an eye sees that flips between the two

    All pixels of a picture count, also those that see a lamp, which are the same whatever else is wrong: which they are
    is not known from a picture. Lightloom policies knows, and leaves them out.

    Ends with exit code 0 if all bits are the same and with 1 if not.

    \b
    Examples:
      lightloom compare frame.png reference.png --out build/difference
      lightloom compare golden.npz rtl.npz
      lightloom compare build/a/frames build/b/frames --json
    """
    for path in (a, b):
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
    kinds = [_kind(path) for path in (a, b)]
    if kinds[0] != kinds[1]:
        raise InputError(f"{a} is {kinds[0]} and {b} is {kinds[1]}; compare two of one kind")

    from lightloom.golden_model.host.outputs import whole_folder
    from lightloom.shared.console import json_text, print_json
    from lightloom.shared.difference import compare_arrays, compare_folders, compare_pictures

    if kinds[0] == "a folder":
        results = compare_folders(a, b)
    elif kinds[0] == "an .npz file":
        results = [(difference, None) for difference in compare_arrays(a, b)]
    else:
        results = [compare_pictures(a, b, a.name)]
    differences = [difference for difference, _ in results]
    identical = all(difference.identical for difference in differences)
    report = {"identical": identical, "comparisons": [difference.as_dict() for difference in differences]}

    if out is not None:
        with whole_folder(out) as folder:
            (folder / "difference.json").write_text(json_text(report))
            for difference, picture in results:
                if picture is not None:
                    picture.save(folder / f"{Path(difference.name).stem}.difference.png")
    if json:
        print_json(report)
    else:
        pixels = "" if kinds[0] == "an .npz file" else ", all pixels, lamps in view included"
        _show(f"{a} against {b}{pixels}", differences)
    if not identical:
        raise typer.Exit(1)


def _show(title: str, differences: "Sequence[Difference]") -> None:
    """The table of some differences, a row each."""
    from lightloom.shared.console import print_table

    columns = ["", "bits", "values", "differing", "relative MSE", "energy ratio", "FLIP", "first difference (A, B)"]
    rows = [
        [
            d.name,
            "same" if d.identical else "differ",
            d.values,
            d.differing,
            *("" if x is None else x for x in (d.relative_mse, d.energy_ratio, d.flip)),
            _first(d.first) or d.note,
        ]
        for d in differences
    ]
    print_table(title, columns, rows)


def _kind(path: Path) -> str:
    if path.is_dir():
        return "a folder"
    suffix = path.suffix.lower()
    if suffix not in (".png", ".exr", ".npz"):
        raise InputError(f"{path}: compare .png, .exr or .npz files, or folders of pictures")
    return f"{'a' if suffix == '.png' else 'an'} {suffix} file"


def _first(first: dict | None) -> str:
    return f"{first['index']} {first['a_hex']} {first['b_hex']}" if first else ""

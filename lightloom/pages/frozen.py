"""The page docs/frozen.md: what of the maintenance model hardware repeats bit for bit.

python -m lightloom.pages.frozen > docs/frozen.md

Formats, constants and parameters are read from the sources; the steps of a frame are `lightloom.pages.frozen_steps`.
"""

import ast
import re
import sys
from collections.abc import Iterator
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from lightloom.golden_model.contract import formats
from lightloom.golden_model.contract.formats import field_width
from lightloom.golden_model.engine.sampling.running_average import Blending
from lightloom.golden_model.engine.sampling.settings import Sampling
from lightloom.golden_model.engine.selection.classes import class_table
from lightloom.golden_model.engine.selection.policy import Policy
from lightloom.golden_model.host.parameters import Parameter, parameters
from lightloom.golden_model.numerics.directions import cosine_table, rotation_table
from lightloom.golden_model.renderer import Pipeline
from lightloom.pages.frozen_steps import INTRODUCTION, NOT_FROZEN, ORDER, PASSES, STATE
from lightloom.pages.results import table

WIDTH = 120
MODEL = "lightloom.golden_model"
RECORDS = (
    "TEXEL",
    "TEXEL_STATE",
    "PUBLISHED_TEXEL",
    "SAMPLE_SUMS",
    "INFLUENCE",
    "PIXEL",
    "RAY",
    "HIT",
    "POINT_LIGHT",
    "CONE",
)
"""What passes between a frame's steps and memory; what units take and give is in docs/units.md."""
CONSTANTS = (
    "contract.formats",
    *("numerics.directions", "numerics.sample_spread", "numerics.floats"),
    *("tables.filters", "tables.sky", "scene.lights", "tables.ray_offset", "tables.lightmap", "tables.lights"),
    *("rays.surface_shading", "rays.light_samples"),
    *("engine.drift", "engine.sampling.accumulate", "engine.sampling.confidence"),
    *("engine.sampling.gather", "engine.sampling.running_average", "engine.sampling.settings"),
    *("engine.sampling.texel_rays", "engine.selection.classes", "engine.selection.policy"),
    *("engine.selection.tracking", "engine.selection.variability", "engine.selection.influence.reach"),
    *("driver.volumes", "engine.publishing.filling"),
    *("engine.publishing.smoothing", "engine.publishing.mipmaps", "engine.publishing.flip_chain"),
)
"""Modules whose constants are part of the arithmetic."""
HOST = {
    *("prediction", "prediction_known", "influence", "influence_least", "influence_shiny"),
    *("influence_hiding", "influence_ahead", "influence_slack", "influence_records", "influence_memory", "shadows"),
    *("footprint_spread", "footprint_rays"),
    *("together", "lights", "priming", "primed"),
    *(f"{name}_points" for name in ("degree", "change", "hidden_change", "variability", "need", "hidden_need", "lod")),
}
"""Parameters that the host alone reads: records, views and tables that it makes follow from them."""
LEFT_OUT = {
    *("_PI", "LARGEST_SIDE", "SAMPLED_CONTRAST", "_SPLIT", "HEADROOM_BITS", "BALANCED_HEADROOM_BITS", "SETTLED_BITS"),
    *("REST_BITS", "LOOSE", "TIGHT", "JOINED_LEVEL", "TEXEL_BYTES", "REGION_BYTES"),
}
"""Constants of these modules that the host's tables are made with, and figures."""
FIRST = "FRAMES"
"""The first constant of formats.py that is maintenance's; those of traversal stand before."""


def page() -> str:
    """The whole page."""
    parts = [INTRODUCTION, "## Formats\n", *_formats(), "## State\n", STATE, "## Constants\n", *_constants()]
    parts += ["## Tables\n", _tables(), "## Parameters\n", *_parameters()]
    parts += ["## A frame, in order\n", *_passes(), "## What order does not matter\n", ORDER, "## What is not frozen\n"]
    return "\n".join([*parts, NOT_FROZEN])


def _source(module: str) -> tuple[list[str], list[ast.stmt]]:
    """Lines and statements of a module."""
    path = import_module(f"{MODEL}.{module}").__file__
    assert path is not None
    text = Path(path).read_text(encoding="utf-8")
    return text.splitlines(), ast.parse(text).body


def _formats() -> Iterator[str]:
    lines, body = _source("contract.formats")
    for name in RECORDS:
        (first,) = (
            each.lineno for each in body if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == name
        )
        yield f"### {name}\n"
        yield _filled(_comment(lines[: first - 1]))
        yield table(("field", "bits", "each", "is"), list(_fields(getattr(formats, name)))) + "\n"


def _comment(lines: list[str]) -> str:
    """What stands above a format, and above the constants of its own, up to an empty line."""
    above = lines[len(lines) - next(count for count, line in enumerate(reversed(lines)) if not line) :]
    return " ".join(line.removeprefix("# ") for line in above if line.startswith("# ") and "---" not in line)


def _fields(dtype: np.dtype) -> Iterator[tuple[str, str, str, str]]:
    """Name, bits from the lowest up, how many of what width, and of what kind."""
    low = 0
    for name in dtype.names or ():
        base, shape = dtype[name].base if dtype[name].shape else dtype[name], dtype[name].shape
        count, width = int(np.prod(shape, dtype=int)), field_width(base)
        kind = {"f": "float", "i": "signed", "u": "unsigned", "b": "flag"}[base.kind]
        yield f"`{name}`", f"{low + count * width - 1}:{low}", f"{count} x {width}" if shape else str(width), kind
        low += count * width


def _constants() -> Iterator[str]:
    yield _filled("Of each module below `golden_model/`, with what it says of them.")
    rows = []
    for module in CONSTANTS:
        made, (_, body) = import_module(f"{MODEL}.{module}"), _source(module)
        if module == "contract.formats":
            body = body[[ast.unparse(each).startswith(f"{FIRST} =") for each in body].index(True) :]
        for statement, following in zip(body, [*body[1:], None], strict=True):
            for name, value in _named(statement, made):
                if name not in LEFT_OUT:
                    rows.append((f"`{module}`", f"`{name}`", _value(value), _docstring(following)))
    yield table(("module", "constant", "is", ""), rows) + "\n"


def _named(statement: ast.stmt, module: Any) -> Iterator[tuple[str, Any]]:
    """Constants that a statement makes, that are numbers or a few of them."""
    if not isinstance(statement, ast.Assign | ast.AnnAssign):
        return
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    names = [node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)]
    for name in names:
        value = getattr(module, name, None)
        several = value if isinstance(value, tuple | list) else [value]
        if re.fullmatch("_?[A-Z][A-Z0-9_]*", name) and all(_is_number(each) for each in several):
            yield name, value


def _is_number(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_number, value))
    return isinstance(value, int | float | np.floating) and not isinstance(value, bool)


def _value(value: Any) -> str:
    if isinstance(value, tuple | list):
        return ", ".join(f"({_value(each)})" if isinstance(each, tuple) else _value(each) for each in value)
    if isinstance(value, float | np.floating) and value and np.frexp(value)[0] == 0.5 and not 0.01 < value < 1e4:
        return f"2\\*\\*{int(np.frexp(value)[1]) - 1}"
    return f"{value:,}" if isinstance(value, int) else f"{float(value):.9g}"


def _docstring(statement: ast.stmt | None) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return " ".join(str(statement.value.value).split()).replace("|", "\\|").replace("*", "\\*")
    return ""


def _tables() -> str:
    tables = {
        "`numerics.directions.cosine_table`": (cosine_table(), "directions about +z, a quarter of them stored"),
        "`numerics.directions.rotation_table`": (rotation_table(), "cosine and sine of turns"),
        "`engine.selection.classes.class_table`": (class_table(Policy()), "classes, of the default policy"),
    }
    rows = [
        (name, " x ".join(map(str, made.shape)), made.dtype.name, sha256(made.tobytes()).hexdigest()[:16], says)
        for name, (made, says) in tables.items()
    ]
    return table(("table", "entries", "of", "SHA-256 begins", "is"), rows) + "\n"


def _parameters() -> Iterator[str]:
    yield _filled(
        "All that can be set, with its range; what each is for stands in [selection](selection.md#parameters) and "
        "[update](update.md#the-average). Bits are those of a register that holds any allowed value. What the host "
        "reads is not in hardware: it makes tables, views and records of it."
    )
    for kind in (Policy, Sampling, Blending, Pipeline):
        rows = [
            (f"`{name}`", _default(each), each.allowed, "host" if name in HOST or kind is Pipeline else _bits(each))
            for name, each in parameters(kind).items()
        ]
        yield f"### {kind.__name__}\n"
        yield table(("parameter", "default", "may be", "bits"), rows) + "\n"


def _default(each: Parameter) -> str:
    if isinstance(each.default, bool):
        return "yes" if each.default else "no"
    return each.default if isinstance(each.default, str) else _value(each.default)


def _bits(each: Parameter) -> str:
    """Of a register; float32 where it is no whole number."""
    count = len(each.default) if isinstance(each.default, tuple) else 1
    if each.values:
        width = max(each.values).bit_length()
    elif each.choices:
        width = (len(each.choices) - 1).bit_length()
    elif each.range is None:
        width = 1
    else:
        low, high = each.range
        whole = isinstance(low, int) and isinstance(high, int)
        width = max(int(high or 0).bit_length(), (-int(low) - 1).bit_length() + 1 if low < 0 else 0) if whole else 32
        width += whole and low < 0 and int(high or 0).bit_length() == width
    return f"{count} x {width}" if count > 1 else str(width)


def _passes() -> Iterator[str]:
    for title, text, steps in PASSES:
        yield f"### {title}\n"
        yield _filled(text)
        yield (
            table(
                ("said by", "does", "rounds"), [(f"`{_checked(name)}`", does, rounds) for name, does, rounds in steps]
            )
            + "\n"
        )


def _checked(name: str) -> str:
    """The name of a function or class of the model, which has to be there; without the package's."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        path = Path(__file__).parents[1] / "golden_model" / "/".join(parts[:cut])
        if path.with_suffix(".py").exists():
            found: Any = import_module(f"{MODEL}.{'.'.join(parts[:cut])}")
            for each in parts[cut:]:
                found = getattr(found, each)
            return name
    raise AttributeError(name)


def _filled(text: str) -> str:
    return fill(text, WIDTH, break_on_hyphens=False, break_long_words=False) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())

"""The page docs/units.md, made from the units' declarations: `python -m lightloom.pages.units > docs/units.md`."""

import sys
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from lightloom.gen.manifest import manifest
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.interfaces import UNITS, Unit
from lightloom.rtl.config import PRESETS, parameters_of

PREAMBLE = """\
# Units

<!-- Made by `python -m lightloom.pages.units > docs/units.md`; a test holds it to the declarations. -->

Every unit that `lightloom emit` writes. What it is stands in `golden_model/contract/interfaces.py`, its hardware in
`rtl/catalogue.py`, its model in `golden_model/models.py`; [adding a unit](adding_a_unit.md) shows all of it once. Every
unit has a clock `clk`, a synchronous reset `rst`, and two streams, `i` and `o` ([number units](operators.md) tells how
they work); the tag lies above the fields. [Emission](emission.md) tells what the parameters are.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([PREAMBLE, *(text for unit in UNITS.values() for text in _unit(unit))])


def _unit(unit: Unit) -> Iterator[str]:
    described = {preset: manifest(unit.name, config) for preset, config in PRESETS.items()}
    yield f"## {unit.name}\n"
    yield f"{unit.summary}\n".replace("*", r"\*")
    yield f"Kind: {unit.kind.value}.{_timing(described)}\n"
    yield f"Parameters: {', '.join(f'`{name}`' for name in parameters_of(unit))}.\n"
    yield table(["field", "bits", "of"], [*_fields(unit.input, "operands"), *_fields(unit.output, "result")])
    ports = [port for port in described["base"]["ports"] if port["role"] in ("control", "strobe", "status", "counter")]
    if ports:
        yield table(
            ["port", "role", "bits", "is"],
            [[f"`{port['name']}`", port["role"], port["width"], port["meaning"]] for port in ports],
        )


def _timing(described: dict[str, dict[str, Any]]) -> str:
    one = next(iter(described.values()))
    if one["latency"] is None:
        return ""
    latencies = ", ".join(f"{each['latency']} (`{preset}`)" for preset, each in described.items())
    interval = one["initiation_interval"]
    return f" Latency {latencies}; an operation every {'cycle' if interval == 1 else f'{interval} cycles'}."


def _fields(dtype: np.dtype, of: str) -> Iterator[list[str]]:
    """A row a field, vectors as one."""
    spans: dict[str, tuple[int, int]] = {}
    for name, _, _, offset, width in bitpack.fields(dtype):
        spans[name] = offset + width - 1, spans.get(name, (0, offset))[1]
    for name, (high, low) in spans.items():
        yield [f"`{name}`", f"{high}:{low}", of]


def table(head: list[str], rows: Iterable[list[Any]]) -> str:
    """A table of Markdown, with an empty line behind it."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page())

"""Packages units for a flow, with operands from the benches and the memory of the simulations."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lightloom.rtl.config import PRESETS

CLOCKS = {"tiny": 20.0, "base": 8.0, "full": 5.0}
"""The period in ns that a preset is meant for in a 130 nm process, for constraints that name none."""
SEED = 2013
LARGE = ("ray_", "box_", "node_")
"""How the names of units begin of which Icarus simulates a thousand cycles in a second or two."""
FEW, MANY = 400, 2000
"""Operations of the testbench of such a unit, and of the number units."""


def package_units(
    units: Sequence[str],
    preset: str,
    clock: float | None,
    out: Path,
    advance: Callable[[float], None] = lambda steps: None,
    prefix: str = "",
    bus: str = "",
) -> dict[str, Any]:
    """Writes the package of units into `out`, whole or not at all; returns its manifest."""
    from lightloom.gen.package.package import package
    from lightloom.sim.system import MEMORY
    from lightloom.verif.vectors.unit_vectors import unit_vectors

    return package(
        units,
        PRESETS[preset],
        preset,
        CLOCKS[preset] if clock is None else clock,
        out,
        prefix=prefix,
        bus=bus,
        operands=lambda unit: unit_vectors(unit, FEW if unit.startswith(LARGE) else MANY, SEED),
        memory_model=MEMORY,
        progress=lambda unit: advance(0.5),
    )

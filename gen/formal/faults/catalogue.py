"""All faults."""

from lightloom.gen.formal.faults import (
    axi,
    axi_reads,
    axi_writes,
    cache,
    control,
    fabric,
    front,
    intersection,
    operators,
    registers,
    texels,
    traversal,
)
from lightloom.gen.formal.mutations import Mutation

MODULES = (
    fabric,
    operators,
    intersection,
    axi,
    axi_reads,
    axi_writes,
    cache,
    control,
    traversal,
    registers,
    front,
    texels,
)

FAULTS: dict[str, Mutation] = {}
"""By name."""
for _one in (fault for module in MODULES for fault in module.FAULTS):
    assert _one.name not in FAULTS, f"two faults are named {_one.name}"
    FAULTS[_one.name] = _one

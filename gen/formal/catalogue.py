"""All properties."""

from lightloom.gen.formal import (
    arbiter,
    best_hits,
    box_test,
    cache,
    control,
    counting,
    cuts,
    lines,
    loading,
    numbers,
    queues,
    register_block,
    special_cases,
    stacks,
    stream_units,
    texel_logic,
    write_arbiter,
    writer,
)
from lightloom.gen.formal.properties import Property

MODULES = (
    stream_units,
    queues,
    arbiter,
    write_arbiter,
    writer,
    counting,
    lines,
    cache,
    loading,
    stacks,
    best_hits,
    control,
    register_block,
    special_cases,
    cuts,
    numbers,
    box_test,
    texel_logic,
)

PROPERTIES: dict[str, Property] = {one.key: one for module in MODULES for one in module.properties()}
"""By `unit/property`."""

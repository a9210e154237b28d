"""What the parts of a traversal unit hand to each other."""

import numpy as np
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BOX_RAY, HIT, NODE_HITS, NODE_TEST, TIME_BITS, WIDTH
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.layouts import layout_of

ERROR_BITS = 3
"""Bits of a code of TRACE_ERRORS."""
ADDRESS_BITS = 32
"""Of a block's number."""
RANK_BITS = 3

NODE_RAY = np.dtype([(name, BOX_RAY[name]) for name in BOX_RAY.names or () if name in (NODE_TEST.names or ())])
"""What the node test needs of a ray."""


def node_visit(config: Config) -> data.StructLayout:
    """A node to be visited: its block's number; the first `rank` of the children that the ray enters are skipped."""
    return data.StructLayout({"context": config.traversal.context_bits, "address": ADDRESS_BITS, "rank": RANK_BITS})


def leaf_visit(config: Config) -> data.StructLayout:
    """A block of triangles to be visited."""
    return data.StructLayout({"context": config.traversal.context_bits, "address": ADDRESS_BITS})


def node_result(config: Config) -> data.StructLayout:
    """A visited node: the visit, what is wrong with the block (TRACE_ERRORS), and the children that the ray enters."""
    return data.StructLayout(
        {
            **node_visit(config).members,
            "error": ERROR_BITS,
            "base": ADDRESS_BITS,
            "leaf": WIDTH,
            "hits": layout_of(NODE_HITS),
        }
    )


STACK_ENTRY = data.StructLayout(
    {"entry": TIME_BITS, "address": ADDRESS_BITS, "leaf": 1, "rank": RANK_BITS, "near_below": 1}
)
"""A visit that waits: the distance at which the ray enters, and where it goes; whether the entry below is near."""


def push_list(config: Config) -> data.StructLayout:
    """Children from `last` down to `first` of a list of hits, for a stack's places from `height` up.

    `again`: instead of children, an entry for the node `base` itself, of rank `first`; `last` is then `first`.
    `near`: which of the children are near the one that the ray goes on to; `near_below`: that of the top of the stack.
    """
    return data.StructLayout(
        {
            "context": config.traversal.context_bits,
            "height": config.traversal.height_bits,
            "first": RANK_BITS,
            "last": RANK_BITS,
            "again": 1,
            "base": ADDRESS_BITS,
            "leaf": WIDTH,
            "slot": data.ArrayLayout(3, WIDTH),
            "entry": data.ArrayLayout(TIME_BITS, WIDTH),
            "near": WIDTH,
            "near_below": 1,
        }
    )


def stack_read(config: Config) -> wiring.Signature:
    """The entry at `position` of a context's stack, one cycle after an `en`, until the next one."""
    return wiring.Signature(
        {
            "en": Out(1),
            "context": Out(config.traversal.context_bits),
            "position": Out(config.traversal.height_bits),
            "entry": In(STACK_ENTRY),
        }
    )


def strobe(layout: data.StructLayout) -> wiring.Signature:
    """A record that is taken in the cycle in which it is valid, or missed."""
    return wiring.Signature({"valid": Out(1), "payload": Out(layout)})


def failure(config: Config) -> data.StructLayout:
    """Why a ray failed (TRACE_ERRORS), and the block that made it fail."""
    return data.StructLayout({"context": config.traversal.context_bits, "error": ERROR_BITS, "block": ADDRESS_BITS})


def beside_layout(config: Config) -> data.StructLayout:
    """What travels beside the ray-triangle core."""
    context = config.traversal.context_bits
    return data.StructLayout(
        {"context": context, "primitive": 32, "any_hit": 1, "tested": 1, "last": 1, "error": ERROR_BITS}
    )


class Ports:
    """The signatures that the leaf stage and its parts share; a strobe is taken or missed while it is valid."""

    def __init__(self, config: Config):
        context = config.traversal.context_bits
        self.started = wiring.Signature({"valid": Out(1), "context": Out(context)})
        self.done = wiring.Signature(
            {"valid": Out(1), "context": Out(context), "hit": Out(1), "error": Out(ERROR_BITS)}
        )
        self.time_read = wiring.Signature({"context": Out(context), "time": In(TIME_BITS)})
        self.hit_read = wiring.Signature({"context": Out(context), "hit": In(layout_of(HIT))})

"""A distance along a ray for the box test; `golden_model.tracing.wide_bvh.ray_time` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Const, Mux, Value

from lightloom.golden_model.contract.formats import SCALE_BIAS, TIME_BITS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.fabric.pipeline import balanced_cuts
from lightloom.rtl.intersection.float_flow import FloatFlow, exponent, is_finite, is_zero

TIME_MAX = (1 << TIME_BITS) - 1
BELOW = 4
"""How far `low` lies below the distance rounded down."""
ABOVE = 5
"""How far `high` lies above it."""
SIGNIFICAND_BITS = 24
ALL_ONES = Const((1 << SIGNIFICAND_BITS + 1) - 1)
GREATEST_SHIFT = 31
"""Shifted this far, nothing is left of a significand."""


class RayTime(DataflowCore):
    """One distance a cycle: a float32 multiplier and a shifter; `multiply_depth` and `convert_depth` stages."""

    declared = PURE["ray_time"]

    def compute(self, flow: Dataflow, config: Config, *, t: Node, rate: Node, scale: Node) -> Mapping[str, Any]:
        return rounded_both_ways(flow, config, FloatFlow(flow, config.operators).multiply("scaled", t, rate), scale)


def rounded_both_ways(flow: Dataflow, config: Config, product: Node, scale: Node) -> dict[str, Node]:
    """`low` and `high` of t * rate, an operator's result; `convert_depth` stages."""
    cuts = balanced_cuts((1, 1), config.operators.convert_depth)
    distance = flow.logic("distance", aligned, product, scale, stage=0 in cuts)
    sign = flow.logic("distance_sign", lambda x: x[31], product)
    unknown = flow.logic("distance_unknown", lambda x: ~is_finite(x), product)
    return {
        name: flow.logic(name, bound, distance, sign, unknown, stage=1 in cuts)
        for name, bound in (("low", lower_bound), ("high", upper_bound))
    }


def aligned(x: Value, scale: Value) -> Value:
    """|x| * 2**(scale - SCALE_BIAS) rounded down, 24 bits, and below them one that says whether anything was lost.

    What has no room is all ones.
    """
    places = 150 + SCALE_BIAS - exponent(x) - scale
    significand = Mux(is_zero(x), 0, Cat(x[:23], Const(1, 1)))
    shift = Mux(places > GREATEST_SHIFT, GREATEST_SHIFT, places[:5])
    lost = (significand & ~(ALL_ONES << shift)).any()
    beyond = (places < 0) & ~is_zero(x)
    return Mux(beyond, ALL_ONES, Cat(lost, significand >> shift))


def floor(magnitude: Value, sign: Value) -> Value:
    """What `aligned` gave, with its sign, rounded down; TIME_BIAS added: 25 bits."""
    lost = magnitude[0]
    return (Cat(magnitude[1:] ^ sign.replicate(SIGNIFICAND_BITS), ~sign) + (sign & ~lost))[:TIME_BITS]


def lower_bound(magnitude: Value, sign: Value, unknown: Value) -> Value:
    distance = floor(magnitude, sign)
    return Mux(unknown | (distance < BELOW), 0, (distance - BELOW)[:TIME_BITS])


def upper_bound(magnitude: Value, sign: Value, unknown: Value) -> Value:
    distance = floor(magnitude, sign)
    return Mux(unknown | (distance > TIME_MAX - ABOVE), TIME_MAX, (distance + ABOVE)[:TIME_BITS])

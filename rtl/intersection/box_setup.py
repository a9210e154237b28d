"""What the box test needs of a ray; `golden_model.tracing.wide_bvh.box_setup` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Const, Mux, Value

from lightloom.golden_model.contract.formats import BOX_FRACTION, LATTICE_BITS, POSITION_BITS, SCALE_BIAS, SLOPE_BITS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.fabric.float_format import INFINITY
from lightloom.rtl.fabric.pipeline import balanced_cuts
from lightloom.rtl.intersection.float_flow import FloatFlow, exponent
from lightloom.rtl.intersection.ray_setup import canonical
from lightloom.rtl.intersection.ray_time import aligned, floor, rounded_both_ways
from lightloom.rtl.intersection.ray_triangle import select

PAD = 21
UNDERFLOW = -26
BLIND_SHIFT = 20
STEEPEST = 27
COARSEST = 31
REACH = 126 + LATTICE_BITS
"""An origin whose biased exponent is above this plus the lattice's makes the ray coarse."""


class BoxSetup(DataflowCore):
    """One ray a cycle: 3 subtractors, 4 multipliers, 4 shifters.

    Stages: the longer of `add_depth` and two for the scale, or one for the rate and `multiply_depth`; then
    `convert_depth`. Operators have a stage more than elsewhere, as far as they can: a ray is set up but once.
    """

    declared = PURE["box_setup"]

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        origin: list[Node],
        direction: list[Node],
        inverse: list[Node],
        axis: Node,
        t_min: Node,
        lattice_origin: list[Node],
        lattice_exponent: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators.deeper)
        cuts = balanced_cuts((1, 1), config.operators.convert_depth)

        moved = [f.subtract(f"moved{k}", origin[k], lattice_origin[k]) for k in range(3)]
        greatest = flow.logic("greatest", greatest_exponent, *moved, stage=True)
        coarseness = flow.logic("coarseness", coarseness_of, greatest, lattice_exponent)
        scale = flow.logic("scale", scale_of, greatest, lattice_exponent, stage=True)
        position = []
        for k, component in enumerate(moved):
            magnitude = flow.logic(f"position{k}_magnitude", aligned, component, scale, stage=0 in cuts)
            sign = flow.logic(f"position{k}_sign", lambda x: x[31], component)
            position.append(flow.logic(f"position{k}", position_of, magnitude, sign, stage=1 in cuts))

        dominant = flow.logic(
            "dominant", lambda axis, *d: Cat(select(axis, *d)[:31], Const(0, 1)), axis, *direction, stage=True
        )
        rate = canonical(flow, "rate", dominant)
        infinite = flow.logic("infinite", lambda greatest: greatest == INFINITY, greatest)
        shift = flow.logic("underflow", underflow_shift, rate, scale)
        blind = flow.logic("blind", lambda shift, infinite: infinite | (shift >= BLIND_SHIFT), shift, infinite)
        ratio = [f.multiply(f"ratio{k}", rate, inverse[k]) for k in range(3)]
        level = [
            flow.logic(f"level{k}", lambda axis, ratio, k=k: is_level(axis, ratio, k), axis, ratio[k]) for k in range(3)
        ]
        return {
            "position": position,
            "backwards": [flow.logic(f"backwards{k}", lambda x: x[31], direction[k]) for k in range(3)],
            "slope": [flow.logic(f"slope{k}", slope_of, level[k], ratio[k]) for k in range(3)],
            "steepness": [flow.logic(f"steepness{k}", steepness_of, level[k], ratio[k]) for k in range(3)],
            "pad": flow.logic("pad", pad_of, shift, blind),
            "coarseness": coarseness,
            "blind": blind,
            "t_min": rounded_both_ways(flow, config, f.multiply("t_min_rate", t_min, rate), scale)["low"],
            "rate": rate,
            "scale": scale,
        }


def greatest_exponent(x: Value, y: Value, z: Value) -> Value:
    x, y, z = (exponent(component) for component in (x, y, z))
    xy = Mux(x > y, x, y)
    return Mux(xy > z, xy, z)


def coarseness_of(greatest: Value, lattice_exponent: Value) -> Value:
    """5 bits."""
    excess = greatest - REACH - lattice_exponent.as_signed()
    return Mux(excess < 0, 0, Mux(excess > COARSEST, COARSEST, excess[:5]))


def scale_of(greatest: Value, lattice_exponent: Value) -> Value:
    """9 bits. The lesser of the scale without coarseness and that at which the origin just has room."""
    fine = BOX_FRACTION + SCALE_BIAS - lattice_exponent.as_signed()
    fitting = BOX_FRACTION + SCALE_BIAS + REACH - greatest
    return Mux(fine < 0, 0, Mux(fine < fitting, fine[:9], fitting[:9]))


def position_of(magnitude: Value, sign: Value) -> Value:
    """With POSITION_BIAS. The scale leaves a position of 22 bits and a sign, so it never saturates."""
    whole = floor(magnitude, sign)
    return Cat(whole[: POSITION_BITS - 1], whole[-1])


def underflow_shift(rate: Value, scale: Value) -> Value:
    """The pad for underflow as a power of two, signed. A scale of 0 may stand for less, which makes no difference."""
    size = exponent(rate)
    return Mux(size > 126, size - 126, 0) + scale + (UNDERFLOW + 1 - SCALE_BIAS)


def pad_of(shift: Value, blind: Value) -> Value:
    """20 bits; 0 for a blind ray."""
    power = (Const(1, BLIND_SHIFT) << Mux(shift < 0, 0, shift[:5]))[:BLIND_SHIFT]
    return Mux(blind, 0, (power + PAD)[:BLIND_SHIFT])


def is_level(axis: Value, ratio: Value, k: int) -> Value:
    """Whether axis k, which `ratio` belongs to, is the dominant one or counts as equal to it."""
    dominant = (axis == k) if k else (axis == 0) | (axis == 3)
    return dominant | (exponent(ratio) < 127)


def slope_of(level: Value, ratio: Value) -> Value:
    """The highest bits of the significand; of a slope of 1 all but the first are zero."""
    return Cat(Mux(level, 0, ratio[24 - SLOPE_BITS : 23]), Const(1, 1))


def steepness_of(level: Value, ratio: Value) -> Value:
    """5 bits."""
    size = exponent(ratio)
    return Mux(level, 0, Mux(size > 127 + STEEPEST, STEEPEST, (size - 127)[:5]))

# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""From a texel to the screen; `golden_model.engine.selection.texel_project` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Mux, Value

from lightloom.golden_model.contract.formats import PIXEL_BITS, SCREEN_BITS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.intersection.float_flow import FloatFlow

MOST_BITS = 31
"""Of what is converted to float32 without a sign."""


class TexelProject(DataflowCore):
    """15 multiplications, 11 additions, a division."""

    declared = PURE["texel_project"]

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        position: list[Node],
        normal: list[Node],
        eye: list[Node],
        right: list[Node],
        up: list[Node],
        forward: list[Node],
        focal: Node,
        near: Node,
        width: Node,
        height: Node,
        texel_size: Node,
        facing_shift: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        moved = [f.subtract(f"moved{k}", position[k], eye[k]) for k in range(3)]
        depth = f.dot("depth", moved, forward)
        enlarged = f.divide("enlarged", focal, depth)  # pixels a unit of length, at this depth
        # What several products share stands first: of that the multiplier takes three times the significand, once.
        across, along = f.dot("across", moved, right), f.dot("along", moved, up)
        under = f.dot("under", moved, normal)
        horizon = f.negate("horizon", flow.logic("slack", scaled_down, depth, facing_shift, stage=True))
        above = f.negate("above", under)
        facing = f.compare("facing", above, horizon)
        beyond = f.compare("beyond", depth, near)

        column, left_or_right = _on_axis(flow, f, "x", across, enlarged, width)
        row, above_or_below = _on_axis(flow, f, "y", f.negate("down", along), enlarged, height)
        farther = flow.logic("farther", lambda a, b: Mux(a > b, a, b), left_or_right, above_or_below, stage=True)
        outside = f.from_fixed("outside", farther, PIXEL_BITS)
        off = f.compare("off", outside, f.multiply("pixels", enlarged, texel_size))
        near = flow.logic("near", lambda farther, less: less | ~farther.any(), farther, off["less"])
        visible = flow.logic("visible", lambda *all_of: Cat(*all_of).all(), facing["greater"], beyond["greater"], near)

        def shown(name: str, node: Node) -> Node:
            return flow.logic(name, lambda visible, value: Mux(visible, value, 0), visible, node)

        def taken(name: str, both: Node, which: int) -> Node:
            """At the end, until when the pair waits."""
            return flow.logic(name, lambda _, both: tap(both, which), visible, both)

        return {
            "visible": visible,
            "depth": shown("depth_out", depth),
            "above": shown("above_out", above),
            "outside": shown("outside_out", outside),
            "column": [shown(f"column{k}", taken(f"column{k}_kept", column, k)) for k in range(2)],
            "row": [shown(f"row{k}", taken(f"row{k}_kept", row, k)) for k in range(2)],
        }


def scaled_down(z: Value, shift: Value) -> Value:
    """z / 2**shift of a result z of an operator, rounded as a product is."""
    fraction, exponent, sign = z[:-9], z[-9:-1], z[-1]
    lowered = exponent - shift
    # Of a number below the least normal one only what IEEE rounds up to that is kept: ones with an exponent of 0.
    ones = ~lowered.any() & fraction.all() & shift.any()
    special, under = exponent.all(), lowered <= 0
    return Cat(
        fraction & (special | ~under).replicate(len(fraction)),
        Mux(special, exponent, Mux(under, ones, lowered[: len(exponent)])),
        sign,
    )


def _on_axis(flow: Dataflow, f: FloatFlow, name: str, place: Node, enlarged: Node, size: Node) -> tuple[Node, Node]:
    """Of one axis of the screen: the `pair` of pixels around the place, and how far it is beyond either end."""
    moved = f.to_fixed_down(f"{name}_moved", f.multiply(f"{name}_scaled", enlarged, place), PIXEL_BITS)
    first = flow.logic(f"{name}_first", first_pixel, moved, size, stage=True)
    return (
        flow.logic(f"{name}_pair", pair, first, size),
        flow.logic(f"{name}_beyond", beyond, moved, size, stage=True),
    )


# A place on an axis comes as `moved`, its distance from the middle, signed, in 1/2**PIXEL_BITS pixels. The middle is a
# whole number of half pixels, so only the bits from HALF on meet the size.
HALF = PIXEL_BITS - 1


def first_pixel(moved: Value, size: Value) -> Value:
    """The greatest integer that is not more than a place less a half."""
    # Slices, not shifts: a shift's copies of the sign come from its own upper bits, a loop to some tools.
    return (moved[HALF:].as_signed() + (size - 1))[1:].as_signed()


def pair(first: Value, size: Value) -> Value:
    """The first pixel kept in 0 to size - 1, and above it whether the second is the next one; else it is the same.

    So what waits for the end is little more than one pixel.
    """
    last = size - 1
    before, inner = first < 0, first < last
    return Cat(Mux(before, 0, Mux(inner, first, last))[:SCREEN_BITS], inner & ~before)


def tap(both: Value, which: int) -> Value:
    """One of the two pixels of a `pair`."""
    return (both[:-1] + both[-1])[:SCREEN_BITS] if which else both[:-1]


def beyond(moved: Value, size: Value) -> Value:
    """How far a place is beyond either end of an axis, 31 bits, saturating; 0 between them: |moved| less size / 2."""
    negative, below = moved[-1], moved[:HALF]
    carry = negative & ~below.any()  # of the negation, into the half pixels
    halves = (moved[HALF:-1] ^ negative.replicate(len(moved) - 1 - HALF)) - (size - carry)
    whole = Cat(((below ^ negative.replicate(HALF)) + negative)[:HALF], halves)
    distance = Mux(halves < 0, 0, whole)
    return Cat(distance[:MOST_BITS] | distance[MOST_BITS:].any().replicate(len(distance[:MOST_BITS])))

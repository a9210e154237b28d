# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""From a texel to the screen; `golden_model.maintenance.selection.texel_project` explains it."""

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
    """14 multiplications, 11 additions, a division."""

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
        across, along = f.dot("across", moved, right), f.dot("along", moved, up)
        under = f.dot("under", normal, moved)
        horizon = f.negate("horizon", flow.logic("slack", scaled_down, depth, facing_shift, stage=True))
        above = f.negate("above", under)
        facing = f.compare("facing", above, horizon)
        beyond = f.compare("beyond", depth, near)

        columns, left_or_right = _on_axis(flow, f, "x", across, enlarged, width)
        rows, above_or_below = _on_axis(flow, f, "y", f.negate("down", along), enlarged, height)
        farther = flow.logic("farther", lambda a, b: Mux(a > b, a, b), left_or_right, above_or_below, stage=True)
        outside = f.from_fixed("outside", farther, PIXEL_BITS)
        off = f.compare("off", outside, f.multiply("pixels", enlarged, texel_size))
        near = flow.logic("near", lambda farther, less: less | ~farther.any(), farther, off["less"])
        visible = flow.logic("visible", lambda *all_of: Cat(*all_of).all(), facing["greater"], beyond["greater"], near)

        def shown(name: str, node: Node) -> Node:
            return flow.logic(name, lambda visible, value: Mux(visible, value, 0), visible, node)

        return {
            "visible": visible,
            "depth": shown("depth_out", depth),
            "above": shown("above_out", above),
            "outside": shown("outside_out", outside),
            "column": [shown(f"column{k}", column) for k, column in enumerate(columns)],
            "row": [shown(f"row{k}", row) for k, row in enumerate(rows)],
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


def _on_axis(
    flow: Dataflow, f: FloatFlow, name: str, place: Node, enlarged: Node, size: Node
) -> tuple[list[Node], Node]:
    """Of one axis of the screen: the two pixels around the place, and how far it is beyond either end."""
    moved = f.to_fixed_down(f"{name}_moved", f.multiply(f"{name}_scaled", place, enlarged), PIXEL_BITS)
    at = flow.logic(f"{name}_at", from_the_first_end, moved, size, stage=True)
    taps = [flow.logic(f"{name}_tap{k}", lambda at, size, k=k: tap(at, size, k), at, size) for k in range(2)]
    return taps, flow.logic(f"{name}_beyond", beyond, at, size, stage=True)


def from_the_first_end(moved: Value, size: Value) -> Value:
    """A place on an axis, signed, from its distance from the middle; both in 1/2**PIXEL_BITS pixels."""
    return moved.as_signed() + (size << PIXEL_BITS - 1)


def tap(at: Value, size: Value, offset: int) -> Value:
    """`offset` beyond the greatest integer that is not more than a place less a half, kept in 0 to size - 1."""
    # A slice, not a shift: a shift's copies of the sign come from its own upper bits, a loop to some tools.
    first = (at.as_signed() - (1 << PIXEL_BITS - 1))[PIXEL_BITS:].as_signed() + offset
    last = size - 1
    return Mux(first < 0, 0, Mux(first > last, last, first))[:SCREEN_BITS]


def beyond(at: Value, size: Value) -> Value:
    """How far a place is beyond either end of an axis, 31 bits, saturating; 0 between them."""
    place = at.as_signed()
    after = place - (size << PIXEL_BITS)
    distance = Mux(place < 0, -place, Mux(after > 0, after, 0)).as_unsigned()
    return Cat(distance[:MOST_BITS] | distance[MOST_BITS:].any().replicate(len(distance[:MOST_BITS])))

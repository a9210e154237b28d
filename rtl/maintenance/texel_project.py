# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""From a texel to the screen; `golden_model.maintenance.selection.texel_project` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Mux, Value

from lightloom.golden_model.contract.formats import SCREEN_BITS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.intersection.float_flow import FloatFlow


class TexelProject(DataflowCore):
    """15 multiplications, 15 additions, a division."""

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
        facing_slack: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        moved = [f.subtract(f"moved{k}", position[k], eye[k]) for k in range(3)]
        depth = f.dot("depth", moved, forward)
        enlarged = f.divide("enlarged", focal, depth)  # pixels a unit of length, at this depth
        across, along = f.dot("across", moved, right), f.dot("along", moved, up)
        under = f.dot("under", normal, moved)
        horizon = f.negate("horizon", f.multiply("slack", facing_slack, depth))
        above = f.negate("above", under)
        facing = f.compare("facing", above, horizon)
        beyond = f.compare("beyond", depth, near)

        columns, left_or_right = _on_axis(flow, f, "x", across, enlarged, width)
        rows, above_or_below = _on_axis(flow, f, "y", f.negate("down", along), enlarged, height)
        outside = f.maximum("outside", left_or_right, above_or_below)
        off = f.compare("off", outside, f.multiply("pixels", enlarged, texel_size))
        visible = flow.logic(
            "visible", lambda *all_of: Cat(*all_of).all(), facing["greater"], beyond["greater"], off["less"]
        )

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


def _on_axis(
    flow: Dataflow, f: FloatFlow, name: str, place: Node, enlarged: Node, size: Node
) -> tuple[list[Node], Node]:
    """Of one axis of the screen: the two pixels around the coordinate, and how far beyond either end it is."""
    scaled = f.multiply(f"{name}_scaled", place, enlarged)
    # The size waits as an integer of few bits.
    late = flow.logic(f"{name}_size", lambda size, _: size, size, enlarged)
    whole = f.from_fixed(f"{name}_size_float", late)
    coordinate = f.add(name, scaled, f.from_fixed(f"{name}_size_half", late, 1))
    doubled = f.to_fixed_down(f"{name}_doubled", coordinate, 1)
    taps = [
        flow.logic(f"{name}_tap{k}", lambda doubled, size, k=k: tap(doubled, size, k), doubled, size) for k in range(2)
    ]
    before = f.negate(f"{name}_before", coordinate)
    return taps, f.maximum(f"{name}_outside", before, f.subtract(f"{name}_after", coordinate, whole))


def tap(doubled: Value, size: Value, offset: int) -> Value:
    """`offset` beyond the greatest integer that is not more than a coordinate less a half, kept in 0 to size - 1."""
    first = ((doubled.as_signed() - 1) >> 1) + offset
    last = size - 1
    return Mux(first < 0, 0, Mux(first > last, last, first))[:SCREEN_BITS]

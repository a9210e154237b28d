# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""A texel against four pixels; `golden_model.engine.selection.texel_match` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Mux, Value

from lightloom.golden_model.contract.formats import HIDDEN, LIKELY, LOD_BITS, SEEN, SHORTEST, TAPS
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.intersection.float_flow import ONE, FloatFlow, bits_of


class TexelMatch(DataflowCore):
    """24 multiplications, 20 additions, a division, 12 comparisons."""

    declared = PURE["texel_match"]

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        normal: list[Node],
        depth: Node,
        above: Node,
        outside: Node,
        right: list[Node],
        up: list[Node],
        focal: Node,
        depth_slopes: Node,
        depth_limit: Node,
        depth_relative: Node,
        depth_fixed: Node,
        pixel_depth: list[Node],
        pixel_normal: list[Node],
        pixel_lod: list[Node],
        normal_test: Node,
        depth_test: Node,
        normal_cosine: Node,
        depth_doubt: Node,
        lod_levels: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        leaning = [f.absolute(f"lean_{k}", f.dot(f"normal_{k}", normal, axis)) for k, axis in enumerate((right, up))]
        lean = f.multiply("lean_depth", f.add("lean", *leaning), depth)
        distance = f.multiply("distance", focal, f.absolute("height", above))
        steep = f.divide("steep", lean, f.maximum("distance_kept", distance, bits_of(SHORTEST)))
        margin = f.add("margin", ONE, outside)
        reach = f.multiply("reach", margin, depth_slopes)
        slope = f.minimum("slope", f.multiply("rise", steep, reach), depth_limit)
        relative = f.multiply("relative", f.add("slope_relative", slope, depth_relative), depth)
        tolerance = f.add("tolerance", relative, depth_fixed)
        doubt = f.multiply("doubt", tolerance, depth_doubt)

        def outcome(k: int) -> Node:
            """What pixel k says."""
            behind = f.subtract(f"behind{k}", depth, pixel_depth[k])
            facing = [f.from_half(f"normal{k}_{axis}", pixel_normal[3 * k + axis]) for axis in range(3)]
            cosine = f.dot(f"cosine{k}", normal, facing)
            by_depth = f.compare(f"depths{k}", f.absolute(f"apart{k}", behind), tolerance)
            not_behind = f.compare(f"order{k}", behind, doubt)["less"]
            by_normal = f.compare(f"normals{k}", cosine, normal_cosine)
            same_depth, same_normal = (
                flow.logic(f"same_{what}{k}", lambda one, other: one | other, order[side], order["equal"])
                for what, order, side in (("depth", by_depth, "less"), ("normal", by_normal, "greater"))
            )
            empty = flow.logic(f"empty{k}", lambda z: z == bits_of(float("inf")), pixel_depth[k])
            tests = normal_test, depth_test, same_normal, same_depth, not_behind, empty
            return flow.logic(f"outcome{k}", degree, *tests)

        outcomes = [outcome(k) for k in range(TAPS)]
        best = flow.logic("best", greatest, *outcomes)
        level = flow.logic("level", finest, *outcomes, *pixel_lod)
        return {
            "degree": best,
            "lod": flow.logic("lod", level_of_detail, best, level, lod_levels),
        }


def degree(
    normal_test: Value, depth_test: Value, same_normal: Value, same_depth: Value, not_behind: Value, empty: Value
) -> Value:
    """HIDDEN, LIKELY or SEEN."""
    seen = (normal_test | depth_test) & (same_normal | ~normal_test) & (same_depth | ~depth_test)
    one_of_two = empty | (depth_test & (same_depth | (same_normal & not_behind)))
    doubtful = Mux(normal_test, one_of_two, not_behind | ~depth_test)
    return Mux(seen, SEEN, Mux(doubtful, LIKELY, HIDDEN))


def greatest(*degrees: Value) -> Value:
    """Of HIDDEN to SEEN."""
    seen, likely = (any_is(degrees, one) for one in (SEEN, LIKELY))
    return Mux(seen, SEEN, Mux(likely, LIKELY, HIDDEN))


def any_is(degrees: tuple[Value, ...], wanted: int) -> Value:
    found = degrees[0] == wanted
    for each in degrees[1:]:
        found |= each == wanted
    return found


def finest(*operands: Value) -> Value:
    """The least level of the pixels that see the texel; outcomes, then levels."""
    degrees, levels = operands[:TAPS], operands[TAPS:]
    least = Mux(degrees[0] == SEEN, levels[0].as_signed(), COARSEST)
    for each, level in zip(degrees[1:], levels[1:], strict=True):
        own = Mux(each == SEEN, level.as_signed(), COARSEST)
        least = Mux(own < least, own, least)
    return least


COARSEST = (1 << 15) - 1


def level_of_detail(best: Value, level: Value, levels: Value) -> Value:
    """In whole levels, kept in 0 to `levels`; 0 for a texel that is not seen."""
    whole = (level.as_signed() + (1 << LOD_BITS >> 1)) >> LOD_BITS
    kept = Mux(whole < 0, 0, Mux(whole > levels, levels, whole))
    return Mux(best == SEEN, kept, 0)[:2]

"""A ray against the boxes of a node's children; reads side by side with `golden_model.node_test`, which explains it."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import combinations
from operator import or_
from typing import Any

from amaranth import Cat, Const, Mux, Value

from golden_model.formats import NODE_EXPONENT_MAX, POSITION_BITS, SLOPE_BITS, TIME_BITS, WIDTH
from rtl.config import Config
from rtl.dataflow import Dataflow, DataflowCore, Node
from rtl.operators.fields import add_with_carry
from rtl.pipeline import stage_cuts

WIDTHS = (4, WIDTH)
"""How many boxes a node test may have testers for."""
STEPS = 12
"""Combinational steps from a ray and a node to the list of children; a register stage may stand after each."""

FRACTION = 2
"""Bits of the ray's unit below a lattice unit, at coarseness 0."""
SHORT_BITS = 12
"""Bits of the slope that multiply a child's plane."""
ALIGN = 4
"""Places that such a product is shifted left before it is shifted right, so that all shifts go one way."""
CORNER_BITS = 22
"""A corner of a node on the lattice; 255 * 2**13 from its origin it may lie beyond the lattice's end."""
WAY_BITS = 25
"""The way from the ray's position to a corner, signed."""
ROW_BITS = SLOPE_BITS // 2
"""Bits of the slope in each of the two rows of a long product."""
SHORT_PRODUCT_BITS = 20
"""A plane times a short slope, also of one rounded up to 2**12."""
SUM_BITS = 27
"""A distance before the steepness applies, signed. No operands overflow it, whatever their bits."""


class Steps:
    """Logic in numbered steps, with register stages after some of them; what an earlier step gave waits for its use."""

    def __init__(self, flow: Dataflow, depth: int):
        self._flow = flow
        self._cuts = stage_cuts(STEPS, depth)

    def __call__(self, step: int, name: str, function: Callable[..., Any], *operands: Node) -> Node:
        """The node `name`: `function` of what earlier steps gave, computed in the step of that number."""
        start = sum(cut < step for cut in self._cuts)
        ready = (self._flow.source(self._flow.at(node, start), node.name, start) for node in operands)
        return self._flow.logic(name, function, *ready, stage=step in self._cuts)


class NodeTest(DataflowCore):
    """One node a cycle. Multipliers: 6 of 26x18 bits, in two rows each; 6 of 8x12 or 8x13 bits a box.

    `config.node_test_depth` register stages, 0 to 12. Children in slots from `config.width` on do not count.
    Raises ValueError for a width other than 4 or 8 and for a depth out of range.
    """

    unit_name = "node_test"

    def __init__(self, config: Config):
        if config.width not in WIDTHS:
            raise ValueError(f"node_test: width must be 4 or {WIDTH}, not {config.width}")
        if not 0 <= config.node_test_depth <= STEPS:
            raise ValueError(f"node_test: depth must be 0 to {STEPS}, not {config.node_test_depth}")
        super().__init__(config)

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        position: list[Node],
        backwards: list[Node],
        slope: list[Node],
        steepness: list[Node],
        pad: Node,
        coarseness: Node,
        blind: Node,
        t_min: Node,
        t_max: Node,
        count: Node,
        exponent: list[Node],
        origin: list[Node],
        **planes: list[Node],
    ) -> Mapping[str, Any]:
        step = Steps(flow, config.node_test_depth)
        near: list[list[Node]] = []  # (axis, slot): distances to the planes of the boxes that the ray meets first
        far: list[list[Node]] = []
        for k, axis in enumerate("xyz"):
            corner = step(0, f"corner_{axis}", first_corner, origin[k], backwards[k], exponent[k], coarseness)
            way = step(1, f"way_{axis}", way_to, corner, position[k], backwards[k])
            lower, upper = planes[f"lower_{axis}"][: config.width], planes[f"upper_{axis}"][: config.width]
            shared = {
                "backwards": backwards[k],
                "slope": slope[k],
                "shift": step(2, f"shift_{axis}", plane_shift, exponent[k], coarseness),
                "steepness": steepness[k],
                "beyond": step(5, f"beyond_{axis}", bits_beyond, steepness[k]),
            }
            near.append(
                distances(
                    step,
                    f"near_{axis}",
                    way=step(2, f"near_way_{axis}", lambda way, pad: way - pad, way, pad),
                    total=near_total,
                    short=step(2, f"near_short_{axis}", short_slope, slope[k]),
                    forward_planes=lower,
                    backward_planes=upper,
                    **shared,
                )
            )
            far.append(
                distances(
                    step,
                    f"far_{axis}",
                    way=step(2, f"far_way_{axis}", lambda way, pad: way + pad, way, pad),
                    total=far_total,
                    short=step(2, f"far_short_{axis}", lambda slope: short_slope(slope) + 1, slope[k]),
                    forward_planes=upper,
                    backward_planes=lower,
                    **shared,
                )
            )
        entry, leave = [], []
        for slot in range(config.width):
            x, y, z = (distance[slot] for distance in near)
            earlier, later = step(7, f"entry_xy{slot}", greater, x, y), step(7, f"entry_z{slot}", greater, z, t_min)
            entry.append(step(8, f"entry{slot}", entered, earlier, later, blind))
            x, y, z = (distance[slot] for distance in far)
            earlier, later = step(7, f"leave_xy{slot}", lesser, x, y), step(7, f"leave_z{slot}", lesser, z, t_max)
            leave.append(step(8, f"leave{slot}", lesser, earlier, later))
        return sorted_hits(step, entry, leave, count)


def distances(
    step: Steps,
    name: str,
    *,
    way: Node,
    total: Callable[..., Value],
    short: Node,
    forward_planes: list[Node],
    backward_planes: list[Node],
    backwards: Node,
    slope: Node,
    shift: Node,
    steepness: Node,
    beyond: Node,
) -> list[Node]:
    """To the near or to the far plane of every box, on one axis; which of the two it is turns with the ray."""
    low = step(3, f"{name}_low", lambda way, slope: way * slope[:ROW_BITS], way, slope)
    high = step(3, f"{name}_high", lambda way, slope: way * slope[ROW_BITS:], way, slope)
    base = step(4, f"{name}_base", total, way, low, high)
    out = []
    for slot, (forward, backward) in enumerate(zip(forward_planes, backward_planes, strict=True)):
        product = step(3, f"{name}{slot}_product", plane_product, backwards, forward, backward, short)
        moved = step(4, f"{name}{slot}_moved", lambda p, shift: Cat(Const(0, ALIGN), p) >> shift, product, shift)
        whole = step(5, f"{name}{slot}_sum", lambda base, moved: (base + moved)[:SUM_BITS].as_signed(), base, moved)
        out.append(step(6, f"{name}{slot}", steepened, whole, steepness, beyond))
    return out


# --- a node's corner and the planes of its boxes ----------------------------------------------------------------------


def first_corner(origin: Value, backwards: Value, exponent: Value, coarseness: Value) -> Value:
    """The node's corner that the ray meets first, in the ray's units."""
    corner = origin + Mux(backwards, Const(255, 8) << limited(exponent), 0)
    return Cat(Const(0, FRACTION), corner[:CORNER_BITS]) >> coarseness


def limited(exponent: Value) -> Value:
    return Mux(exponent > NODE_EXPONENT_MAX, NODE_EXPONENT_MAX, exponent)


def way_to(corner: Value, position: Value, backwards: Value) -> Value:
    """corner - (position - POSITION_BIAS), or its negative where the ray goes backwards, with one adder."""
    turned = backwards.replicate(WAY_BITS)
    # Without its bias, a position is not negative where its highest bit is set.
    complement = Cat(~position[:-1], position[-1].replicate(WAY_BITS - POSITION_BITS + 1))
    return add_with_carry(Cat(corner, Const(0, 1)) ^ turned, complement ^ turned, Const(1, 1))[:WAY_BITS].as_signed()


def plane_shift(exponent: Value, coarseness: Value) -> Value:
    """Places that the product of a plane moves to the right; from 24 on nothing is left of it."""
    shift = (SHORT_BITS - 1 + ALIGN - FRACTION + coarseness - limited(exponent))[:6]
    return Mux(shift[5], 31, shift[:5])


def short_slope(slope: Value) -> Value:
    return slope[SLOPE_BITS - SHORT_BITS :]


def plane_product(backwards: Value, forward: Value, backward: Value, short: Value) -> Value:
    """Seen backwards, planes count from 255 downwards."""
    return (Mux(backwards, ~backward, forward) * short)[:SHORT_PRODUCT_BITS]


# --- distances --------------------------------------------------------------------------------------------------------


def near_total(way: Value, low: Value, high: Value) -> Value:
    """way * slope, or way * (slope + 1) where the way is negative, rounded down."""
    return scaled(low + upper_row(high) + Mux(way < 0, way, 0))


def far_total(way: Value, low: Value, high: Value) -> Value:
    """way * slope, or way * (slope + 1) where the way is not negative, rounded down and 1 added; 1 more for the planes,
    whose products are rounded down too."""
    return scaled(low + upper_row(high) + Mux(way < 0, 0, way) + (2 << (SLOPE_BITS - 1)))


def upper_row(high: Value) -> Value:
    return Cat(Const(0, ROW_BITS), high).as_signed()


def scaled(product: Value) -> Value:
    """A slope of 1 is 2**17."""
    return product[SLOPE_BITS - 1 :][:SUM_BITS].as_signed()


def bits_beyond(steepness: Value) -> Value:
    """Ones where a bit of a distance other than its sign is shifted too far to have a place in a time."""
    limits = (max(TIME_BITS - 1 - place, 0) for place in range(SUM_BITS - 1))
    return Cat(steepness >= limit if limit else Const(1, 1) for limit in limits)


def steepened(distance: Value, steepness: Value, beyond: Value) -> Value:
    """distance * 2**steepness, saturated, with TIME_BIAS added, which turns the sign over."""
    sign = distance[-1]
    saturates = ((distance[:-1] ^ sign.replicate(SUM_BITS - 1)) & beyond).any()
    shifted = (distance[: TIME_BITS - 1] << steepness)[: TIME_BITS - 1]
    return Cat(Mux(saturates, (~sign).replicate(TIME_BITS - 1), shifted), ~sign)


def greater(a: Value, b: Value) -> Value:
    return Mux(a > b, a, b)


def lesser(a: Value, b: Value) -> Value:
    return Mux(a < b, a, b)


def entered(a: Value, b: Value, blind: Value) -> Value:
    """A blind ray enters every box at the least time of all, which is never after it has left."""
    return Mux(blind, 0, greater(a, b))


# --- the list of children ---------------------------------------------------------------------------------------------


def sorted_hits(step: Steps, entry: list[Node], leave: list[Node], count: Node) -> dict[str, Any]:
    """Compares all pairs of boxes at once: the place of a hit is the number of hits before it."""
    width = len(entry)
    hits = step(9, "hits", entered_in_time, count, *entry, *leave)
    order = step(9, "order", pairs_in_order, *entry)
    chosen = step(10, "chosen", lambda hits, order: by_place(hits, order, width), hits, order)
    slots = [Const(k, 3) for k in range(width)]
    listed_slots, listed_entries = [], []
    for place in range(width):
        here = slice(place * width, (place + 1) * width)
        listed_slots.append(step(11, f"slot_out{place}", lambda chosen, here=here: pick(chosen[here], slots), chosen))
        listed_entries.append(
            step(11, f"entry_out{place}", lambda chosen, *entry, here=here: pick(chosen[here], entry), chosen, *entry)
        )
    # A narrow test leaves the rest of the list empty.
    end = listed_slots[0].time
    empty = [Node(0, end, "empty")] * (WIDTH - width)
    total = step(10, "total", ones, hits)
    return {
        "count": step(11, "count_out", lambda total: total, total),
        "slot": listed_slots + empty,
        "entry": listed_entries + empty,
    }


def entered_in_time(count: Value, *times: Value) -> Value:
    """A bit a slot; `times` are all entries, then all times at which the ray leaves a box."""
    width = len(times) // 2
    return Cat((slot < count) & (times[slot] <= times[width + slot]) for slot in range(width))


def pairs_in_order(*entry: Value) -> Value:
    """Of every pair of slots, whether the lower one comes first; it does where both are entered at once."""
    return Cat(a <= b for a, b in combinations(entry, 2))


def by_place(hits: Value, order: Value, width: int) -> Value:
    """For each place of the list `width` bits: which slot stands there, if any."""
    bit = {pair: order[index] for index, pair in enumerate(combinations(range(width), 2))}
    places = []
    for k in range(width):
        before = [bit[j, k] if j < k else ~bit[k, j] for j in range(width) if j != k]
        others = [hits[j] for j in range(width) if j != k]
        places.append(ones(Cat(hit & first for hit, first in zip(others, before, strict=True))))
    return Cat(hits[k] & (places[k] == place) for place in range(width) for k in range(width))


def ones(bits: Value) -> Value:
    """How many bits are set."""
    if len(bits) == 1:
        return bits
    half = len(bits) // 2
    return ones(bits[:half]) + ones(bits[half:])


def pick(chosen: Value, values: Sequence[Value]) -> Value:
    """The value whose bit is set, of at most one; zero for none."""
    return reduce(or_, (Mux(bit, value, 0) for bit, value in zip(chosen, values, strict=True)))

"""A ray against the boxes of a node's children; `golden_model.tracing.wide_bvh.node_test` explains it."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

from amaranth import Cat, Const, Mux, Value

from lightloom.golden_model.contract.formats import WIDTH
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.fabric.one_hot import pick
from lightloom.rtl.intersection.box_axis import TRUE, Steps, distances


class NodeTest(DataflowCore):
    """One node a cycle. Multipliers: 6 of 26x18 bits, in two rows each; 6 of 8x12 or 8x13 bits a box.

    `config.node_test.depth` register stages. Children in slots from `config.tree.width` on do not count.
    """

    declared = PURE["node_test"]

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
        step = Steps(self._graph, flow, config.node_test.depth)
        near: list[list[Node]] = []  # (axis, slot): times at which the ray meets the planes
        far: list[list[Node]] = []
        for k, axis in enumerate("xyz"):
            first, last = distances(
                step,
                axis,
                TRUE,
                position=position[k],
                backwards=backwards[k],
                slope=slope[k],
                steepness=steepness[k],
                pad=pad,
                coarseness=coarseness,
                exponent=exponent[k],
                origin=origin[k],
                lower=planes[f"lower_{axis}"][: config.tree.width],
                upper=planes[f"upper_{axis}"][: config.tree.width],
                blocks=config.operators.multiplier_blocks,
            )
            near.append(first)
            far.append(last)
        entry, leave = [], []
        for slot in range(config.tree.width):
            x, y, z = (distance[slot] for distance in near)
            earlier, later = step(10, f"entry_xy{slot}", greater, x, y), step(10, f"entry_z{slot}", greater, z, t_min)
            entry.append(step(11, f"entry{slot}", entered, earlier, later, blind))
            x, y, z = (distance[slot] for distance in far)
            earlier, later = step(10, f"leave_xy{slot}", lesser, x, y), step(10, f"leave_z{slot}", lesser, z, t_max)
            leave.append(step(11, f"leave{slot}", lesser, earlier, later))
        return sorted_hits(step, entry, leave, count)


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
    hits = step(12, "hits", entered_in_time, count, *entry, *leave)
    order = step(12, "order", pairs_in_order, *entry)
    chosen = step(13, "chosen", lambda hits, order: by_place(hits, order, width), hits, order)
    slots = [Const(k, 3) for k in range(width)]
    listed_slots, listed_entries = [], []
    for place in range(width):
        here = slice(place * width, (place + 1) * width)
        listed_slots.append(step(14, f"slot_out{place}", lambda chosen, here=here: pick(chosen[here], slots), chosen))
        listed_entries.append(
            step(14, f"entry_out{place}", lambda chosen, *entry, here=here: pick(chosen[here], entry), chosen, *entry)
        )
    # A narrow test leaves the rest of the list empty.
    end = listed_slots[0].time
    empty = [Node(0, end, "empty")] * (WIDTH - width)
    total = step(13, "total", ones, hits)
    return {
        "count": step(14, "count_out", lambda total: total, total),
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

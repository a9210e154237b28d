# amaranth: UnusedElaboratable=no
# (a unit is also made only to ask for its latency)
"""The blend update; `golden_model.engine.sampling.texel_blend` explains it."""

from collections.abc import Mapping
from typing import Any

from amaranth import Cat, Mux, Value

from lightloom.golden_model.contract.formats import (
    COUNT_BITS,
    COUNT_MAX,
    NOTICE_BITS,
    ONE_SAMPLE,
    RAY_GROUPS,
    RELATIVE_BITS,
    RELATIVE_MAX,
)
from lightloom.golden_model.contract.interfaces import PURE
from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, DataflowCore, Node
from lightloom.rtl.intersection.float_flow import FloatFlow, bits_of

WEIGHTS = [bits_of(0.25), bits_of(0.5), bits_of(0.25)]
"""Of red, green and blue in a luminance."""
RELATIVE_WIDTH = RELATIVE_MAX.bit_length()


class TexelBlend(DataflowCore):
    """13 multiplications, 14 additions, 7 divisions, a root, 13 conversions of integers."""

    declared = PURE["texel_blend"]

    def compute(
        self,
        flow: Dataflow,
        config: Config,
        *,
        irradiance: list[Node],
        count: Node,
        heavy: Node,
        deviation: Node,
        bias: Node,
        total: list[Node],
        sums: list[Node],
        squares: list[Node],
        rays: list[Node],
        fraction: Node,
        alpha_min: Node,
        alpha_heavy: Node,
        notice_factor: Node,
        notice_floor: Node,
        notice_count: Node,
    ) -> Mapping[str, Any]:
        f = FloatFlow(flow, config.operators)
        known = flow.logic("known", lambda count: count.any(), count)
        whole = flow.logic("whole_samples", lambda count: count[COUNT_BITS:], count)
        wide = [flow.logic(f"total{k}_wide", sign_extended, each) for k, each in enumerate(total)]
        sample = [f.from_fixed64(f"sample{k}", each, fraction) for k, each in enumerate(wide)]

        spread = _spread(flow, f, sums, squares, rays)
        alpha = _alpha(flow, f, count, heavy, alpha_min, alpha_heavy)
        latest, departure = _departure(flow, f, irradiance, sample)
        departures = flow.logic("departures", running_departure, departure, bias, whole, stage=True)
        moved = []
        for k, (old, new) in enumerate(zip(irradiance, sample, strict=True)):
            step = f.multiply(f"step{k}", f.subtract(f"change{k}", new, old), alpha)
            moved.append(f.add(f"moved{k}", old, step))
        return {
            "irradiance": [
                flow.logic(f"irradiance{k}_out", lambda known, moved, new: Mux(known, moved, new), known, *pair)
                for k, pair in enumerate(zip(moved, sample, strict=True))
            ],
            "count": flow.logic("count_out", one_more, count),
            "heavy": flow.logic("heavy_out", lambda heavy: Mux(heavy.any(), heavy - 1, 0)[:3], heavy),
            "noticed": flow.logic(
                "noticed_out", noticed, latest, deviation, count, notice_factor, notice_floor, notice_count
            ),
            "deviation": flow.logic("deviation_out", running_deviation, latest, deviation, whole),
            "bias": flow.logic("bias_out", running_bias, departures, whole, heavy),
            "spread": spread,
        }


def _alpha(flow: Dataflow, f: FloatFlow, count: Node, heavy: Node, alpha_min: Node, alpha_heavy: Node) -> Node:
    """The weight of the sample."""
    samples = f.from_fixed64("samples", flow.logic("count_and_one", lambda count: count + ONE_SAMPLE, count))
    alpha = f.maximum("alpha", f.divide("mean", bits_of(float(ONE_SAMPLE)), samples), alpha_min)
    raised = f.maximum("alpha_raised", alpha, alpha_heavy)
    return flow.logic("weight", lambda heavy, raised, alpha: Mux(heavy.any(), raised, alpha), heavy, raised, alpha)


def _departure(flow: Dataflow, f: FloatFlow, old: list[Node], sample: list[Node]) -> tuple[Node, Node]:
    """Of the sample from the average, over the average: how far, and the same with its sign."""
    before, after = f.dot("before", old, WEIGHTS), f.dot("after", sample, WEIGHTS)
    difference = f.subtract("difference", after, before)
    distance = f.absolute("distance", difference)
    fixed = f.to_fixed("latest", f.divide("relative", distance, before), RELATIVE_BITS)
    darker = flow.logic("darker", lambda difference: difference[-1], difference)
    # Registers behind both: what follows adds up several times.
    return (
        flow.logic("latest_kept", kept, fixed, stage=True),
        flow.logic("departure", lambda fixed, darker: with_sign(kept(fixed), darker), fixed, darker, stage=True),
    )


def _spread(flow: Dataflow, f: FloatFlow, sums: list[Node], squares: list[Node], rays: list[Node]) -> Node:
    """The standard error of the sample, over the sample."""

    def variance(k: int) -> Node:
        """Of the rays of a group."""
        n = f.from_fixed64(f"rays{k}_float", rays[k])
        summed = f.from_fixed64(f"sums{k}_float", sums[k])
        mean = f.divide(f"mean_of_squares{k}", f.multiply(f"sum_squared{k}", summed, summed), n)
        about = f.subtract(f"about_mean{k}", f.from_fixed64(f"squares{k}_float", squares[k]), mean)
        others = f.from_fixed64(f"others{k}", flow.logic(f"rays{k}_but_one", lambda n: (n - 1)[: len(n)], rays[k]))
        several = flow.logic(
            f"factor{k}_kept", lambda rays, z: Mux(rays > 1, z, 0), rays[k], f.divide(f"factor{k}", n, others)
        )
        return f.multiply(f"variance{k}", f.maximum(f"about{k}_kept", about, bits_of(0)), several)

    both = f.add("variance", *(variance(k) for k in range(RAY_GROUPS)))
    total = f.from_fixed64("light", flow.logic("light_sum", lambda one, other: one + other, *sums))
    fixed = f.to_fixed("spread", f.divide("spread_part", f.sqrt("error", both), total), RELATIVE_BITS)
    return flow.logic("spread_kept", kept, fixed)


def one_more(count: Value) -> Value:
    """The count after a sample."""
    more = count + ONE_SAMPLE
    return Mux(more > COUNT_MAX, COUNT_MAX, more)[: len(count)]


def sign_extended(total: Value) -> Value:
    return Cat(total, total[-1].replicate(64 - len(total)))


def kept(fixed: Value) -> Value:
    """A figure in 0 to RELATIVE_MAX."""
    over = fixed[RELATIVE_WIDTH:31].any()
    return (fixed[:RELATIVE_WIDTH] | over.replicate(RELATIVE_WIDTH)) & ~fixed[31].replicate(RELATIVE_WIDTH)


def noticed(latest: Value, usual: Value, count: Value, factor: Value, floor: Value, least: Value) -> Value:
    """Whether a sample departs from an average that is a measure by more than is usual."""
    limit = factor * usual + (floor << NOTICE_BITS)
    return count.any() & (count[COUNT_BITS:] >= least) & ((latest << NOTICE_BITS) > limit)


def running_deviation(latest: Value, usual: Value, count: Value) -> Value:
    """The mean of `count` deviations after one more."""
    return Mux(count.any(), moved_mean(latest, usual, count), 0)[:RELATIVE_WIDTH]


def with_sign(latest: Value, darker: Value) -> Value:
    """How far a sample departs, below 0 to the darker side."""
    return Mux(darker, -latest, latest)


def running_departure(departure: Value, bias: Value, count: Value) -> Value:
    """The mean of `count` departures, the bias, after one more."""
    return moved_mean(departure, bias.as_signed(), count)[: len(bias)].as_signed()


def running_bias(mean: Value, count: Value, heavy: Value) -> Value:
    """A mean of `count` departures less what the average takes of it: 1/2, 1/4, 1/8 or none."""
    magnitude = magnitude_of(mean)
    settling = by_weight(count, magnitude >> 1, magnitude >> 2, magnitude >> 3, 0)
    left = magnitude - Mux(heavy.any(), magnitude >> 1, settling)
    return Mux(count.any(), Mux(mean[-1], -left, left), 0)[: len(mean)]


def moved_mean(latest: Value, mean: Value, count: Value) -> Value:
    """A mean after one more: the weight of the latest is 1, 1/2, 1/4 or 1/8, the step rounded away from 0."""
    difference = latest - mean
    magnitude = magnitude_of(difference)
    eighth, quarter, half = ((magnitude + (1 << shift) - 1) >> shift for shift in (3, 2, 1))
    step = by_weight(count, magnitude, half, quarter, eighth)
    return Mux(difference[-1], mean - step, mean + step)


def by_weight(count: Value, whole: Value, half: Value, quarter: Value, eighth: Value | int) -> Value:
    """What goes with the weight of the latest of so many samples."""
    return Mux(count >= 8, eighth, Mux(count >= 4, quarter, Mux(count >= 2, half, whole)))


def magnitude_of(number: Value) -> Value:
    negative = number[-1]
    return (number ^ negative.replicate(len(number)))[: len(number) - 1] + negative

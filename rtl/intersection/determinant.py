"""The determinant of a ray-triangle test and its reciprocal, as far as a hit needs them.

In a hit the edge functions are of one sign, so their magnitudes are added, without cancellation. Where they are not,
and where the reciprocal is out of range, the test is a miss, and nobody looks at what comes out here.
"""

from collections.abc import Callable

from amaranth import Cat, Const, Mux, Value

from lightloom.rtl.config import Config
from lightloom.rtl.fabric.dataflow import Dataflow, Node
from lightloom.rtl.fabric.float_format import INFINITY
from lightloom.rtl.fabric.pipeline import balanced_cuts
from lightloom.rtl.intersection.float_flow import FloatFlow, exponent, is_zero

DIGITS = 12
"""Of the quotient, two bits each, after its first bit: 23 bits of the significand and the guard bit."""


def determinant_of(flow: Dataflow, config: Config, a: Node, b: Node, c: Node) -> Node:
    """|a + b + c| of edge functions of one sign; bits from 31 on are anything."""
    if flow.interval > 2:  # two operations more for adders that are there are less than two sums of their own
        f = FloatFlow(flow, config.operators)
        return f.add("determinant", f.add("edge_ab", a, b), c)
    edge_ab = sum_of_magnitudes(flow, config, "edge_ab", a, b)
    return sum_of_magnitudes(flow, config, "determinant", edge_ab, c, stage=False)


def sum_of_magnitudes(flow: Dataflow, config: Config, name: str, a: Node, b: Node, *, stage: bool = True) -> Node:
    """|a| + |b| of results of operators, rounded to nearest even: 31 bits; all ones in the exponent if either has them.

    Takes up to four register stages; without `stage` the last is left to the caller.
    """
    steps: list[Callable[..., Value]] = [ordered, aligned, added, rounded]
    cuts = balanced_cuts([1] * len(steps), min(config.operators.add_depth, len(steps)))
    operands = [a, b]
    for index, step in enumerate(steps[:-1]):
        operands = [flow.logic(f"{name}_{step.__name__}", step, *operands, stage=index in cuts)]
    return flow.logic(name, rounded, *operands, stage=stage and len(steps) - 1 in cuts)


def ordered(a: Value, b: Value) -> Value:
    """The exponent of the greater magnitude, its significand, that of the smaller one, and places to its place.

    8, 24, 24 and 5 bits.
    """
    a, b = a[:31], b[:31]
    swap = a < b
    greater, smaller = Mux(swap, b, a), Mux(swap, a, b)
    # Both differences at once: neither waits for the comparison.
    distance = Mux(swap, exponent(b) - exponent(a), exponent(a) - exponent(b))[:8]
    shift = distance[:5] | distance[5:].any().replicate(5)  # 31 or more: beyond the 27 bits below
    return Cat(exponent(greater), significand(greater), significand(smaller), shift)


def aligned(pair: Value) -> Value:
    """The first two of these, and the smaller significand moved to its place.

    8, 24 and 27 bits: three bits below (guard, round, sticky) are enough to round correctly.
    """
    wide, shift = Cat(Const(0, 3), pair[32:56]), pair[56:]
    lost = (wide & ~(Const(-1, 27) << shift)).any()
    shifted = (wide >> shift)[:27]
    return Cat(pair[:32], shifted[0] | lost, shifted[1:])


def added(pair: Value) -> Value:
    """The exponent and the sum of the significands: 8 and 28 bits."""
    return Cat(pair[:8], (Cat(Const(0, 3), pair[8:32]) + pair[32:])[:28])


def rounded(total: Value) -> Value:
    """Exponent and fraction of the sum."""
    greater, total = total[:8], total[8:]
    carry = total[27]
    kept = Mux(carry, total[4:], total[3:27])
    guard = Mux(carry, total[3], total[2])
    sticky = total[:2].any() | (carry & total[2])
    biased = greater + carry
    packed = (Cat(kept[:23], biased[:9]) + (guard & (sticky | kept[0])))[:32]
    return Cat(packed[:31] | Mux(packed[31], Const(INFINITY << 23, 31), 0))


def significand(z: Value) -> Value:
    """24 bits, with the hidden one."""
    return Cat(z[:23], ~is_zero(z))


def reciprocal(flow: Dataflow, config: Config, name: str, x: Node, sign: Node) -> Node:
    """1 / x of 31 bits x, with a sign, rounded to nearest; where it is not usable, only its exponent says so.

    Restoring division of 1 by the significand m in [1, 2), some digits a cycle, and a cycle to round. The quotient lies
    in (1/2, 1]; for m above 1 its first bit is a one, and it is never a tie, so the guard bit alone decides. For m = 1
    the same steps give nothing but ones, which round to 1.
    """
    cycles = config.operators.reciprocal_cycles
    stage = config.operators.reciprocal_depth > 0
    divisor = flow.logic(f"{name}_divisor", lambda x: Cat(x[:23], Const(1, 1)), x)
    # Wraps where x is infinite or not a number: to an exponent that is unusable.
    biased = flow.logic(f"{name}_exponent", lambda x: (253 - exponent(x))[:8], x)
    triple = flow.logic(f"{name}_triple", lambda m: (m + (m << 1))[:26], divisor, stage=stage)
    state = flow.logic(f"{name}_state0", lambda m: (-m)[:24], divisor, stage=stage)

    def digit(state: Value, divisor: Value, triple: Value) -> Value:
        """The remainder and, above it, the quotient so far, to the same with the next digit."""
        remainder, quotient = state[:24], state[24:]
        scaled = Cat(Const(0, 2), remainder)
        once, twice, thrice = ((scaled - multiple)[:27] for multiple in (divisor, divisor << 1, triple))
        fits = [~difference[26] for difference in (once, twice, thrice)]
        remainder = Mux(fits[1], Mux(fits[2], thrice, twice), Mux(fits[0], once, scaled))[:24]
        return Cat(remainder, Mux(fits[1], fits[2], fits[0]), fits[1], quotient)

    at_once = DIGITS // cycles
    if cycles == 1:
        state = flow.applied(f"{name}_state1", digit, state, divisor, triple, at_once=at_once, stage=stage)
    else:
        state = flow.repeated(f"{name}_state", digit, state, divisor, triple, count=cycles, at_once=at_once)

    def rounded_quotient(state: Value, exponent: Value, sign: Value) -> Value:
        quotient = state[24:]
        return Cat((Cat(quotient[1:], exponent) + quotient[0])[:31], sign)

    return flow.logic(name, rounded_quotient, state, biased, sign, stage=stage)


def is_usable(reciprocal: Value) -> Value:
    """It is not 0 and below RECIPROCAL_LIMIT, the least number whose exponent's top three bits are ones."""
    return ~reciprocal[28:31].all() & ~is_zero(reciprocal)

"""The determinant of a ray-triangle test and its reciprocal, as far as a hit needs them.

In a hit the edge functions are of one sign, so their magnitudes are added, without cancellation. Where they are not,
and where the reciprocal is out of range, the test is a miss, and nobody looks at what comes out here.
"""

from amaranth import Cat, Const, Mux, Value

from rtl.config import Config
from rtl.dataflow import Dataflow, Node
from rtl.float_flow import exponent, is_zero
from rtl.operators.fields import INFINITY
from rtl.pipeline import stage_cuts

QUOTIENT_BITS = 24
"""Those after the first one: 23 of the significand and the guard bit."""
ROWS = (1, 2, 3, 4, 6, 12, 24)
"""Bits of the quotient that a cycle may find: all cycles find the same number."""


def sum_of_magnitudes(flow: Dataflow, config: Config, name: str, a: Node, b: Node, *, stage: bool = True) -> Node:
    """|a| + |b| of results of operators, rounded to nearest even: 31 bits; all ones in the exponent if either has them.

    Takes up to two register stages; without `stage` the last is left to the caller.
    """
    cuts = stage_cuts(2, min(config.add_depth, 2))
    pair = flow.logic(f"{name}_aligned", aligned, a, b, stage=0 in cuts)
    return flow.logic(name, rounded_sum, pair, stage=stage and 1 in cuts)


def aligned(a: Value, b: Value) -> Value:
    """The exponent of the greater magnitude, its significand, and that of the smaller one moved to its place.

    8, 24 and 27 bits: three bits below (guard, round, sticky) are enough to round correctly.
    """
    a, b = a[:31], b[:31]
    swap = a < b
    greater, smaller = Mux(swap, b, a), Mux(swap, a, b)
    # Both differences at once: neither waits for the comparison.
    distance = Mux(swap, exponent(b) - exponent(a), exponent(a) - exponent(b))[:8]
    shift = distance[:5] | distance[5:].any().replicate(5)  # 31 or more: beyond the 27 bits below
    wide = Cat(Const(0, 3), significand(smaller))
    lost = (wide & ~(Const(-1, 27) << shift)).any()
    shifted = (wide >> shift)[:27]
    return Cat(exponent(greater), significand(greater), shifted[0] | lost, shifted[1:])


def rounded_sum(pair: Value) -> Value:
    """The sum of what `aligned` gave: exponent and fraction."""
    total = (Cat(Const(0, 3), pair[8:32]) + pair[32:])[:28]
    carry = total[27]
    kept = Mux(carry, total[4:], total[3:27])
    guard = Mux(carry, total[3], total[2])
    sticky = total[:2].any() | (carry & total[2])
    biased = pair[:8] + carry
    packed = (Cat(kept[:23], biased[:9]) + (guard & (sticky | kept[0])))[:32]
    return Cat(packed[:31] | Mux(packed[31], Const(INFINITY << 23, 31), 0))


def significand(z: Value) -> Value:
    """24 bits, with the hidden one."""
    return Cat(z[:23], ~is_zero(z))


def reciprocal(flow: Dataflow, config: Config, name: str, x: Node, sign: Node) -> Node:
    """1 / x of 31 bits x, with a sign, rounded to nearest; where it is not usable, only its exponent says so.

    Restoring division of 1 by the significand m in [1, 2), some bits a cycle, and a cycle to round. The quotient lies
    in (1/2, 1]; for m above 1 its first bit is a one, and it is never a tie, so the guard bit alone decides. For m = 1
    the same steps give nothing but ones, which round to 1.
    """
    rows = rows_of(config)
    stage = config.divide_depth > 0
    divisor = flow.logic(f"{name}_divisor", lambda x: Cat(x[:23], Const(1, 1)), x)
    # Wraps where x is infinite or not a number: to an exponent that is unusable.
    biased = flow.logic(f"{name}_exponent", lambda x: (253 - exponent(x))[:8], x)
    state = flow.logic(f"{name}_state0", lambda m: Cat(Const(0, 1), (-m)[:24]), divisor, stage=stage)

    def bits(state: Value, divisor: Value) -> Value:
        """The quotient so far above the remainder, which is doubled, to the same with `rows` more bits."""
        remainder, quotient = state[:25], state[25:]
        for _ in range(rows):
            difference = (remainder - divisor)[:26]
            remainder = Cat(Const(0, 1), Mux(difference[25], remainder[:24], difference[:24]))
            quotient = Cat(~difference[25], quotient)
        return Cat(remainder, quotient)

    cycles = QUOTIENT_BITS // rows
    for k in range(cycles // 2):
        state = flow.twice(f"{name}_state{k + 1}", bits, state, divisor)
    if cycles % 2:
        state = flow.logic(f"{name}_state1", bits, state, divisor, stage=stage)

    def rounded(state: Value, exponent: Value, sign: Value) -> Value:
        quotient = state[25:]
        return Cat((Cat(quotient[1:], exponent) + quotient[0])[:31], sign)

    return flow.logic(name, rounded, state, biased, sign, stage=stage)


def rows_of(config: Config) -> int:
    """Bits of the quotient a cycle: as few as let the reciprocal take `divide_depth` cycles or fewer."""
    return next(count for count in ROWS if QUOTIENT_BITS // count < max(config.divide_depth, 2))


def is_usable(reciprocal: Value) -> Value:
    """It is not 0 and below RECIPROCAL_LIMIT, the least number whose exponent's top three bits are ones."""
    return ~reciprocal[28:31].all() & ~is_zero(reciprocal)

"""The box test on one axis: distances to the near and the far planes of boxes.

Reads side by side with `golden_model.tracing.wide_bvh.node_test`, which explains it. Widths are parameters, so that
narrow ones can be tried or proved completely.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from amaranth import Cat, Const, Module, Mux, Signal, Value
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from lightloom.golden_model.contract.formats import BOX_FRACTION, BOX_WIDTHS, LATTICE_BITS, POSITION_BITS, BoxWidths
from lightloom.rtl.fabric.dataflow import Dataflow, Node
from lightloom.rtl.fabric.one_hot import pick
from lightloom.rtl.fabric.pipeline import balanced_cuts
from lightloom.rtl.operators.fields import add_with_carry
from lightloom.rtl.operators.product import product_rows, sum_rows, triple

DELAYS = (32, 12, 31, 34, 36, 28, 38, 13, 20, 27, 20, 20, 20, 22, 12)
"""What each step from a ray and a node to the list of children takes, measured (0.1 ns in a slow 130 nm library); steps
0 to 9 are those of an axis."""
STEPS = len(DELAYS)
"""Combinational steps of the box test; a register stage may stand after each."""


@dataclass(frozen=True, kw_only=True)
class AxisWidths:
    """Bits of what the box test works on; those of the true one by default."""

    arithmetic: BoxWidths = BOX_WIDTHS
    lattice: int = LATTICE_BITS
    """Of a node's origin."""
    position: int = POSITION_BITS
    """Of a ray's position, biased by half of its range."""
    pad: int = 20
    shift: int = 5
    """Of coarseness and steepness, and of the places that products are shifted."""

    @property
    def align(self) -> int:
        """Places that a plane's product is shifted left before it is shifted right, so that all shifts go one way."""
        return self.arithmetic.exponent + BOX_FRACTION - (self.arithmetic.short - 1)

    @property
    def corner(self) -> int:
        """Of a node's corner on the lattice, which may lie beyond the lattice's end."""
        last = (1 << self.lattice) - 1 + (((1 << self.arithmetic.plane) - 1) << self.arithmetic.exponent)
        return last.bit_length()

    @property
    def way(self) -> int:
        """Of the way from a ray's position to a corner, signed."""
        return max(self.corner + BOX_FRACTION, self.position) + 1

    @property
    def total(self) -> int:
        """Of a distance before the steepness applies, signed. No operands overflow it, whatever their bits."""
        return self.way + 2


TRUE = AxisWidths()
"""Those of the units."""


class Steps:
    """Logic in numbered steps, with register stages after some of them; what an earlier step gave waits for its use.

    `m` is the module of the flow, for logic with signals of its own.
    """

    def __init__(self, m: Module, flow: Dataflow, depth: int):
        self.m = m
        self._flow = flow
        self._cuts = balanced_cuts(DELAYS, depth)

    def __call__(self, step: int, name: str, function: Callable[..., Any], *operands: Node) -> Node:
        """The node `name`: `function` of what earlier steps gave, computed in the step of that number."""
        start = sum(cut < step for cut in self._cuts)
        ready = (self._flow.source(self._flow.at(node, start), node.name, start) for node in operands)
        return self._flow.logic(name, function, *ready, stage=step in self._cuts)


def distances(
    step: Steps,
    axis: str,
    widths: AxisWidths,
    *,
    position: Node,
    backwards: Node,
    slope: Node,
    steepness: Node,
    pad: Node,
    coarseness: Node,
    exponent: Node,
    origin: Node,
    lower: Sequence[Node],
    upper: Sequence[Node],
    blocks: bool = False,
) -> tuple[list[Node], list[Node]]:
    """Where the ray meets the near and the far planes of the boxes: times, one a box, after step 9.

    With `blocks` the products are written for an FPGA's multiplier blocks.
    """

    def shared(number: int, name: str, function: Callable[..., Any], *operands: Node) -> Node:
        return step(number, f"{name}_{axis}", partial(function, widths), *operands)

    corner = shared(0, "corner", first_corner, origin, backwards, exponent)
    units = shared(1, "units", in_units, corner, coarseness)
    places = shared(2, "places", plane_places, exponent, coarseness)
    beyond = shared(8, "beyond", bits_beyond, steepness)

    def side(name: str, far: bool, planes: Sequence[tuple[Node, Node]]) -> list[Node]:
        """`planes` are those that a forward and that a backward ray meets."""
        way = step(2, f"{name}_way", partial(way_to, step.m, name, widths, far), units, position, backwards, pad)
        multiplier = step(3, f"{name}_multiplier", partial(multiplier_of, far), way, slope)
        short = step(2, f"{name}_short", partial(short_slope, widths, far), slope)
        factors = [short]
        if blocks:
            rows = step(4, f"{name}_rows", partial(block_way_rows, widths, far), way, multiplier)
        else:
            thrice = step(3, f"{name}_thrice", partial(triple, step.m, name=f"{name}_times3"), way)
            rows = step(4, f"{name}_rows", partial(way_rows, step.m, name, widths, far), way, thrice, multiplier)
            short_times3 = partial(triple, step.m, name=f"{name}_short_times3")
            factors.append(step(3, f"{name}_short_thrice", short_times3, short))
        base = step(5, f"{name}_base", partial(scaled, widths), rows)
        out = []
        for slot, (forward, backward) in enumerate(planes):
            box = f"{name}{slot}"
            plane = step(5, f"{box}_plane", lambda back, f, b: Mux(back, ~b, f), backwards, forward, backward)
            product = step(6, f"{box}_product", partial(plane_product, step.m, box, widths), plane, *factors)
            moved = step(7, f"{box}_moved", lambda p, places: Cat(Const(0, widths.align), p) >> places, product, places)
            whole = step(8, f"{box}_sum", lambda base, moved: (base + moved)[: widths.total].as_signed(), base, moved)
            out.append(step(9, box, partial(steepened, widths), whole, steepness, beyond))
        return out

    return (
        side(f"near_{axis}", False, list(zip(lower, upper, strict=True))),
        side(f"far_{axis}", True, list(zip(upper, lower, strict=True))),
    )


class BoxAxis(wiring.Component):
    """One axis and one box alone, without registers, of any widths: what proofs and exhaustive tests look at.

    Ports, all unsigned: those of `distances`, which become `near` and `far`, times with their bias.
    """

    def __init__(self, widths: AxisWidths = TRUE, *, blocks: bool = False):
        self._widths, self._blocks = widths, blocks
        arithmetic, shift = widths.arithmetic, widths.shift
        ports = {
            "position": widths.position,
            "backwards": 1,
            "slope": arithmetic.slope,
            "steepness": shift,
            "pad": widths.pad,
            "coarseness": shift,
            "exponent": arithmetic.exponent.bit_length(),
            "origin": widths.lattice,
            "lower": arithmetic.plane,
            "upper": arithmetic.plane,
        }
        self._inputs = tuple(ports)
        super().__init__(
            {name: In(width) for name, width in ports.items()}
            | {name: Out(arithmetic.time) for name in ("near", "far")}
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        flow = Dataflow(m, Const(1, 1))
        operands: dict[str, Any] = {name: flow.source(getattr(self, name), name) for name in self._inputs}
        operands |= {name: [operands[name]] for name in ("lower", "upper")}
        near, far = distances(Steps(m, flow, 0), "x", self._widths, blocks=self._blocks, **operands)
        m.d.comb += [self.near.eq(near[0].value), self.far.eq(far[0].value)]
        return m


# --- once a node ------------------------------------------------------------------------------------------------------


def first_corner(widths: AxisWidths, origin: Value, backwards: Value, exponent: Value) -> Value:
    """The node's corner that the ray meets first, on the lattice."""
    last = Mux(backwards, (1 << widths.arithmetic.plane) - 1, 0)
    return (origin + (last << limited(widths, exponent)))[: widths.corner]


def limited(widths: AxisWidths, exponent: Value) -> Value:
    greatest = widths.arithmetic.exponent
    return Mux(exponent > greatest, greatest, exponent)


def in_units(widths: AxisWidths, corner: Value, coarseness: Value) -> Value:
    """In the ray's units."""
    return Cat(Const(0, BOX_FRACTION), corner) >> coarseness


def way_to(
    m: Module, name: str, widths: AxisWidths, far: bool, corner: Value, position: Value, backwards: Value, pad: Value
) -> Value:
    """corner - (position - bias), or its negative where the ray goes backwards, plus or less the pad."""
    size = widths.way + 1
    turned = backwards.replicate(size)
    # Without its bias, a position is not negative where its highest bit is set.
    complement = Cat(~position[:-1], position[-1].replicate(size - widths.position + 1))
    wide_pad = Cat(pad, Const(0, size - widths.pad))
    rows: list[Value] = [Cat(corner, Const(0, size - len(corner))) ^ turned, complement ^ turned]
    low, high = sum_rows(m, [*rows, wide_pad if far else ~wide_pad], size, f"{name}_way")
    # Minus a number is its complement and one: a one for the position or the corner, one more for a pad taken off. The
    # carries of the rows leave their lowest place free.
    return add_with_carry(low, Cat(Const(1, 1), high[1:]), Const(0 if far else 1, 1))[:size].as_signed()


def plane_places(widths: AxisWidths, exponent: Value, coarseness: Value) -> Value:
    """Places that the product of a plane moves to the right; nothing is left of it where they are the most."""
    most = (1 << widths.shift) - 1
    places = widths.arithmetic.exponent + coarseness - limited(widths, exponent)
    return Mux(places > most, most, places[: widths.shift])


def short_slope(widths: AxisWidths, far: bool, slope: Value) -> Value:
    """The slope's bits that multiply a plane: rounded down, for the far plane up."""
    short = slope[widths.arithmetic.slope - widths.arithmetic.short :]
    return short + 1 if far else short


def multiplier_of(far: bool, way: Value, slope: Value) -> Value:
    """The true slope is at least `slope` and less than `slope + 1`: that makes near distances less, far ones more."""
    return Mux(~way[-1] if far else way[-1], slope + 1, slope)


def way_rows(
    m: Module, name: str, widths: AxisWidths, far: bool, way: Value, thrice: Value, multiplier: Value
) -> Value:
    """way * multiplier as two rows, one above the other, whose sum it is.

    Two bits of the multiplier select a row of 0, 1, 2 or 3 ways; the last digit may be 4, where slope + 1 is a power of
    two. For the far planes 2 is added, at the point: 1 for the rounding up of this product, 1 for that of the planes'.
    """
    slope = widths.arithmetic.slope
    length = len(way) + 2
    width = length - 1 + (slope + 1) // 2 * 2
    rows: list[Value] = []
    for place in range(0, slope, 2):
        digit = multiplier[place : place + 2 if place + 2 < slope else slope + 1]
        choices = (way, Cat(Const(0, 1), way).as_signed(), thrice, Cat(Const(0, 2), way))
        row = Signal(length, name=f"{name}_row{place}")
        m.d.comb += row.eq(pick((digit == count for count in range(1, 1 << len(digit))), choices))
        # A sign s at place n is worth -s * 2**n = ~s * 2**n - 2**n; all these 2**n together are a one above each sign's
        # place, and one more at the first sign's.
        sign = row[-1]
        top = Cat(~sign, Const(1, 1)) if place else Cat(sign, sign, ~sign)
        rows.append(Cat(Const(0, place), row[:-1], top)[:width])
    if far:
        rows.append(Const(2 << (slope - 1), width))
    return Cat(*sum_rows(m, rows, width, name))


def block_way_rows(widths: AxisWidths, far: bool, way: Value, multiplier: Value) -> Value:
    """The same with multipliers, for either half of the multiplier: of 26x9 and 26x10 bits."""
    slope = widths.arithmetic.slope
    half, width = slope // 2, len(way) + slope + 1
    rounding = 2 << (slope - 1) if far else 0
    low, high = way * multiplier[:half] + rounding, way * multiplier[half:]
    return Cat(_wide(low, width), _wide(Cat(Const(0, half), high).as_signed(), width))


def _wide(value: Value, width: int) -> Value:
    """A signed value with its sign extended."""
    return Cat(value, value[-1].replicate(width - len(value)))[:width]


def scaled(widths: AxisWidths, rows: Value) -> Value:
    """The sum of the rows of a product; a slope of 1 is its highest bit alone."""
    half = len(rows) // 2
    return (rows[:half] + rows[half:])[widths.arithmetic.slope - 1 : half][: widths.total].as_signed()


# --- once a plane -----------------------------------------------------------------------------------------------------


def plane_product(
    m: Module, name: str, widths: AxisWidths, plane: Value, short: Value, thrice: Value | None = None
) -> Value:
    """plane * short; of rows if `thrice` is there, 3 * short."""
    size = widths.arithmetic.plane + widths.arithmetic.short
    if thrice is None:
        return (plane * short)[:size]
    two_digits = Cat(plane, Const(0, max(3 - len(plane), 0)))  # a single row is no sum
    low, high = product_rows(m, short, thrice, two_digits, name)
    return (low + high)[:size]


def bits_beyond(widths: AxisWidths, steepness: Value) -> Value:
    """Ones where a bit of a distance other than its sign is shifted too far to have a place in a time."""
    limits = (max(widths.arithmetic.time - 1 - place, 0) for place in range(widths.total - 1))
    return Cat(steepness >= limit if limit else Const(1, 1) for limit in limits)


def steepened(widths: AxisWidths, distance: Value, steepness: Value, beyond: Value) -> Value:
    """distance * 2**steepness, saturated, with the bias of a time added, which turns the sign over."""
    size = widths.arithmetic.time - 1
    sign = distance[-1]
    saturates = ((distance[:-1] ^ sign.replicate(widths.total - 1)) & beyond).any()
    shifted = (distance[:size] << steepness)[:size]
    return Cat(Mux(saturates, (~sign).replicate(size), shifted), ~sign)

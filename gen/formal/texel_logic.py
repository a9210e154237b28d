"""What the units of texels have beside number units: every input, of widths that can be tried, by the definition."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from amaranth import Cat, Const, Module, Signal, Value
from amaranth.lib import wiring

from lightloom.gen.formal.all_inputs import Gates
from lightloom.gen.formal.properties import Exhaustive, Property
from lightloom.golden_model.contract.formats import FACING_BITS, HIDDEN, LIKELY, PIXEL_BITS, SEEN, TAPS
from lightloom.rtl.engine import texel_blend, texel_match, texel_project

Operands = dict[str, np.ndarray]
Function = Callable[..., Any]


class Logic(wiring.Component):
    """A function of values, as a component: operands of some widths, and the result `z`."""

    def __init__(self, function: Function, widths: dict[str, int]):
        super().__init__({})
        self._function = function
        self.operands = {name: Signal(width, name=name) for name, width in widths.items()}
        self.result = Value.cast(function(*self.operands.values()))
        self.z = Signal(len(self.result))

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.d.comb += self.z.eq(self.result)
        return m


def every_input(
    function: Function,
    widths: dict[str, int],
    definition: Callable[[Operands], np.ndarray],
    fixed: Sequence[dict[str, int]],
) -> str:
    """Tries all operands of these widths, those that are `fixed` as each of these says; the first that is wrong, or
    nothing.
    """
    logic = Logic(function, widths)
    gates = Gates(logic, dict(logic.operands), {"z": logic.z})
    for values in fixed:
        for operands, results in gates.run(free=dict.fromkeys(values, 0), fixed=values):
            expected = definition(operands) & ((1 << len(logic.z)) - 1)
            wrong = np.flatnonzero(expected != results["z"])
            if len(wrong):
                at = wrong[0]
                given = ", ".join(f"{name} = {int(value[at])}" for name, value in operands.items())
                return f"{given}: {int(results['z'][at])}, should be {int(expected[at])}"
    return ""


def signed(value: np.ndarray, width: int) -> np.ndarray:
    return value - ((value >> (width - 1)) << width)


def _degree(i: Operands) -> np.ndarray:
    """By the table of docs/texel_match.md."""
    normal, depth, before, empty = (
        i[name].astype(bool) for name in ("same_normal", "same_depth", "not_behind", "empty")
    )
    both = np.where(normal & depth, SEEN, np.where(empty | depth | (normal & before), LIKELY, HIDDEN))
    by_normal = np.where(normal, SEEN, np.where(empty, LIKELY, HIDDEN))
    by_depth = np.where(depth, SEEN, np.where(before, LIKELY, HIDDEN))
    one = np.where(i["normal_test"] == 1, by_normal, np.where(i["depth_test"] == 1, by_depth, LIKELY))
    return np.where((i["normal_test"] == 1) & (i["depth_test"] == 1), both, one)


def _level(i: Operands) -> np.ndarray:
    whole = np.floor(signed(i["level"], 16) / 256 + 0.5).astype(np.int64)
    return np.where(i["best"] == SEEN, np.minimum(np.maximum(whole, 0), i["levels"]), 0)


LEVEL_WIDTH = 4


def _finest(i: Operands) -> np.ndarray:
    levels = [
        np.where(i[f"degree{k}"] == SEEN, signed(i[f"level{k}"], LEVEL_WIDTH), texel_match.COARSEST)
        for k in range(TAPS)
    ]
    return np.minimum.reduce(levels)


PLACE_WIDTH, SIZE_WIDTH = 16, 6
FAR_BITS = 17
"""Below a place of `PLACE_WIDTH` bits, for 33 in all: some such are farther off than can be said."""


def _tap(i: Operands, offset: int) -> np.ndarray:
    """The second is the next pixel, kept on the screen; where there is none, it is the first."""
    place = signed(i["moved"], PLACE_WIDTH) / 256 + i["size"] / 2  # what was lost in rounding down changes nothing
    first, last = np.floor(place - 0.5).astype(np.int64), i["size"].astype(np.int64) - 1
    pixel = first + np.where(last > 0, offset, 0)
    return np.where(pixel < 0, 0, np.minimum(pixel, last))


def _beyond(i: Operands, below: int = 0) -> np.ndarray:
    """With so many zeros below the place."""
    place = (signed(i["moved"], PLACE_WIDTH) << below) + 128 * i["size"]
    return np.clip(np.maximum(-place, place - 256 * i["size"]), 0, (1 << texel_project.MOST_BITS) - 1)


SHORT_FRACTION = 7
"""Bits, of float32 numbers cut to 16."""


def _scaled_down(i: Operands) -> np.ndarray:
    """What is below the least normal number is rounded to the places of subnormal ones, and flushed if it stays one."""
    z, shift = i["z"].astype(np.int64), i["shift"].astype(np.int64)
    sign, exponent, fraction = z >> 15, (z >> SHORT_FRACTION) & 0xFF, z & (1 << SHORT_FRACTION) - 1
    magnitude = np.ldexp((1 << SHORT_FRACTION) + fraction.astype(np.float64), np.minimum(exponent - shift, 1))
    places = np.rint(np.ldexp(magnitude, -1)).astype(np.int64)  # of the least subnormal number; ties to even
    normal = np.where(exponent > shift, z & 0x7FFF, 0) - np.where(exponent > shift, shift << SHORT_FRACTION, 0)
    raised = np.where(places >= 1 << SHORT_FRACTION, 1 << SHORT_FRACTION, 0)
    finite = np.where(exponent > shift, normal, np.where(exponent > 0, raised, 0))
    return np.where(exponent == 0xFF, z, finite | (sign << 15))


def _weight(count: np.ndarray) -> np.ndarray:
    """The inverse of what the latest weighs in a running mean."""
    return np.select([count < 2, count < 4, count < 8], [1, 2, 4], 8)


def _moved_mean(mean: np.ndarray, latest: np.ndarray, count: np.ndarray) -> np.ndarray:
    difference = latest - mean
    return mean + np.sign(difference) * -(-np.abs(difference) // _weight(count))


def _running_deviation(i: Operands) -> np.ndarray:
    return np.where(i["count"] > 0, _moved_mean(i["usual"], i["latest"], i["count"]), 0)


def _running_bias(i: Operands) -> np.ndarray:
    """By the definition of docs/update.md."""
    departure, weight = np.where(i["darker"] == 1, -i["latest"], i["latest"]), _weight(i["count"])
    mean = _moved_mean(signed(i["bias"], BIAS), departure, i["count"])
    parts = np.where((weight == 8) & (i["heavy"] == 0), 0, np.abs(mean) // np.where(i["heavy"] == 1, 2, 2 * weight))
    return np.where(i["count"] > 0, mean - np.sign(mean) * parts, 0)


def _bias_of_all(latest: Value, darker: Value, bias: Value, count: Value, heavy: Value) -> Value:
    """What the unit does of it in two cycles."""
    departure = texel_blend.with_sign(latest, darker)
    return texel_blend.running_bias(texel_blend.running_departure(departure, bias, count), count, heavy)


def _tap_at(which: int) -> Function:
    def pixel(moved: Value, size: Value) -> Value:
        """In the bits that a place of this width gives; of a size of 0 all ones."""
        both = texel_project.pair(texel_project.first_pixel(moved, size), size)
        return texel_project.tap(both, which)[: PLACE_WIDTH - PIXEL_BITS]

    return pixel


def _beyond_from_far(moved: Value, size: Value) -> Value:
    return texel_project.beyond(Cat(Const(0, FAR_BITS), moved), size)


ONCE: Sequence[dict[str, int]] = ({},)
FLAGS = ("normal_test", "depth_test", "same_normal", "same_depth", "not_behind", "empty")
DEVIATION = texel_blend.RELATIVE_WIDTH
BIAS = 9
COUNTS = tuple({"count": count} for count in (*range(10), 64, 128, 255))
"""The count enters by what it is at least: 1, 2, 4, 8."""

SUBJECTS: tuple[tuple[str, str, str, Function, dict[str, int], Callable[[Operands], np.ndarray], Any], ...] = (
    ("texel_match", "degrees", "what a pixel says", texel_match.degree, dict.fromkeys(FLAGS, 1), _degree, ONCE),
    (
        *("texel_match", "levels-of-detail", "every level, of every degree, rounded and kept in range"),
        *(texel_match.level_of_detail, {"best": 2, "level": 16, "levels": 2}, _level, ONCE),
    ),
    (
        *("texel_match", "finest", "the least of any levels of 4 bits, with any degrees"),
        texel_match.finest,
        {**{f"degree{k}": 2 for k in range(TAPS)}, **{f"level{k}": LEVEL_WIDTH for k in range(TAPS)}},
        *(_finest, ONCE),
    ),
    *(
        (
            *("texel_project", f"tap{offset}", "places of 16 bits, sides of 6: the pixel, kept on the screen"),
            *(_tap_at(offset), {"moved": PLACE_WIDTH, "size": SIZE_WIDTH}, partial(_tap, offset=offset), ONCE),
        )
        for offset in (0, 1)
    ),
    (
        *("texel_project", "beyond", "places of 16 bits, sides of 6: how far beyond either end"),
        *(texel_project.beyond, {"moved": PLACE_WIDTH, "size": SIZE_WIDTH}, _beyond, ONCE),
    ),
    (
        *("texel_project", "scaled-down", "every number with a fraction of 7 bits, by every shift"),
        *(texel_project.scaled_down, {"z": 16, "shift": FACING_BITS}, _scaled_down, ONCE),
    ),
    (
        *("texel_project", "far-beyond", "the upper 16 of 33 bits of places, sides of 6: saturates, does not wrap"),
        *(_beyond_from_far, {"moved": PLACE_WIDTH, "size": SIZE_WIDTH}, partial(_beyond, below=FAR_BITS), ONCE),
    ),
    (
        *("texel_blend", "running-deviation", "every deviation after every other, with counts of all weights"),
        texel_blend.running_deviation,
        {"latest": DEVIATION, "usual": DEVIATION, "count": 8},
        *(_running_deviation, COUNTS),
    ),
    (
        *("texel_blend", "running-bias", "every departure after every bias, with counts of all weights"),
        _bias_of_all,
        {"latest": BIAS - 1, "darker": 1, "bias": BIAS, "count": 8, "heavy": 1},
        *(_running_bias, COUNTS),
    ),
)


def properties() -> list[Property]:
    return [
        Property(
            unit=unit,
            name=name,
            says=says,
            method=Exhaustive(inputs=len(fixed) << sum(widths.values()) - (8 if fixed is COUNTS else 0)),
            check=partial(every_input, function, widths, definition, fixed),
            quick=name != "running-deviation",
        )
        for unit, name, says, function, widths, definition, fixed in SUBJECTS
    ]

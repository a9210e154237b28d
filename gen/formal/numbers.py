"""The number units in small formats: every input, against exact arithmetic."""

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from amaranth.hdl import Value

from lightloom.gen.formal.all_inputs import Gates
from lightloom.gen.formal.properties import Exhaustive, Property
from lightloom.gen.formal.small_floats import SmallFormat
from lightloom.golden_model.numerics.floats import float_to_half
from lightloom.rtl.fabric.float_format import FloatFormat
from lightloom.rtl.fabric.pipeline import Core
from lightloom.rtl.operators.float_add import FloatAdd
from lightloom.rtl.operators.float_compare import FloatCompare
from lightloom.rtl.operators.float_difference_of_products import FloatDifferenceOfProducts
from lightloom.rtl.operators.float_divide import FloatDivide
from lightloom.rtl.operators.float_minmax import FloatMinmax
from lightloom.rtl.operators.float_multiply import FloatMultiply
from lightloom.rtl.operators.float_sqrt import FloatSqrt
from lightloom.rtl.operators.float_to_half import FloatToHalf
from lightloom.rtl.operators.half_to_float import HalfToFloat

Operands = dict[str, np.ndarray]


def tables(operator: str, number: SmallFormat) -> Callable[[Operands], Operands]:
    """What exact arithmetic says of arrays of operands: looked up, because there are few different ones."""
    every = range(1 << number.bits)
    if operator == "float_sqrt":
        roots = np.array([number.sqrt(a) for a in every], np.int64)
        return lambda i: {"z": roots[i["a"]]}
    if operator == "float_compare":
        orders = np.array([[number.compare(a, b) for b in every] for a in every], np.int64)
        names = ("less", "equal", "greater", "unordered")
        return lambda i: {name: orders[i["a"], i["b"], k] for k, name in enumerate(names)}
    if operator == "float_difference_of_products":
        return partial(_difference, number, *_products(number))
    if operator in ("float_multiply", "float_divide"):
        pair = number.multiply if operator == "float_multiply" else number.divide
        results = np.array([[pair(a, b) for b in every] for a in every], np.int64)
        return lambda i: {"z": results[i["a"], i["b"]]}
    third, function = {"float_add": ("subtract", number.add), "float_minmax": ("maximum", number.minmax)}[operator]
    choices = np.array([[[function(a, b, c) for b in every] for a in every] for c in (0, 1)], np.int64)
    return lambda i: {"z": choices[i[third], i["a"], i["b"]]}


def _products(number: SmallFormat) -> tuple[np.ndarray, list[tuple[int, int]]]:
    """Of every pair of operands which product it has, as a number; of each of those a pair that has it."""
    kinds: dict[object, int] = {}
    pairs: list[tuple[int, int]] = []
    which = np.empty((1 << number.bits,) * 2, np.int64)
    for a in range(1 << number.bits):
        for b in range(1 << number.bits):
            product = number.product(a, b)
            if product not in kinds:
                kinds[product] = len(pairs)
                pairs.append((a, b))
            which[a, b] = kinds[product]
    return which, pairs


def _difference(number: SmallFormat, which: np.ndarray, pairs: list[tuple[int, int]], i: Operands) -> Operands:
    keys = which[i["a"], i["b"]] * len(pairs) + which[i["c"], i["d"]]
    wanted, where = np.unique(keys, return_inverse=True)
    results = [_of_pairs(number, *pairs[key // len(pairs)], *pairs[key % len(pairs)]) for key in wanted.tolist()]
    return {"z": np.array(results, np.int64)[where]}


@lru_cache(maxsize=1 << 20)
def _of_pairs(number: SmallFormat, a: int, b: int, c: int, d: int) -> int:
    return number.difference_of_products(a, b, c, d)


LOW_BITS = 10
"""Of a float32 fraction: below the last place of any binary16 number and the one after it, whatever its exponent."""


def every_input(make: Callable[[int, FloatFormat], Core], number: SmallFormat) -> str:
    """Tries all operands; returns the first that give a wrong result, or nothing."""
    core = make(0, FloatFormat(number.exponent, number.fraction))
    expected = tables(core.unit.name, number)
    for operands, results in Gates.of_core(core).run():
        wanted = expected(operands)
        for name, values in wanted.items():
            wrong = np.flatnonzero(values != results[name])
            if len(wrong):
                at = wrong[0]
                given = ", ".join(f"{key} = {int(value[at]):#x}" for key, value in operands.items())
                return f"{given}: {name} is {int(results[name][at]):#x}, should be {int(values[at]):#x}"
    return ""


def halves() -> str:
    """Every binary16 number."""
    for operands, results in Gates.of_core(HalfToFloat(0)).run():
        values = operands["a"].astype(np.uint16).view(np.float16).astype(np.float32)
        expected = np.where(np.isnan(values), np.uint32(0x7FC00000), values.view(np.uint32))
        wrong = np.flatnonzero(expected != results["z"])
        if len(wrong):
            return f"a = {wrong[0]:#x}: z is {int(results['z'][wrong[0]]):#x}, should be {int(expected[wrong[0]]):#x}"
    return ""


def to_halves() -> str:
    """Every sign, exponent and upper part of a fraction, with none or any one of the lower bits."""
    core = FloatToHalf(0)
    a = Value.cast(core.i.a)
    gates = Gates(core, {"low": a[:LOW_BITS], "high": a[LOW_BITS:]}, {"z": Value.cast(core.o.z)})
    for low in (0, *(1 << place for place in range(LOW_BITS))):
        for operands, results in gates.run(free={"low": 0}, fixed={"low": low}):
            bits = (operands["high"] << LOW_BITS | low).astype(np.uint32)
            wrong = np.flatnonzero(float_to_half(bits.view(np.float32)).view(np.uint16) != results["z"])
            if len(wrong):
                return f"a = {bits[wrong[0]]:#x}: z is {int(results['z'][wrong[0]]):#x}"
    return ""


EIGHT, FINE = SmallFormat(4, 3), SmallFormat(3, 4)
SEVEN, SIX, FIVE = SmallFormat(3, 3), SmallFormat(3, 2), SmallFormat(2, 2)

# Operator, core, bits of all operands of a format, formats: the first of them is in the quick set.
SUBJECTS: tuple[tuple[str, Callable[[int, FloatFormat], Core], Callable[[int], int], tuple[SmallFormat, ...]], ...] = (
    ("float_add", FloatAdd, lambda bits: 2 * bits + 1, (SIX, FINE)),  # fewer fraction bits do not need every sticky bit
    ("float_multiply", FloatMultiply, lambda bits: 2 * bits, (SIX, EIGHT)),
    ("float_divide", FloatDivide, lambda bits: 2 * bits, (SIX, EIGHT)),
    ("float_sqrt", FloatSqrt, lambda bits: bits, (EIGHT, SmallFormat(5, 7))),
    ("float_compare", FloatCompare, lambda bits: 2 * bits, (SIX, EIGHT)),
    ("float_minmax", FloatMinmax, lambda bits: 2 * bits + 1, (SIX, SEVEN)),
    ("float_difference_of_products", FloatDifferenceOfProducts, lambda bits: 4 * bits, (FIVE, SIX)),
)


def properties() -> list[Property]:
    return [
        *(
            Property(
                unit=unit,
                name=f"every-{number.bits}-bit-input",
                says=f"all operands of {number.exponent} exponent and {number.fraction} fraction bits, exactly rounded",
                method=Exhaustive(inputs=1 << inputs(number.bits)),
                check=partial(every_input, make, number),
                quick=number is numbers[0],
            )
            for unit, make, inputs, numbers in SUBJECTS
            for number in numbers
        ),
        *(
            Property(
                unit=unit,
                name=f"every-{number.bits}-bit-input-blocks",
                says="the same for the products as an FPGA's multiplier blocks take them",
                method=Exhaustive(inputs=1 << inputs),
                check=partial(every_input, partial(make, blocks=True), number),
            )
            for unit, make, number, inputs in (
                ("float_multiply", FloatMultiply, EIGHT, 16),
                ("float_difference_of_products", FloatDifferenceOfProducts, FIVE, 20),
            )
        ),
        Property(
            unit="half_to_float",
            name="every-input",
            says="all binary16 numbers, exactly",
            method=Exhaustive(inputs=1 << 16),
            check=halves,
            quick=True,
        ),
        Property(
            unit="float_to_half",
            name="every-upper-part",
            says="every sign, exponent and upper 13 bits of a fraction, with none or any one of the lower ten",
            method=Exhaustive(inputs=(1 + LOW_BITS) << (32 - LOW_BITS)),
            check=to_halves,
        ),
    ]

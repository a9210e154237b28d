"""Functional bins of the number units: classes of operands and results, how results were rounded, and what is special.

Each unit's groups are made from the operands that went through it and the model's results, which the bench has found
to be the unit's own.
"""

from collections.abc import Callable

import numpy as np

from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.verif.bins.coverage import Groups, cases

Masks = dict[str, np.ndarray]
LEAST, GREATEST = 2.0**-126, 2.0**128 * (1 - 2.0**-24)
"""Of the normal numbers."""


# --- classes ----------------------------------------------------------------------------------------------------------


def classes(x: np.ndarray) -> Masks:
    """The classes of float32 or float16 numbers (N,), each with its mask."""
    magnitude, least = np.abs(x), np.finfo(x.dtype).tiny
    return {
        "zero": x == 0,
        "subnormal": (magnitude > 0) & (magnitude < least),
        "normal": (magnitude >= least) & np.isfinite(x),
        "infinite": np.isinf(x),
        "NaN": np.isnan(x),
    }


def signed(x: np.ndarray) -> dict[str, int]:
    """Classes of both signs; a NaN has none."""
    negative = np.signbit(x)
    out: dict[str, int] = {}
    for name, mask in classes(x).items():
        if name != "NaN":
            out |= {f"+{name}": int((mask & ~negative).sum()), f"-{name}": int((mask & negative).sum())}
    return out | {"NaN": int(np.isnan(x).sum())}


def crossed(one: Masks, other: Masks) -> dict[str, int]:
    """Every class of one with every class of the other."""
    return {f"{a}, {b}": int((one[a] & other[b]).sum()) for a in one for b in other}


def results_of(z: np.ndarray) -> dict[str, int]:
    """Classes of results, which are never subnormal, and the ends of the normal numbers."""
    ends = cases(least_normal=np.abs(z) == LEAST, greatest_normal=np.abs(z) == GREATEST)
    return without(signed(z), "+subnormal", "-subnormal") | ends


def without(bins: dict[str, int], *names: str) -> dict[str, int]:
    """Bins but for those that cannot be."""
    assert set(names) <= set(bins)
    return {name: count for name, count in bins.items() if name not in names}


# --- rounding ---------------------------------------------------------------------------------------------------------


@quiet
def rounding(z: np.ndarray, excess: np.ndarray, tail: np.ndarray | float = 0.0) -> dict[str, int]:
    """How results (N,) that are neither zero nor infinite were rounded.

    The exact value is z + excess + tail, in float64, where the tail is far less than the excess or the excess is zero.
    """
    counted = np.isfinite(z) & (z != 0)
    size = np.abs(z)
    more = np.where(np.signbit(z), -1.0, 1.0) * (excess + tail)  # what the exact magnitude has beyond the result's
    # Beneath a power of two the numbers lie twice as close.
    half_below = (size.astype(np.float64) - np.nextafter(size, size.dtype.type(0))) / 2
    half_above = np.spacing(size).astype(np.float64) / 2
    tie = (np.abs(excess) == np.where(more < 0, half_below, half_above)) & (tail == 0)
    return cases(
        exact=counted & (more == 0),
        cut_off=counted & (more > 0) & ~tie,
        raised=counted & (more < 0) & ~tie,
        tie_cut_off=counted & (more > 0) & tie,
        tie_raised=counted & (more < 0) & tie,
    )


def two_sum(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The float64 sum and its exact error (Knuth)."""
    s = p + q
    virtual = s - p
    return s, (p - (s - virtual)) + (q - virtual)


@quiet
def ends(z: np.ndarray, exact: np.ndarray, *left_out: str) -> dict[str, int]:
    """What becomes of finite exact values, in float64, at the ends of the normal numbers."""
    size, finite = np.abs(exact), np.isfinite(exact)
    return without(
        cases(
            flushed=finite & (size > 0) & (size < LEAST) & (z == 0),
            raised_to_the_least=(size < LEAST) & (np.abs(z) == LEAST),
            cut_off_to_the_greatest=finite & (size > GREATEST) & (np.abs(z) == GREATEST),
            raised_to_infinity=(size > GREATEST) & (size < 2.0**128) & np.isinf(z),
            beyond=finite & (size >= 2.0**128) & np.isinf(z),
        ),
        *left_out,
    )


@quiet
def wide(x: np.ndarray) -> np.ndarray:
    """float64 of what the unit sees: subnormals are zeros."""
    return np.asarray(flush(x), dtype=np.float64)


def exponent(x: np.ndarray) -> np.ndarray:
    return np.frexp(wide(x))[1].astype(np.int64)


# --- the units --------------------------------------------------------------------------------------------------------


@quiet
def _add(i: np.ndarray, o: np.ndarray) -> Groups:
    z, a = o["z"], wide(i["a"])
    b = np.where(i["subtract"], -wide(i["b"]), wide(i["b"]))
    s, error = two_sum(a, b)
    normal = (a != 0) & (b != 0) & np.isfinite(a) & np.isfinite(b)
    apart = np.abs(exponent(i["a"]) - exponent(i["b"]))
    lost = np.maximum(exponent(i["a"]), exponent(i["b"])) - np.frexp(s)[1]
    opposed = normal & (np.signbit(a) != np.signbit(b))
    along = normal & ~opposed
    steps = {
        "0": (0, 0),
        "1": (1, 1),
        "2 to 22": (2, 22),
        "23": (23, 23),
        "24": (24, 24),
        "25": (25, 25),
        "more": (26, 999),
    }
    signs = {"+": ~np.signbit(a), "-": np.signbit(a)}, {"+": ~np.signbit(b), "-": np.signbit(b)}
    zeros, infinite = (a == 0) & (b == 0), np.isinf(a) & np.isinf(b)
    return {
        "operands": crossed(classes(i["a"]), classes(i["b"])),
        "exponents apart, one sign": {
            n: int((along & (apart >= p) & (apart <= q)).sum()) for n, (p, q) in steps.items()
        },
        "exponents apart, two signs": {
            n: int((opposed & (apart >= p) & (apart <= q)).sum()) for n, (p, q) in steps.items()
        },
        "cancellation": cases(
            none=opposed & (s != 0) & (lost == 0),
            one_bit=opposed & (s != 0) & (lost == 1),
            up_to_half=opposed & (s != 0) & (lost >= 2) & (lost <= 12),
            more=opposed & (s != 0) & (lost > 12),
            all_bits=opposed & (s == 0),
        ),
        "carry": cases(carry=along & (lost == -1), none=along & (lost == 0)),
        "two zeros": {f"{p}, {q}": int((zeros & signs[0][p] & signs[1][q]).sum()) for p in "+-" for q in "+-"},
        "two infinities": {f"{p}, {q}": int((infinite & signs[0][p] & signs[1][q]).sum()) for p in "+-" for q in "+-"},
        "rounding": rounding(z, s - z, error),
        # A sum of normal numbers is a multiple of the least subnormal: where it is less than normal it is exact.
        "ends of the range": ends(z, s, "raised to the least"),
        "results": results_of(z),
    }


@quiet
def _multiply(i: np.ndarray, o: np.ndarray) -> Groups:
    exact = wide(i["a"]) * wide(i["b"])
    return {
        "operands": crossed(classes(i["a"]), classes(i["b"])),
        "rounding": rounding(o["z"], exact - o["z"]),
        "ends of the range": ends(o["z"], exact),
        "results": results_of(o["z"]),
    }


@quiet
def _difference_of_products(i: np.ndarray, o: np.ndarray) -> Groups:
    p, q = wide(i["a"]) * wide(i["b"]), -wide(i["c"]) * wide(i["d"])
    s, error = two_sum(p, q)
    normal = (p != 0) & (q != 0) & np.isfinite(p) & np.isfinite(q)
    opposed = normal & (np.signbit(p) != np.signbit(q))
    lost = np.maximum(np.frexp(p)[1], np.frexp(q)[1]) - np.frexp(s)[1]
    return {
        **{f"operand {name}": signed(i[name]) for name in "abcd"},
        "products": crossed(*({k: m for k, m in classes(x).items() if k != "subnormal"} for x in (p, q))),
        "cancellation": cases(
            up_to_one_bit=opposed & (s != 0) & (lost <= 1),
            up_to_24_bits=opposed & (s != 0) & (lost >= 2) & (lost <= 24),
            more=opposed & (s != 0) & (lost > 24),
            all_bits=opposed & (s == 0) & (error == 0),
        ),
        "sign against the rounded products": cases(
            the_same=normal & (np.signbit(o["z"]) == np.signbit(p.astype(np.float32) + q.astype(np.float32))),
            another=normal & (o["z"] != 0) & (p.astype(np.float32) + q.astype(np.float32) == 0),
        ),
        "rounding": rounding(o["z"], s - o["z"], error),
        "ends of the range": ends(o["z"], s),
        "results": results_of(o["z"]),
    }


@quiet
def _divide(i: np.ndarray, o: np.ndarray) -> Groups:
    a, b, z = wide(i["a"]), wide(i["b"]), o["z"].astype(np.float64)
    return {
        "operands": crossed(classes(i["a"]), classes(i["b"])),
        # A quotient is never halfway between two numbers.
        "rounding": without(rounding(o["z"], (a - z * b) / b), "tie cut off", "tie raised"),
        # The greatest number lies a unit below 2**128, and no quotient of 24 bits by 24 bits between them.
        "ends of the range": ends(
            o["z"], np.where(b == 0, np.inf, a / b), "cut off to the greatest", "raised to infinity"
        ),
        "results": results_of(o["z"]),
    }


@quiet
def _sqrt(i: np.ndarray, o: np.ndarray) -> Groups:
    a, z = wide(i["a"]), o["z"].astype(np.float64)
    odd = exponent(i["a"]) % 2 == 1
    positive = (a > 0) & np.isfinite(a)
    return {
        "operand": signed(i["a"]),
        "exponent": cases(even=positive & ~odd, odd=positive & odd),
        "rounding": without(rounding(o["z"], (a - z * z) / (2 * z)), "tie cut off", "tie raised"),
        # Roots lie in the middle of the range, and that of -0 is -0.
        "results": without(results_of(o["z"]), "-normal", "-infinite", "least normal", "greatest normal"),
    }


@quiet
def _compare(i: np.ndarray, o: np.ndarray) -> Groups:
    a, b = i["a"], i["b"]
    beside = np.abs(a.view(np.int32).astype(np.int64) - b.view(np.int32)) == 1
    return {
        "operands": crossed(classes(a), classes(b)),
        "results": {name: int(o[name].sum()) for name in o.dtype.names or ()},
        "signs": {
            f"{p}, {q}": int(((np.signbit(a) == (p == "-")) & (np.signbit(b) == (q == "-"))).sum())
            for p in "+-"
            for q in "+-"
        },
        "neighbouring numbers": cases(less=beside & o["less"], greater=beside & o["greater"]),
    }


@quiet
def _minmax(i: np.ndarray, o: np.ndarray) -> Groups:
    a, b, maximum = i["a"], i["b"], i["maximum"]
    number = ~np.isnan(a) & ~np.isnan(b) & (flush(a) != flush(b))
    zeros = (flush(a) == 0) & (flush(b) == 0)
    takes_a = flush(a) == o["z"]
    out: Groups = {"operands": crossed(classes(a), classes(b))}
    for name, chosen in (("minimum", ~maximum), ("maximum", maximum)):
        out[name] = cases(first=chosen & number & takes_a, second=chosen & number & ~takes_a)
        out[f"{name} of zeros"] = {
            f"{p}, {q}": int((chosen & zeros & (np.signbit(a) == (p == "-")) & (np.signbit(b) == (q == "-"))).sum())
            for p in "+-"
            for q in "+-"
        }
    return out | {"results": results_of(o["z"])}


@quiet
def _to_half(i: np.ndarray, o: np.ndarray) -> Groups:
    a, z = wide(i["a"]), o["z"]
    size = np.abs(a)
    return {
        "operand": signed(i["a"]),
        "rounding": rounding(z, a - z),
        "ends of the range": cases(
            rounded_to_zero=(size > 0) & (z == 0),
            tie_to_zero=(size == 2.0**-25) & (z == 0),
            raised_to_the_least=(size < 2.0**-24) & (np.abs(z) == 2.0**-24),
            raised_to_normal=(size < 2.0**-14) & (np.abs(z) == 2.0**-14),
            cut_off_to_the_greatest=(size > 65504) & (np.abs(z) == 65504),
            raised_to_infinity=(size < 65536) & np.isinf(z),
            beyond=np.isfinite(a) & (size >= 65536) & np.isinf(z),
        ),
        "results": signed(z),
    }


def _from_half(i: np.ndarray, o: np.ndarray) -> Groups:
    # Every binary16 number is a normal float32 number.
    return {"operand": signed(i["a"]), "results": without(results_of(o["z"]), "least normal", "greatest normal")}


@quiet
def _to_fixed(i: np.ndarray, o: np.ndarray) -> Groups:
    exact, z = np.ldexp(wide(i["a"]), i["fraction"].astype(np.int32)), o["z"].astype(np.float64)
    inside = np.abs(z - exact) <= 0.5
    more = np.where(exact < 0, -1, 1) * (exact - z)
    tie = np.abs(more) == 0.5
    return {
        "operand": signed(i["a"]),
        "fraction": {str(k): int((i["fraction"] == k).sum()) for k in range(32)},
        "rounding": cases(
            exact=inside & (more == 0) & (z != 0),
            cut_off=inside & (more > 0) & ~tie,
            raised=inside & (more < 0) & ~tie,
            tie_cut_off=inside & (more > 0) & tie,
            tie_raised=inside & (more < 0) & tie,
        ),
        "range": _range(exact, z),
    }


@quiet
def _to_fixed_down(i: np.ndarray, o: np.ndarray) -> Groups:
    exact, z = np.ldexp(wide(i["a"]), i["fraction"].astype(np.int32)), o["z"].astype(np.float64)
    inside = np.abs(z - exact) < 1
    return {
        "operand": signed(i["a"]),
        "fraction": {str(k): int((i["fraction"] == k).sum()) for k in range(32)},
        "rounding": cases(
            exact=inside & (exact == z) & (z != 0),
            positive=inside & (exact > z) & (z > 0),
            negative=inside & (exact > z) & (z < -1),
            to_minus_one=inside & (exact > z) & (z == -1),
            minus_zero=np.signbit(i["a"]) & (exact == 0),
        ),
        "range": _range(exact, z),
    }


def _range(exact: np.ndarray, z: np.ndarray) -> dict[str, int]:
    """Where results saturate, and what becomes zero."""
    return cases(
        zero=z == 0,
        rounded_to_zero=(exact != 0) & (z == 0),
        greatest=z == 2**31 - 1,
        least=z == -(2**31),
        above=np.isfinite(exact) & (exact > 2**31),
        below=np.isfinite(exact) & (exact < -(2.0**31)),
        the_least_itself=exact == -(2.0**31),
    )


@quiet
def _from_fixed64(i: np.ndarray, o: np.ndarray) -> Groups:
    """The remainder of 64 bits by the result, in integers."""
    a = i["a"]
    whole = np.where(a < 0, np.uint64(0) - a.view(np.uint64), a.view(np.uint64))
    kept = np.ldexp(np.abs(o["z"]).astype(np.float64), i["fraction"].astype(np.int32)).astype(np.uint64)
    size = np.maximum(np.frexp(whole.astype(np.float64))[1] - 24, 0)
    rest = (whole - kept).view(np.int64)
    tie = 2 * np.abs(rest) == 1 << np.minimum(size, 62)
    return {
        "operand": cases(zero=a == 0, least=a == np.iinfo(a.dtype).min, greatest=a == np.iinfo(a.dtype).max),
        "sign": cases(positive=a > 0, negative=a < 0),
        "fraction": {str(k): int((i["fraction"] == k).sum()) for k in range(32)},
        "highest bit": {str(k): int(((whole >> np.uint64(k)) == 1).sum()) for k in range(64)},
        "rounding": cases(
            exact=(rest == 0) & (a != 0),
            cut_off=(rest > 0) & ~tie,
            raised=(rest < 0) & ~tie,
            tie_cut_off=(rest > 0) & tie,
            tie_raised=(rest < 0) & tie,
        ),
        "rounded to a power of two": cases(raised=(np.frexp(o["z"])[0] == 0.5) & (rest < 0)),
    }


@quiet
def _from_fixed(i: np.ndarray, o: np.ndarray) -> Groups:
    exact, whole = np.ldexp(i["a"].astype(np.float64), -i["fraction"].astype(np.int32)), np.abs(i["a"].astype(np.int64))
    return {
        "operand": cases(zero=whole == 0, least=i["a"] == -(2**31), greatest=i["a"] == 2**31 - 1),
        "sign": cases(positive=i["a"] > 0, negative=i["a"] < 0),
        "fraction": {str(k): int((i["fraction"] == k).sum()) for k in range(32)},
        "highest bit": {str(k): int(((whole >> k) == 1).sum()) for k in range(32)},
        "rounding": rounding(o["z"], exact - o["z"]),
        "rounded to a power of two": cases(raised=(whole < 2**31) & (np.frexp(o["z"])[0] == 0.5) & (exact < o["z"])),
    }


BINS: dict[str, Callable[[np.ndarray, np.ndarray], Groups]] = {
    "float_add": _add,
    "float_multiply": _multiply,
    "float_difference_of_products": _difference_of_products,
    "float_divide": _divide,
    "float_sqrt": _sqrt,
    "float_compare": _compare,
    "float_minmax": _minmax,
    "float_to_half": _to_half,
    "half_to_float": _from_half,
    "float_to_fixed": _to_fixed,
    "float_to_fixed_down": _to_fixed_down,
    "fixed_to_float": _from_fixed,
    "fixed64_to_float": _from_fixed64,
}
"""The groups of each number unit."""

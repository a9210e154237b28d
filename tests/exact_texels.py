"""The units of texels in exact rational arithmetic, one texel at a time, from their definition.

Every number is the bits of a float32, every operation one of `tests.exact`: no floating point anywhere, so nothing that
a processor rounds, converts or compares in its own way. Slow and plain on purpose.
"""

import numpy as np

from lightloom.golden_model.contract.formats import TEXEL_BLENDED, TEXEL_MATCHED, TEXEL_PLACE
from tests import exact

ONE, HALF, QUARTER, ZERO, INFINITY, SIGN = 0x3F800000, 0x3F000000, 0x3E800000, 0, 0x7F800000, 1 << 31
SHORTEST = (127 - 40) << 23
LESS, EQUAL, GREATER = 1, 2, 4
UNSEEN, HIDDEN, LIKELY, SEEN = range(4)
Record = np.void


def bits(record: Record, name: str) -> list[int]:
    """The bits of a field's scalars."""
    value = np.atleast_1d(np.asarray(record[name]))
    if value.dtype == np.bool_:
        return [int(each) for each in value]
    return [int(each) for each in value.view(f"<u{value.itemsize}")]


def one(record: Record, name: str) -> int:
    (only,) = bits(record, name)
    return only


def add(a: int, b: int) -> int:
    return exact.float_add(a, b, 0)


def subtract(a: int, b: int) -> int:
    return exact.float_add(a, b, 1)


def dot(a: list[int], b: list[int]) -> int:
    x, y, z = (exact.float_multiply(*pair) for pair in zip(a, b, strict=True))
    return add(add(x, y), z)


def maximum(a: int, b: int) -> int:
    return exact.float_minmax(a, b, 1)


def integer(value: int, fraction: int = 0) -> int:
    """A whole number with `fraction` bits after the point, as float32."""
    return exact.fixed64_to_float(value & (1 << 64) - 1, fraction)


def signed(value: int) -> int:
    return value - ((value & SIGN) << 1)


def clip(value: int, low: int, high: int) -> int:
    return min(max(value, low), high)


# --- visibility -----------------------------------------------------------------------------------------------------


def texel_project(record: Record) -> Record:
    out = np.zeros(1, dtype=TEXEL_PLACE)[0]
    axes = {name: bits(record, name) for name in ("right", "up", "forward")}
    normal, focal = bits(record, "normal"), one(record, "focal")
    moved = [subtract(*pair) for pair in zip(bits(record, "position"), bits(record, "eye"), strict=True)]
    depth, over = dot(moved, axes["forward"]), dot(normal, moved) ^ SIGN
    slack = exact.float_multiply((127 - int(record["facing_shift"])) << 23, depth) ^ SIGN
    enlarged = exact.float_divide(focal, depth)
    across, down = (exact.float_multiply(dot(moved, axes[name]), enlarged) for name in ("right", "up"))
    places = {}
    for side, from_middle in (("width", across), ("height", down ^ SIGN)):
        places[side] = signed(exact.float_to_fixed_down(from_middle, 8)) + 128 * int(record[side])
    farthest = max(max(-place, place - 256 * int(record[side])) for side, place in places.items())
    outside = integer(clip(farthest, 0, (1 << 31) - 1), 8)
    pixels = exact.float_multiply(enlarged, one(record, "texel_size"))
    conditions = (
        exact.float_compare(depth, one(record, "near")) == GREATER,
        exact.float_compare(over, slack) == GREATER,
        farthest <= 0 or exact.float_compare(outside, pixels) == LESS,
    )
    if not all(conditions):
        return out
    out["visible"] = True
    for name, value in (("depth", depth), ("above", over), ("outside", outside)):
        out[name] = np.uint32(value).view(np.float32)
    for name, side in (("column", "width"), ("row", "height")):
        first = (places[side] - 128) // 256
        last = int(record[side]) - 1
        out[name] = [(0 if tap < 0 else last if tap > last else tap) & 0x7FFF for tap in (first, first + (last > 0))]
    return out


def tolerance_of(record: Record) -> int:
    normal, depth = bits(record, "normal"), one(record, "depth")
    leaning = add(*(dot(normal, bits(record, name)) & ~SIGN for name in ("right", "up")))
    distance = maximum(exact.float_multiply(one(record, "focal"), one(record, "above") & ~SIGN), SHORTEST)
    steep = exact.float_divide(exact.float_multiply(leaning, depth), distance)
    reach = exact.float_multiply(one(record, "depth_slopes"), add(ONE, one(record, "outside")))
    slope = exact.float_minmax(exact.float_multiply(steep, reach), one(record, "depth_limit"), 0)
    relative = exact.float_multiply(add(slope, one(record, "depth_relative")), depth)
    return add(relative, one(record, "depth_fixed"))


def texel_match(record: Record) -> Record:
    out = np.zeros(1, dtype=TEXEL_MATCHED)[0]
    tolerance = tolerance_of(record)
    doubt = exact.float_multiply(tolerance, one(record, "depth_doubt"))
    normals = [exact.half_to_float(each) for each in bits(record, "pixel_normal")]
    degrees, levels = [], []
    for k, depth in enumerate(bits(record, "pixel_depth")):
        behind = subtract(one(record, "depth"), depth)
        near = exact.float_compare(behind & ~SIGN, tolerance) in (LESS, EQUAL)
        before = exact.float_compare(behind, doubt) == LESS
        cosine = dot(bits(record, "normal"), normals[3 * k : 3 * k + 3])
        along = exact.float_compare(cosine, one(record, "normal_cosine")) in (GREATER, EQUAL)
        match bool(record["normal_test"]), bool(record["depth_test"]):
            case True, True:
                seen, doubtful = along and near, depth == INFINITY or near or (along and before)
            case True, False:
                seen, doubtful = along, depth == INFINITY
            case False, True:
                seen, doubtful = near, before
            case _:
                seen, doubtful = False, True
        degrees.append(SEEN if seen else LIKELY if doubtful else HIDDEN)
        if seen:
            levels.append(int(record["pixel_lod"][k]))
    out["degree"] = max(degrees)
    out["lod"] = clip((min(levels) + 128) // 256, 0, int(record["lod_levels"])) if levels else 0
    return out


# --- blending -------------------------------------------------------------------------------------------------------


def relative(a: int, b: int) -> int:
    """a / b in 1/256ths."""
    return clip(signed(exact.float_to_fixed(exact.float_divide(a, b), 8)), 0, 4095)


def spread(record: Record) -> int:
    variance = ZERO
    for k in range(2):
        total, squares, n = (int(record[name][k]) for name in ("sums", "squares", "rays"))
        squared = exact.float_multiply(integer(total), integer(total))
        about = subtract(integer(squares), exact.float_divide(squared, integer(n)))
        factor = exact.float_divide(integer(n), integer(n - 1)) if n > 1 else ZERO
        variance = add(variance, exact.float_multiply(maximum(about, ZERO), factor))
    return relative(exact.float_sqrt(variance), integer(int(record["sums"][0]) + int(record["sums"][1])))


def bias(old: int, departure: int, weight: int, heavy: bool) -> int:
    mean = old + (1 if departure > old else -1) * -(-abs(departure - old) // weight)
    part = 2 if heavy else 2 * weight if weight < 8 else 0
    left = abs(mean) - (abs(mean) // part if part else 0)
    return left if mean > 0 else -left


def texel_blend(record: Record) -> Record:
    out = np.zeros(1, dtype=TEXEL_BLENDED)[0]
    count, heavy, usual = (int(record[name]) for name in ("count", "heavy", "deviation"))
    old = bits(record, "irradiance")
    sample = [integer(int(total), int(record["fraction"])) for total in record["total"]]
    alpha = maximum(exact.float_divide(integer(16), integer(count + 16)), one(record, "alpha_min"))
    alpha = maximum(alpha, one(record, "alpha_heavy")) if heavy else alpha
    moved = [add(a, exact.float_multiply(alpha, subtract(b, a))) for a, b in zip(old, sample, strict=True)]
    weights = [QUARTER, HALF, QUARTER]
    before, after = dot(old, weights), dot(sample, weights)
    latest = relative(subtract(after, before) & ~SIGN, before)
    out["irradiance"] = np.array(moved if count else sample, dtype=np.uint32).view(np.float32)
    out["count"], out["heavy"] = min(count + 16, 4095), max(heavy - 1, 0)
    limit = int(record["notice_factor"]) * usual + 16 * int(record["notice_floor"])
    out["noticed"] = count > 0 and count // 16 >= int(record["notice_count"]) and 16 * latest > limit
    if whole := count // 16:
        weight = 1 if whole == 1 else 2 if whole < 4 else 4 if whole < 8 else 8
        step = -(-abs(latest - usual) // weight)
        out["deviation"] = usual + step if latest > usual else usual - step
        departure = -latest if exact.float_compare(after, before) == LESS else latest
        out["bias"] = bias(int(record["bias"]), departure, weight, heavy > 0)
    out["spread"] = spread(record)
    return out

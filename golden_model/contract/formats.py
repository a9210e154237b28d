"""The layouts that units exchange, each defined once as a NumPy dtype.

The Amaranth layouts (`rtl.fabric.layouts`), the bit packing of the simulation harness
(`golden_model.contract.bitpack`), the manifests and the tables in `docs/` are all derived from these dtypes. A `bool`
field is one bit wide in hardware, a field made with `bits(n)` or `signed_bits(n)` is n bits wide, and every other field
has the width of its NumPy type. Fields follow each other from the least significant bit upwards, without padding.
"""

from typing import NamedTuple

import numpy as np


def bits(width: int) -> np.dtype:
    """An unsigned field of `width` bits (1 to 64), held in the smallest NumPy integer that has room for it."""
    return _narrowed("u", width)


def signed_bits(width: int) -> np.dtype:
    """The same in two's complement."""
    return _narrowed("i", width)


def _narrowed(kind: str, width: int) -> np.dtype:
    if not 1 <= width <= 64:
        raise ValueError(f"a bit field is 1 to 64 bits wide, not {width}")
    size = next(size for size in (1, 2, 4, 8) if width <= 8 * size)
    return np.dtype(f"<{kind}{size}", metadata={"bits": width})


def field_width(dtype: np.dtype) -> int:
    """Width in bits of one scalar field in hardware."""
    if dtype.metadata is not None and "bits" in dtype.metadata:
        return int(dtype.metadata["bits"])
    return 1 if dtype == np.bool_ else 8 * dtype.itemsize


F4 = np.dtype("<f4")
F2 = np.dtype("<f2")
I4 = np.dtype("<i4")
I8 = np.dtype("<i8")
I2 = np.dtype("<i2")
U2 = np.dtype("<u2")
U4 = np.dtype("<u4")
BOOL = np.dtype(np.bool_)

# --- operands and results of the number units ---------------------------------------------------------------------
FLOAT = np.dtype([("z", F4)])
FLOAT_UNARY = np.dtype([("a", F4)])
FLOAT_PAIR = np.dtype([("a", F4), ("b", F4)])
FLOAT_ADD = np.dtype([("a", F4), ("b", F4), ("subtract", BOOL)])
FLOAT_QUAD = np.dtype([("a", F4), ("b", F4), ("c", F4), ("d", F4)])
FLOAT_MINMAX = np.dtype([("a", F4), ("b", F4), ("maximum", BOOL)])
ORDER = np.dtype([("less", BOOL), ("equal", BOOL), ("greater", BOOL), ("unordered", BOOL)])
HALF = np.dtype([("z", F2)])
HALF_UNARY = np.dtype([("a", F2)])
# `fraction` is the number of bits after the binary point, 0 (an integer) to 31.
FLOAT_TO_FIXED = np.dtype([("a", F4), ("fraction", bits(5))])
FIXED_TO_FLOAT = np.dtype([("a", I4), ("fraction", bits(5))])
FIXED64_TO_FLOAT = np.dtype([("a", I8), ("fraction", bits(5))])
FIXED = np.dtype([("z", I4)])

# --- rays, triangles, hits ----------------------------------------------------------------------------------------
# A ray covers the points origin + t * direction with t_min < t <= t_max; the direction need not be of unit length.
RAY = np.dtype([("origin", F4, (3,)), ("direction", F4, (3,)), ("t_min", F4), ("t_max", F4)])

# What every triangle test needs of a ray, computed once a ray by `ray_setup`: `axis` is the dominant axis kz of the
# direction (0, 1, 2), `flip` says that kx and ky are swapped so that winding is kept, `shear` is (Sx, Sy, Sz).
_PREPARED = [
    ("origin", F4, (3,)),
    ("shear", F4, (3,)),
    ("t_min", F4),
    ("t_max", F4),
    ("axis", bits(2)),
    ("flip", BOOL),
]
PREPARED_RAY = np.dtype([*_PREPARED, ("inverse", F4, (3,))])

TRIANGLE = np.dtype([("v0", F4, (3,)), ("v1", F4, (3,)), ("v2", F4, (3,))])
RAY_TRIANGLE = np.dtype([*_PREPARED, ("v0", F4, (3,)), ("v1", F4, (3,)), ("v2", F4, (3,)), ("cull", BOOL)])

# The outcome of one ray-triangle test. The hit point is (1-u-v)*v0 + u*v1 + v*v2; a miss has all bits zero.
TRIANGLE_HIT = np.dtype([("t", F4), ("u", F4), ("v", F4), ("hit", BOOL), ("front", BOOL)])

# The outcome of tracing one ray: the index of the nearest triangle, -1 for a miss (then t, u, v are +0).
HIT = np.dtype([("primitive", I4), ("t", F4), ("u", F4), ("v", F4), ("front", BOOL)])

# --- the tree in memory -------------------------------------------------------------------------------------------
# The tree is an array of blocks of 64 bytes (docs/memory_image.md). Coordinates of boxes are integers on a lattice of
# LATTICE_BITS bits an axis that covers the scene: lattice_origin + integer * 2**lattice_exponent.
BLOCK_BYTES = 64
LATTICE_BITS = 20
WIDTH = 8
"""Child slots of a node block. A narrower tree leaves the upper slots empty."""
NODE_EXPONENT_MAX = 13
"""2**13 times 255 reaches across the lattice; a greater exponent counts as this one."""
NODE_KIND, TRIANGLES_KIND = 1, 2

_BOXES = [(f"{side}_{axis}", np.dtype(np.uint8), (WIDTH,)) for side in ("lower", "upper") for axis in "xyz"]

# An inner node. Its children are the blocks base, base + 1, ... of slots 0 to count - 1; bit k of `leaf` says that slot
# k is a block of triangles. The box of slot k reaches from origin + lower[k] * 2**exponent to origin + upper[k] *
# 2**exponent, on each axis, in lattice units.
NODE_BLOCK = np.dtype(
    [
        ("kind", bits(4)),
        ("count", bits(4)),
        ("leaf", bits(8)),
        ("exponent", bits(4), (3,)),
        ("reserved", bits(4)),
        ("base", U4),
        ("origin", bits(20), (3,)),
        ("reserved_high", bits(4)),
        *_BOXES,
    ]
)

# A leaf: one triangle of vertices 0, 1, 2, or two; the second one's vertices are `order`, which may name vertex 3. A
# ray sees a triangle where mask and the ray's mask have a common bit.
TRIANGLE_BLOCK = np.dtype(
    [
        ("kind", bits(4)),
        ("count", bits(2)),
        ("order", bits(2), (3,)),
        ("reserved", bits(4)),
        ("mask", bits(8), (2,)),
        ("primitive", I4, (2,)),
        ("vertices", F4, (12,)),
        ("reserved_high", U4),
    ]
)

# Block 0 of a tree. No node has more than `width` children, `levels` counts the nodes on the longest path from the
# root; `check` makes the exclusive or of all sixteen words zero.
BVH_MAGIC = 0x5642_4C4C  # "LLBV"
BVH_VERSION = 1
BVH_HEADER = np.dtype(
    [
        ("magic", U4),
        ("version", U2),
        ("width", np.dtype(np.uint8)),
        ("levels", np.dtype(np.uint8)),
        ("blocks", U4),
        ("root", U4),
        ("nodes", U4),
        ("triangle_blocks", U4),
        ("triangles", U4),
        ("lattice_exponent", I2),
        ("reserved", U2),
        ("lattice_origin", F4, (3,)),
        ("reserved_high", U4, (4,)),
        ("check", U4),
    ]
)

# --- the memory image -----------------------------------------------------------------------------------------------
# A file of blocks (docs/memory_image.md): the header, the table of sections, then the sections, each from a block
# boundary and one right after the other. `check` of the header is the CRC-32 of header and table with this field zero,
# `check` of a section that of its blocks.
IMAGE_MAGIC = (0x4D49_4C4C, 0x0045_4741)  # "LLIMAGE\0"
IMAGE_VERSION = 1
IMAGE_HEADER = np.dtype(
    [
        ("magic", U4, (2,)),
        ("version", U4),
        ("sections", U4),
        ("blocks", U4),
        ("reserved", U4, (10,)),
        ("check", U4),
    ]
)
SECTION = np.dtype([("kind", U4), ("first", U4), ("blocks", U4), ("check", U4)])
SECTION_KINDS = {"bvh": 1}

# --- tracing rays through the tree in memory ----------------------------------------------------------------------
# A ray and how it is to be traced. `any_hit`: only whether there is a hit; `cull`: back faces miss.
RAY_QUERY = np.dtype(
    [*((name, RAY[name]) for name in RAY.names or ()), ("any_hit", BOOL), ("cull", BOOL), ("mask", bits(8))]
)

# What comes back: HIT, and what went wrong. `invalid`: the ray cannot hit anything (a zero or NaN direction and the
# like). `error` is one of TRACE_ERRORS; then the ray has failed (a miss), and `block` is the address that caused it.
RAY_RESULT = np.dtype(
    [*((name, HIT[name]) for name in HIT.names or ()), ("invalid", BOOL), ("error", bits(3)), ("block", U4)]
)
TRACE_ERRORS = {
    "none": 0,
    "memory": 1,  # the memory answered with an error, with too few or too many beats, or not in time
    "outside": 2,  # a block beyond the image
    "kind": 3,  # a node where triangles should be, or the other way round, or neither
    "order": 4,  # children that do not lie behind their node: the tree has a cycle
    "header": 5,  # no usable tree is loaded
}

# What may be wrong with a tree that is to be loaded: "base" (then nothing is read), or else the first of these that is.
LOAD_ERRORS = {
    "none": 0,
    "memory": 1,  # the memory answered with an error, with too few or too many beats, or not in time
    "magic": 2,
    "version": 3,
    "check": 4,  # the check word
    "width": 5,  # more children a node than the hardware tests
    "levels": 6,  # none, or more than the hardware's stack has entries
    "blocks": 7,  # the root is not in the image
    "base": 8,  # the tree's address is no multiple of a block's size
    "size": 9,  # the image goes beyond the end of the address space
}

# What may become of a block that is to be written, the first of all since that was last asked.
WRITE_ERRORS = {
    "none": 0,
    "memory": 1,  # the memory answered with an error
    "outside": 2,  # it is not between the bounds, and was not written
}

# Distances along a ray in the box test are counted along its dominant axis, in the ray's units (`box_setup`), with
# TIME_BIAS added: the order of the integers is that of the distances.
TIME_BITS = 25
TIME_BIAS = 1 << (TIME_BITS - 1)
TIME = bits(TIME_BITS)

# What the box test needs of a ray, computed once by `box_setup`, which explains it.
POSITION_BITS = 23
POSITION_BIAS = 1 << (POSITION_BITS - 1)
SLOPE_BITS = 18
BOX_FRACTION = 2
"""Bits of the ray's unit below a lattice unit, at coarseness 0."""


class BoxWidths(NamedTuple):
    """Bits of what the box test works on."""

    plane: int
    """Of a child's plane."""
    exponent: int
    """The greatest exponent of a node (a value, not bits)."""
    slope: int
    """Of a slope, one of them before the binary point."""
    short: int
    """Of the slope's part that multiplies a child's plane."""
    time: int
    """Of a distance and its sign."""


BOX_WIDTHS = BoxWidths(plane=8, exponent=NODE_EXPONENT_MAX, slope=SLOPE_BITS, short=12, time=TIME_BITS)


SCALE_BIAS = 256
_BOX_RAY = [
    ("position", bits(POSITION_BITS), (3,)),
    ("backwards", BOOL, (3,)),
    ("slope", bits(SLOPE_BITS), (3,)),
    ("steepness", bits(5), (3,)),
    ("pad", bits(20)),
    ("coarseness", bits(5)),
    ("blind", BOOL),
    ("t_min", TIME),
]
BOX_SETUP = np.dtype(
    [
        ("origin", F4, (3,)),
        ("direction", F4, (3,)),
        ("inverse", F4, (3,)),
        ("axis", bits(2)),
        ("t_min", F4),
        ("lattice_origin", F4, (3,)),
        ("lattice_exponent", I2),
    ]
)
BOX_RAY = np.dtype([*_BOX_RAY, ("rate", F4), ("scale", bits(9))])

# What the tests at a leaf need of a ray: PREPARED_RAY and RAY_QUERY, and what turns t into the box test's distance.
LEAF_RAY = np.dtype(
    [*_PREPARED, ("rate", F4), ("scale", bits(9)), ("cull", BOOL), ("mask", bits(8)), ("any_hit", BOOL)]
)

# A float32 t to the box test's distance, rounded both ways.
RAY_TIME = np.dtype([("t", F4), ("rate", F4), ("scale", bits(9))])
RAY_TIMES = np.dtype([("low", TIME), ("high", TIME)])

# A ray against the boxes of a node's children, and the children that it enters, nearest first (equal: the lower slot);
# slots and entries beyond `count` are zero.
NODE_TEST = np.dtype(
    [
        *_BOX_RAY,
        ("t_max", TIME),
        ("count", bits(4)),
        ("exponent", bits(4), (3,)),
        ("origin", bits(20), (3,)),
        *_BOXES,
    ]
)
NODE_HITS = np.dtype([("count", bits(4)), ("slot", bits(3), (WIDTH,)), ("entry", TIME, (WIDTH,))])

# --- scenes -------------------------------------------------------------------------------------------------------
# A lamp without size: radiant intensity RGB (W/sr), so that the irradiance at distance r is intensity * cosine / r**2.
POINT_LIGHT = np.dtype([("position", F4, (3,)), ("intensity", F4, (3,))])

# The cone that a point light sends its light into, a spot light's: unit axis, cosine of the outer half angle, and one
# over how much greater that of the inner one is. All around (axis 0, -1, 1) for one that is none.
CONE = np.dtype([("axis", F4, (3,)), ("outer", F4), ("steepness", F4)])

# Where a lightmap texel lies: the point that its rays start from, just off its surface, unit normal and unit tangent
# (the bitangent: normal x tangent), the object whose map it belongs to. `state` is 0 outside all charts (then the rest
# is zero), 1 for a texel that is sampled, 2 for one inside or under other geometry; 0 and 2 show another texel's value.
TEXEL = np.dtype(
    [("position", F4, (3,)), ("normal", F4, (3,)), ("tangent", F4, (3,)), ("object", I4), ("state", bits(2))]
)

# --- frames -------------------------------------------------------------------------------------------------------
# What the rasterizer leaves at a pixel ([0056]). `primitive` and `object` are -1 where nothing is seen (then depth is
# infinity and the rest zero). u and v are barycentric as in HIT, `depth` is the distance along the view axis, `normal`
# the interpolated one (unit length), `lightmap` the coordinates in texels of the object's map, `lod` the base-2
# logarithm of texels per pixel in 1/256ths. `texture` and `texture_lod` are the same for the texture (texels of its
# finest level), zero in a scene without textures. Where the back of a two-sided triangle is seen, `lightmap` and
# `normal` are those of that side.
GBUFFER = np.dtype(
    [
        ("primitive", I4),
        ("object", I4),
        ("depth", F4),
        ("u", F4),
        ("v", F4),
        ("normal", F4, (3,)),
        ("lightmap", F4, (2,)),
        ("lod", I2),
        ("front", BOOL),
        ("texture", F4, (2,)),
        ("texture_lod", I2),
    ]
)

# What the visibility test of texels reads of a pixel: 16 bytes. `depth` is infinity where nothing is seen. The rest is
# that of GBUFFER, the normal in binary16.
PIXEL = np.dtype([("depth", F4), ("normal", F2, (3,)), ("lod", I2), ("reserved", U4)])

# --- lightmap maintenance -----------------------------------------------------------------------------------------
# The maintained texel, 22 bytes in hardware: irradiance RGB; the frame of the last update, modulo FRAMES; `number`, the
# updates it has had, after 4095 from 2048 on again: it selects the run of the sequences, and 0 says that there was
# none; `count`, the samples that the running average is worth, in 16ths: it stops at 4095 and is 0 where nothing is
# known; `heavy`, how many updates still to come weigh more after a change; `noticed`, the last sample departed from the
# average by more than is usual. In 1/256ths and up to 4095: `deviation`, the running mean of |sample - average| over
# the average; `spread`, the standard error of the last sample over itself; `bias`, with its sign, the running mean of
# (sample - average) over the average.
FRAMES = 4096
"""The frames of updates are numbered modulo FRAMES."""
TEXEL_STATE = np.dtype(
    [
        ("irradiance", F4, (3,)),
        ("frame", bits(12)),
        ("number", bits(12)),
        ("count", bits(12)),
        ("heavy", bits(3)),
        ("noticed", BOOL),
        ("deviation", bits(12)),
        ("spread", bits(12)),
        ("bias", signed_bits(13)),
    ]
)

# The version that shaders read, 8 bytes: irradiance RGB and a weight. In level 0 the weight is 1 where the texel itself
# has been sampled and 0 where its value comes from its surroundings; in coarser levels it is the coverage, the part of
# the texel that charts take.
PUBLISHED_TEXEL = np.dtype([("rgba", F2, (4,))])

RELATIVE_BITS = 8
"""Bits after the point of `deviation` and `spread`."""
RELATIVE_MAX = 4095
"""Where they stop: 12 bits."""
COUNT_BITS = 4
"""Bits after the point of `count`."""
ONE_SAMPLE = 1 << COUNT_BITS
"""What a sample adds to `count`."""
COUNT_MAX = 4095
"""Where `count` stops."""
NOTICE_BITS = 4
"""Bits after the point of `notice_factor`."""

# What the rays of one update of a texel add up to, in fixed point; up to 8192 rays (`accumulate`). `total` RGB has
# `fraction` bits after the point, a number of the scene. `sums` are those of the contributions' luminance, `squares` of
# its square, `rays` how many there were, those that brought nothing included: of the rays over the hemisphere with what
# follows them, and of those to lights (0 of these where no such rays are).
RAY_GROUPS = 2
SAMPLE_SUMS = np.dtype(
    [
        ("total", signed_bits(45), (3,)),
        ("sums", bits(37), (RAY_GROUPS,)),
        ("squares", bits(61), (RAY_GROUPS,)),
        ("rays", bits(14), (RAY_GROUPS,)),
    ]
)

# One update: of the texel before what bears on it, what its rays have brought, the settings (`running_average.
# Blending`); and what the texel becomes.
TEXEL_BLEND = np.dtype(
    [
        ("irradiance", F4, (3,)),
        ("count", bits(12)),
        ("heavy", bits(3)),
        ("deviation", bits(12)),
        ("bias", signed_bits(13)),
        *((name, SAMPLE_SUMS[name]) for name in SAMPLE_SUMS.names or ()),
        ("fraction", bits(5)),
        ("alpha_min", F4),
        ("alpha_heavy", F4),
        ("notice_factor", bits(8)),
        ("notice_floor", bits(12)),
        ("notice_count", bits(8)),
    ]
)
TEXEL_BLENDED = np.dtype(
    [
        ("irradiance", F4, (3,)),
        ("count", bits(12)),
        ("heavy", bits(3)),
        ("noticed", BOOL),
        ("deviation", bits(12)),
        ("bias", signed_bits(13)),
        ("spread", bits(12)),
    ]
)

# --- texel visibility ---------------------------------------------------------------------------------------------
# A texel and a view: its surface point and unit normal, the camera (`pinhole.View`), the side of a texel in the scene's
# unit, how far below its horizon a texel still counts as facing the eye (`policy.Policy`): 2**-facing_shift.
SCREEN_BITS = 15
"""Of a picture's sides, 1 to 16384 pixels, and of rows and columns."""
PIXEL_BITS = 8
"""Bits after the point of a place on the screen, in pixels."""
FACING_BITS = 5
SHORTEST = np.float32(2.0**-40)
"""Stands in for distances of zero."""
UNSEEN, HIDDEN, LIKELY, SEEN = range(4)
"""Degrees: off the screen or facing away; facing and on the screen, but something else is seen there; likely to be
seen now or soon; seen."""
LOD_BITS = 8
"""Bits after the point of a pixel's level of detail."""
TEXEL_PROJECT = np.dtype(
    [
        ("position", F4, (3,)),
        ("normal", F4, (3,)),
        ("eye", F4, (3,)),
        ("right", F4, (3,)),
        ("up", F4, (3,)),
        ("forward", F4, (3,)),
        ("focal", F4),
        ("near", F4),
        ("width", bits(SCREEN_BITS)),
        ("height", bits(SCREEN_BITS)),
        ("texel_size", F4),
        ("facing_shift", bits(FACING_BITS)),
    ]
)

# Where it lies on the screen: the two columns and the two rows of the four pixels around it, its depth, the height of
# the eye above the texel's plane, and how many pixels off the screen it is, 0 on it. All zero where it is not
# `visible`: it faces away, is too near or off the screen.
TEXEL_PLACE = np.dtype(
    [
        ("visible", BOOL),
        ("depth", F4),
        ("above", F4),
        ("outside", F4),
        ("column", bits(SCREEN_BITS), (2,)),
        ("row", bits(SCREEN_BITS), (2,)),
    ]
)

# Such a texel, what of the view and of the policy says by how much depths may differ that match (`depth_fixed` is
# depth_texels sides of a texel), and its four pixels, row by row, each as in PIXEL; the tests of the policy. What they
# say: the degree (UNSEEN to SEEN), and of a seen texel the level of detail, in whole levels.
TAPS = 4
TEXEL_MATCH = np.dtype(
    [
        ("normal", F4, (3,)),
        ("depth", F4),
        ("above", F4),
        ("outside", F4),
        ("right", F4, (3,)),
        ("up", F4, (3,)),
        ("focal", F4),
        ("depth_slopes", F4),
        ("depth_limit", F4),
        ("depth_relative", F4),
        ("depth_fixed", F4),
        ("pixel_depth", F4, (TAPS,)),
        ("pixel_normal", F2, (3 * TAPS,)),
        ("pixel_lod", I2, (TAPS,)),
        ("normal_test", BOOL),
        ("depth_test", BOOL),
        ("normal_cosine", F4),
        ("depth_doubt", F4),
        ("lod_levels", bits(2)),
    ]
)
TEXEL_MATCHED = np.dtype([("degree", bits(2)), ("lod", bits(2))])

# --- influence ----------------------------------------------------------------------------------------------------
# Where something that changed can matter to light ([0079] to [0083]). `kind` is 0 for a volume, 1 for a shadow, 2 for
# a footprint; `object` what changed (-1: a point light), `level` the highest change level it causes; where that is 3,
# its 2**octaves-th part is what light is expected to change by in this frame, and of each level below a quarter of it.
# `surface` is the object whose map alone it concerns (-1: all), `facing` says that only texels turned towards the box
# count. A volume is the box from `low` to `high` with its reach beyond each side. A shadow is the box that may lie
# between a texel and the light around `light`, of half the size `light_half`, by which the box is larger already. A
# footprint is the ball around `low` of radius `reach_low`.
CHANGE_LEVELS = 3
"""The highest change level."""
MOST_OCTAVES = 6
"""The greatest `octaves`."""
WHOLE_CHANGE = MOST_OCTAVES + 2 * (CHANGE_LEVELS - 1) + 1
"""Expected changes are 0 to WHOLE_CHANGE: 0 is none, e is the 2**(WHOLE_CHANGE - e)-th part of the light."""
VOLUME, SHADOW, FOOTPRINT = range(3)
"""Kinds of INFLUENCE records."""
INFLUENCE = np.dtype(
    [
        ("kind", bits(2)),
        ("facing", BOOL),
        ("level", bits(2)),
        ("octaves", bits(3)),
        ("object", I4),
        ("surface", I4),
        ("low", F4, (3,)),
        ("high", F4, (3,)),
        ("reach_low", F4, (3,)),
        ("reach_high", F4, (3,)),
        ("light", F4, (3,)),
        ("light_half", F4, (3,)),
    ]
)

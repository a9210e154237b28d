"""Faults in the units that see to texels, and in the conversions that they brought."""

from lightloom.gen.formal.mutations import Mutation

FOLDER, OPERATORS = "rtl/engine/", "rtl/operators/"
CHECKS = {
    f"{FOLDER}{unit}.py": (f"tests/rtl/test_intervals.py::test_agrees_with_the_model[{core}-{interval}]",)
    for unit, core, interval in (
        ("texel_project", "TexelProject", 16),
        ("texel_match", "TexelMatch", 4),
        ("texel_blend", "TexelBlend", 16),
    )
} | {
    f"{OPERATORS}{file}.py": (f"tests/rtl/test_operators.py::test_verilog_agrees[{unit}-base]",)
    for file, unit in (("float_to_fixed_down", "float_to_fixed_down"), ("fixed_to_float", "fixed64_to_float"))
}
PROJECT, MATCH, BLEND, DOWN, WIDE = CHECKS


def _fault(file: str, name: str, old: str, new: str, what: str, checks: tuple[str, ...] = ()) -> Mutation:
    """Noticed by `checks`; by those of its file if none are given."""
    return Mutation(name=name, file=file, old=old, new=new, what=what, checks=checks or CHECKS[file])


FAULTS = (
    _fault(PROJECT, "eye-from-texel", "position[k], eye[k])", "eye[k], position[k])", "the eye relative to the texel"),
    _fault(PROJECT, "depth-sideways", '"depth", moved, forward', '"depth", moved, right', "depth along another axis"),
    _fault(PROJECT, "rows-upwards", 'f.negate("down", along)', "along", "rows count from the bottom"),
    _fault(PROJECT, "facing-away", '"facing", above, horizon', '"facing", under, horizon', "texels face the other way"),
    _fault(PROJECT, "no-slack", 'facing["greater"], beyond', 'beyond["greater"], beyond', "all texels face the eye"),
    _fault(PROJECT, "slack-of-all", "lowered = exponent - shift", "lowered = exponent - 0", "the slack is 1 always"),
    _fault(PROJECT, "near-ignored", 'beyond["greater"], near', 'facing["greater"], near', "nothing is too near"),
    _fault(
        PROJECT,
        "off-by-a-texel",
        'farther, off["less"])',
        'farther, off["greater"])',
        "only what is off the screen is on it",
    ),
    _fault(
        PROJECT,
        "one-side-of-the-screen",
        "Mux(halves < 0, 0,",
        "Mux((halves < 0) | negative, 0,",
        "no left and upper end",
    ),
    _fault(
        PROJECT,
        "other-side-of-the-screen",
        "Mux(halves < 0, 0,",
        "Mux((halves < 0) | ~negative, 0,",
        "no right and lower end",
    ),
    _fault(
        PROJECT, "nearly-on-the-screen", "less | ~farther.any()", "less | (farther < 4)", "off it by 3/256 is on it"
    ),
    # Only a screen without pixels has places as far off: of inputs by chance there is none.
    _fault(
        *(PROJECT, "far-off-wraps", " | distance[MOST_BITS:].any()", " | 0 & distance[0]", "what is far off is near"),
        checks=("texel_project/far-beyond",),
    ),
    _fault(PROJECT, "half-of-the-width", "+ (size - 1))[1:]", "+ ((size - 1) >> 1))[1:]", "middle at a quarter"),
    _fault(PROJECT, "taps-from-corners", "+ (size - 1))[1:]", "+ size)[1:]", "pixels' corners, not centres"),
    _fault(PROJECT, "taps-off-the-screen", "Mux(inner, first, last)", "first", "pixels beyond the last"),
    _fault(
        PROJECT, "taps-unsigned", "before, inner = first < 0,", "before, inner = first < -1,", "pixels before the first"
    ),
    _fault(
        PROJECT, "height-of-the-texel", 'shown("above_out", above)', 'shown("above_out", under)', "the eye is below"
    ),
    _fault(MATCH, "height-with-its-sign", 'f.absolute("height", above)', "above", "what faces away is flat"),
    _fault(MATCH, "margin-of-one", '"margin", ONE, outside', '"margin", ONE, bits_of(0)', "as if on the screen"),
    _fault(MATCH, "limit-as-minimum", 'f.minimum("slope"', 'f.maximum("slope"', "the slope is at least its limit"),
    _fault(MATCH, "one-axis-twice", "enumerate((right, up))", "enumerate((right, right))", "slopes to one side alone"),
    _fault(MATCH, "depths-with-sign", 'f.absolute(f"apart{k}", behind)', "behind", "all that is nearer matches"),
    _fault(MATCH, "doubt-is-tolerance", "behind, doubt)", "behind, tolerance)", "no depth is in doubt"),
    _fault(MATCH, "bounds-left-out", "lambda one, other: one | other", "lambda one, other: one", "not at the bounds"),
    _fault(
        MATCH, "normals-turned", "pixel_normal[3 * k + axis]", "pixel_normal[4 * axis + k]", "normals' parts mixed up"
    ),
    _fault(MATCH, "empty-is-greatest", 'bits_of(float("inf"))', "0x7F7FFFFF", "an empty pixel is not known as one"),
    _fault(MATCH, "depth-test-always", "(same_depth | ~depth_test)", "same_depth", "depths count when not asked for"),
    _fault(MATCH, "levels-unsigned", "Mux(own < least", "Mux(own.as_unsigned() < least", "finer than one is coarse"),
    _fault(MATCH, "levels-down", "(1 << LOD_BITS >> 1)) >> LOD_BITS", "0) >> LOD_BITS", "levels are rounded down"),
    _fault(
        BLEND,
        "known-when-dropped",
        "lambda known, moved, new: Mux(known, moved, new)",
        "lambda known, moved, new: moved",
        "what was dropped still counts",
    ),
    _fault(BLEND, "count-wraps", "Mux(more > COUNT_MAX, COUNT_MAX, more)", "more", "256 samples are none"),
    _fault(BLEND, "heavy-forever", "Mux(heavy.any(), heavy - 1, 0)", "(heavy + 0)", "marks are not counted down"),
    _fault(BLEND, "heavy-always", "Mux(heavy.any(), raised, alpha)", "raised", "every sample weighs as after a change"),
    _fault(
        BLEND,
        "green-as-red",
        "bits_of(0.5), bits_of(0.25)]",
        "bits_of(0.25), bits_of(0.25)]",
        "luminance without green",
    ),
    _fault(
        BLEND, "biased-variance", 'f.divide(f"factor{k}", n, others)', 'f.divide(f"factor{k}", n, n)', "n for n - 1"
    ),
    _fault(BLEND, "variance-of-one-ray", "Mux(rays > 1, z, 0)", "z", "one ray has a variance"),
    _fault(BLEND, "totals-unsigned", "total[-1].replicate", "(total[-1] & 0).replicate", "negative sums are large"),
    _fault(BLEND, "negative-figures", "& ~fixed[31].replicate(RELATIVE_WIDTH)", "", "figures below 0 are the largest"),
    _fault(
        BLEND,
        "noticed-at-the-limit",
        "(latest << NOTICE_BITS) > limit",
        "(latest << NOTICE_BITS) >= limit",
        "usual samples are noticed",
    ),
    _fault(
        BLEND,
        "unknown-is-noticed",
        "return count.any() & (count[COUNT_BITS:] >= least)",
        "return (count[COUNT_BITS:] >= least)",
        "what has no average departs from it",
    ),
    _fault(
        BLEND, "steps-towards-zero", "(magnitude + (1 << shift) - 1) >> shift", "magnitude >> shift", "means stop short"
    ),
    _fault(
        BLEND, "bias-without-sign", "Mux(darker, -latest, latest)", "latest", "all departures are to the bright side"
    ),
    _fault(
        *(BLEND, "bias-kept-while-heavy", "Mux(heavy.any(), magnitude >> 1, settling)", "settling"),
        "what a heavy sample takes of the bias is not taken off",
    ),
    _fault(DOWN, "towards-zero", "up=remains & sign", "up=remains & ~sign", "positive numbers are rounded up"),
    _fault(DOWN, "minus-zero", "remains & Value.cast(a)[f.fraction_bits : -1].any()", "remains", "-0 becomes -1"),
    _fault(WIDE, "wide-ties-up", "(guard & (sticky | kept[0]))", "guard", "ties are raised"),
    _fault(
        WIDE, "sticky-short", "scaled[: lost - 1].any()", "scaled[lost - 8 : lost - 1].any()", "far bits do not count"
    ),
)

"""The box test on one axis at narrow widths, every input: against exact arithmetic, it never rejects falsely; and
against the golden model, in all bits."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from lightloom.gen.formal.all_inputs import Gates
from lightloom.gen.formal.properties import Exhaustive, Property
from lightloom.golden_model.contract.formats import BOX_FRACTION, BoxWidths
from lightloom.golden_model.tracing.wide_bvh.node_test import (
    base_products,
    corner_distance,
    plane_products,
    planes_met,
    saturated,
)
from lightloom.rtl.intersection.box_axis import AxisWidths, BoxAxis

TINY = AxisWidths(arithmetic=BoxWidths(plane=2, exponent=2, slope=4, short=3, time=8), lattice=3, position=6, pad=3)
PAD = 5
"""All of it for roundings: of the set-up, and at most one unit of the corner's in the box test."""
MARGIN = PAD - 1

ALL_BITS = {"position": 6, "backwards": 1, "slope": 3, "exponent": 2, "origin": 3, "lower": 2, "upper": 2}
"""Low bits that take all values; a slope's highest bit is always one."""


def encloses(widths: AxisWidths, free: Mapping[str, int]) -> str:
    """Whether the near distance is never beyond the exact one to the near plane, grown by MARGIN, nor the far one short
    of it, for any ratio that the slope stands for. Returns the first input for which that does not hold."""
    axis = BoxAxis(widths)
    inputs = {name: getattr(axis, name) for name in (*free, "pad")}
    gates = Gates(axis, inputs, {"near": axis.near, "far": axis.far})
    slope_one = 1 << (widths.arithmetic.slope - 1)
    bias = 1 << (widths.arithmetic.time - 1)
    for i, o in gates.run(free={**free, "pad": 0}, fixed={"pad": PAD, "slope": slope_one}):
        step = 1 << np.minimum(i["exponent"], widths.arithmetic.exponent)
        forward = i["backwards"] == 0
        heading = np.where(forward, 1, -1)
        unit = np.int64(1) << i["coarseness"]  # of the ray, in quarters of a lattice unit
        denominator = unit * slope_one
        for side, first, sign in (("near", "lower", 1), ("far", "upper", -1)):
            other = "upper" if first == "lower" else "lower"
            plane = i["origin"] + np.where(forward, i[first], i[other]) * step
            way = heading * ((plane << BOX_FRACTION) - (i["position"] - (1 << (widths.position - 1))) * unit)
            found = o[side] - bias
            for slope in (i["slope"], i["slope"] + 1):  # the distance is linear in the ratio: its ends are enough
                exact = (way - sign * MARGIN * unit) * slope << i["steepness"]
                saturated = found == (-bias if sign > 0 else bias - 1)
                wrong = np.flatnonzero(~saturated & (sign * (found * denominator - exact) > 0))
                if len(wrong):
                    given = ", ".join(f"{name} = {int(values[wrong[0]])}" for name, values in i.items())
                    return f"{given}: {side} is {int(found[wrong[0]])}"
    return ""


def as_the_model(widths: AxisWidths, free: Mapping[str, int], blocks: bool) -> str:
    """Whether both distances are the golden model's. Returns the first input for which that does not hold."""
    axis = BoxAxis(widths, blocks=blocks)
    inputs = {name: getattr(axis, name) for name in (*free, "pad")}
    gates = Gates(axis, inputs, {"near": axis.near, "far": axis.far})
    arithmetic = widths.arithmetic
    for i, o in gates.run(free={**free, "pad": 0}, fixed={"pad": PAD, "slope": 1 << (arithmetic.slope - 1)}):
        exponent, backwards = np.minimum(i["exponent"], arithmetic.exponent), i["backwards"]
        position = i["position"] - (1 << (widths.position - 1))
        away = corner_distance(i["origin"], exponent, position, backwards, i["coarseness"], arithmetic)
        bases = base_products(away, i["pad"], i["slope"], arithmetic)
        planes = planes_met(i["lower"], i["upper"], backwards, arithmetic)
        products = plane_products(*planes, i["slope"], exponent, i["coarseness"], arithmetic)
        for side, base, product in zip(("near", "far"), bases, products, strict=True):
            wanted = saturated(base + product, i["steepness"], arithmetic)
            wrong = np.flatnonzero(o[side] != wanted)
            if len(wrong):
                given = ", ".join(f"{name} = {int(values[wrong[0]])}" for name, values in i.items())
                return f"{given}: {side} is {int(o[side][wrong[0]])}, should be {int(wanted[wrong[0]])}"
    return ""


NEAR = ALL_BITS | {"coarseness": 1, "steepness": 1}


def properties() -> list[Property]:
    return [
        *(
            Property(
                unit="node_test",
                name=f"as-the-model{suffix}",
                says="one axis at narrow widths: both distances are the golden model's",
                method=Exhaustive(inputs=1 << sum(NEAR.values())),
                check=partial(as_the_model, TINY, NEAR, blocks),
                quick=True,
            )
            for suffix, blocks in (("", False), ("-blocks", True))
        ),
        *(
            Property(
                unit="node_test",
                name=name,
                says="one axis at narrow widths: a box that the exact ray enters is never rejected",
                method=Exhaustive(inputs=1 << sum(free.values())),
                check=partial(encloses, TINY, free),
                quick=free is NEAR,
            )
            for name, free in (
                ("no-false-reject-near", NEAR),
                ("no-false-reject", ALL_BITS | {"coarseness": 4, "steepness": 4}),
            )
        ),
    ]

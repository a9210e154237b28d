"""What the box test sees of a ray encloses the exact ray: of random rays, and of all rays in narrow arithmetic."""

from fractions import Fraction

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import BOX_SETUP, POSITION_BIAS, RAY, SCALE_BIAS, SLOPE_BITS
from lightloom.golden_model.numerics.floats import flush
from lightloom.golden_model.stimuli.box_families import BOX_FAMILIES, PADDING
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.wide_bvh.box_setup import (
    COARSEST,
    PAD,
    STEEPEST,
    UNDERFLOW,
    box_setup,
    coarseness_of,
)
from tests.golden_model.narrow_boxes import LARGER, SMALL, Narrow, position_bounds, rounded, slope_bounds

SEED = 62
ONE = 1 << (SLOPE_BITS - 1)
ROUNDING = Fraction(1, 1 << 24)


def setup(origin: object, direction: object, lattice_origin: object = 0, lattice_exponent: int = 0) -> np.ndarray:
    """BOX_RAY (1,) of a ray with t_min 0."""
    rays = np.zeros(1, dtype=RAY)
    rays["origin"], rays["direction"], rays["t_max"] = origin, direction, np.inf
    setups = np.zeros(1, dtype=BOX_SETUP)
    prepared = ray_setup(rays)
    for name in ("origin", "inverse", "axis", "t_min"):
        setups[name] = prepared[name]
    setups["direction"], setups["lattice_origin"] = rays["direction"], lattice_origin
    setups["lattice_exponent"] = lattice_exponent
    return box_setup(setups)


def test_a_ray_in_the_scene() -> None:
    ray = setup([100, 2.6, -7], [0.5, -2, 0])[0]
    assert ray["coarseness"] == 0
    assert (ray["position"].astype(int) - POSITION_BIAS).tolist() == [400, 10, -28]
    assert ray["backwards"].tolist() == [False, True, False]
    assert ray["slope"].tolist() == [ONE, ONE, ONE]
    assert ray["steepness"].tolist() == [2, 0, STEEPEST]
    assert ray["rate"] == 2
    assert ray["scale"] == SCALE_BIAS + 2
    assert ray["pad"] == PAD + 1, "the pad for underflow is a unit at least"
    assert not ray["blind"]


def test_the_unit_grows_with_the_distance_of_the_origin() -> None:
    for octave, coarseness in ((19, 0), (20, 1), (21, 2), (45, 26), (50, COARSEST), (90, COARSEST)):
        ray = setup([0, 1.5 * 2.0**octave, 0], [1, 1, 1])[0]
        true = max(octave - 19, 0)
        assert ray["coarseness"] == coarseness
        assert ray["scale"] == SCALE_BIAS + 2 - true
        assert int(ray["position"][1]) - POSITION_BIAS == int(1.5 * 2.0 ** (octave + 2 - true))


def test_the_pad_for_underflow() -> None:
    # A unit is 2**-30 of the scene: 2 * 2**-26 are 32 of them. The direction counts as the next power of two, plus one.
    assert setup([0, 0, 0], [1, 0, 0], lattice_exponent=-28)[0]["pad"] == PAD + 4 * 2**4
    assert setup([0, 0, 0], [0.5, 0, 0], lattice_exponent=-28)[0]["pad"] == PAD + 2 * 2**4
    assert setup([0, 0, 0], [4, 0, 0], lattice_exponent=-28)[0]["pad"] == PAD + 16 * 2**4
    assert setup([0, 0, 0], [0.5, 0, 0], lattice_exponent=-42)[0]["pad"] == PAD + 2**19
    blind = setup([0, 0, 0], [0.5, 0, 0], lattice_exponent=-43)[0]
    assert blind["blind"]
    assert blind["pad"] == 0


def test_a_ray_whose_distance_overflows_is_blind() -> None:
    assert setup([3e38, 0, 0], [1, 0, 0], [-3e38, 0, 0], 108)[0]["blind"]
    assert not setup([3e38, 0, 0], [1, 0, 0], [0, 0, 0], 108)[0]["blind"]


@pytest.mark.parametrize("family", BOX_FAMILIES)
def test_the_exact_ray_lies_within_what_is_said_of_it(family: str) -> None:
    cases = BOX_FAMILIES[family](120, np.random.default_rng([SEED, 1]))
    box_rays = cases.box_rays()
    for number, (ray, given) in enumerate(zip(box_rays, cases.setups, strict=True)):
        where = f"{family} seed {[SEED, 1]} ray {number}: {given}"
        scale = int(ray["scale"]) - SCALE_BIAS
        lattice = int(given["lattice_exponent"])
        way = [Fraction(float(d)) for d in flush(given["direction"])]
        longest = max(abs(d) for d in way)
        assert ray["coarseness"] == min(2 - scale - lattice, COARSEST), where
        underflow = Fraction(2) ** (UNDERFLOW + scale) * (1 + longest)
        assert ray["blind"] or ray["pad"] >= PAD + underflow, where
        assert ray["blind"] or ray["pad"] <= PAD + max(4 * underflow, Fraction(1)), where
        for k in range(3):
            place = Fraction(float(flush(given["origin"][k]))) - Fraction(float(flush(given["lattice_origin"][k])))
            exact = place * Fraction(2) ** scale
            if not ray["blind"]:
                assert -Fraction(1, 8) <= exact - (int(ray["position"][k]) - POSITION_BIAS) <= 1 + Fraction(1, 8), where
                assert abs(exact) <= 1 << 22, where
            slope, steepness = int(ray["slope"][k]), int(ray["steepness"][k])
            least = Fraction(slope << steepness, ONE)
            if way[k] == 0:
                assert (slope, steepness) == (ONE, STEEPEST), where
            else:
                ratio = longest / abs(way[k])
                assert ratio >= least * (1 - 3 * ROUNDING), where
                assert steepness == STEEPEST or ratio < Fraction(slope + 1 << steepness, ONE) * (1 + 3 * ROUNDING), (
                    where
                )


@pytest.mark.parametrize("narrow", [SMALL, LARGER], ids=["8 bits", "9 bits"])
def test_every_narrow_position_and_slope(narrow: Narrow) -> None:
    """An eighth of a unit more or less than the floor; ratios by twice the rounding of a significand off."""
    least, greatest = position_bounds(narrow)
    floor = (np.arange(len(least)) - len(least) // 2) * narrow.grid
    assert (least >= floor - narrow.grid // 8 - 1).all()
    assert (greatest <= floor + narrow.grid + narrow.grid // 8 + 1).all()

    slope, steepness, *fractions = slope_bounds(narrow).T
    assert len(slope) == (narrow.steepest + 1) << (narrow.widths.slope - 1), "every slope and steepness occurs"
    low = np.ldexp(slope / (1 << (narrow.widths.slope - 1)), steepness)
    high = np.ldexp((slope + 1) / (1 << (narrow.widths.slope - 1)), steepness)
    slack = 2.0**-narrow.bits * 2.25
    assert (fractions[0] / fractions[1] >= low * (1 - slack)).all()
    inner = steepness < narrow.steepest
    assert (fractions[2][inner] / fractions[3][inner] <= high[inner] * (1 + slack)).all()


@pytest.mark.parametrize("narrow", [SMALL, LARGER], ids=["8 bits", "9 bits"])
def test_every_narrow_distance_fits_the_position(narrow: Narrow) -> None:
    """The least coarseness at which a rounded distance fits, so that positions have all their bits."""
    place = np.arange(1, 1 << (narrow.bits + 6))
    significand, exponent = rounded(place, narrow.bits)
    end = exponent + narrow.bits
    coarseness = coarseness_of(end, 0, narrow.lattice_bits)
    units = np.ldexp(significand.astype(np.float64), exponent + 2 - coarseness)
    limit = 1 << narrow.position_bits
    assert (units < limit).all()
    assert (units[coarseness > 0] >= limit / 2).all()


def test_the_margin_of_the_pad() -> None:
    assert PAD == PADDING + 2 + 2 + 1

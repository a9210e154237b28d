"""The box test is conservative: exhaustively, all inputs of an axis in narrow arithmetic (docs/node_test.md).

What holds for an axis holds for the test: it takes the greatest of the entries and the least of the exits, and a ray
that enters the box has a t between all of them.
"""

from functools import cache
from typing import Any

import pytest

from lightloom.golden_model.contract.formats import BOX_WIDTHS
from lightloom.golden_model.stimuli import box_families
from lightloom.golden_model.tracing.wide_bvh import box_setup, node_test
from tests.golden_model.narrow_boxes import LARGER, SMALL, TINY, UNIT, Narrow, position_bounds, slope_bounds
from tests.needs import need_package

OWN_ROUNDING = 5
"""What PAD holds for the box test itself, in the ray's units; the rest of it is `box_families.PADDING`."""


@cache
def compiled_search() -> Any:
    """A search for distances that are not conservative; see `violations`."""
    numba = need_package("numba", "numba is not installed")
    corner_distance, base_products = numba.njit(node_test.corner_distance), numba.njit(node_test.base_products)
    planes_met, plane_products = numba.njit(node_test.planes_met), numba.njit(node_test.plane_products)
    saturated = numba.njit(node_test.saturated)

    @numba.njit
    def least_product(rows: Any, k: int, distance: int) -> tuple[int, int]:
        """The ratio, a fraction, that makes distance * ratio the least."""
        return (rows[k, 2], rows[k, 3]) if distance > 0 else (rows[k, 4], rows[k, 5])

    @numba.njit
    def search(
        least: Any, greatest: Any, slopes: Any, widths: Any, lattice: int, coarsest: int, grid: int, pad: int
    ) -> tuple[int, int]:
        bias, half = 1 << (widths.time - 1), len(least) // 2
        wrong, tried = 0, 0
        for choice in range((coarsest + 1) * (widths.exponent + 1) * 2):
            coarseness, rest = divmod(choice, (widths.exponent + 1) * 2)
            exponent, backwards = divmod(rest, 2)
            for origin in range(lattice):
                for plane in range(1 << widths.plane):
                    # The plane as a box's lower and upper side at once: the near and the far one.
                    met, _ = planes_met(plane, plane, backwards, widths)
                    exact = ((origin + (plane << exponent)) * UNIT * grid) >> coarseness
                    for index in range(2 * half):
                        away = corner_distance(origin, exponent, index - half, backwards, coarseness, widths)
                        low, high = exact - greatest[index], exact - least[index]
                        if backwards:
                            low, high = -high, -low
                        for k in range(len(slopes)):
                            base_near, base_far = base_products(away, pad, slopes[k, 0], widths)
                            near, far = plane_products(met, met, slopes[k, 0], exponent, coarseness, widths)
                            entry = saturated(base_near + near, slopes[k, 1], widths) - bias
                            leave = saturated(base_far + far, slopes[k, 1], widths) - bias
                            # entry <= a / b * low; where b is zero and low is not above zero, that is as low as can be.
                            a, b = least_product(slopes, k, low)
                            wrong += entry > -bias and (entry * b * grid > a * low or b == 0)
                            a, b = least_product(slopes, k, -high)
                            wrong += leave < bias - 1 and (leave * b * grid < a * high or b == 0)
                            tried += 2
        return wrong, tried

    return search


def violations(narrow: Narrow, pad: int) -> tuple[int, int]:
    """All inputs of an axis: how many distances are not conservative towards boxes not grown, and how many there are.

    These are all positions, coarsenesses, slopes, steepnesses, directions, node origins, exponents and planes, each
    with those of the exact rays behind the integers that are farthest from what the integers say.
    """
    lattice, coarsest, grid = 1 << narrow.lattice_bits, narrow.coarsest, narrow.grid
    assert (UNIT * grid) >> coarsest << coarsest == UNIT * grid, "lattice units must be whole steps"
    bounds = (*position_bounds(narrow), slope_bounds(narrow))
    wrong, tried = compiled_search()(*bounds, narrow.widths, lattice, coarsest, grid, pad)
    return int(wrong), int(tried)


def test_the_widths_are_those_of_the_true_box_test_made_narrow() -> None:
    """All of them follow from the bits of a significand by the same rules."""
    true = Narrow(24, BOX_WIDTHS)
    assert (true.lattice_bits, true.position_bits, true.steepest) == (20, 22, box_setup.STEEPEST)
    for narrow in (true, TINY, SMALL, LARGER):
        widths = narrow.widths
        assert widths.time == narrow.bits + 1
        assert widths.exponent == narrow.lattice_bits + 1 - widths.plane
        assert widths.short < widths.slope < narrow.bits
        # The greatest distance from a position to a corner, less than 2**M units.
        farthest = (1 << narrow.lattice_bits) - 1 + (((1 << widths.plane) - 1) << widths.exponent)
        assert farthest * UNIT + (1 << narrow.position_bits) < 1 << narrow.bits


def test_every_distance_is_conservative() -> None:
    wrong, tried = violations(SMALL, OWN_ROUNDING)
    assert tried > 200_000_000
    assert not wrong, f"{wrong} of {tried}"


@pytest.mark.long
def test_every_distance_of_greater_widths_is_conservative() -> None:
    wrong, tried = violations(LARGER, OWN_ROUNDING)
    assert tried > 2_000_000_000
    assert not wrong, f"{wrong} of {tried}"


def test_a_pad_without_room_for_the_rounding_is_found_out() -> None:
    assert violations(TINY, OWN_ROUNDING)[0] == 0
    assert violations(TINY, 1)[0] > 0


def test_the_pad_is_what_hits_need_and_the_rounding() -> None:
    """A hit lies at most 19.25 * 2**-24 of its distance outside its box, and that is below 2**23 units."""
    assert box_setup.PAD >= box_families.PADDING + OWN_ROUNDING
    assert box_families.PADDING > 19.25 * 2.0**-24 * 2.0**23

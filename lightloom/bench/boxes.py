"""Attacks the box test with rays and boxes, against exact arithmetic: part of `lightloom bench`.

The truth is the exact ray, of its float32 origin and direction, against the exact box of its lattice, within the range
of t. A box that the ray enters when it is grown by what the computed triangle test may need (docs/node_test.md) must
not be rejected. A box that the ray misses as it is, and that is accepted, costs time only: these are counted.
"""

from fractions import Fraction
from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import SCALE_BIAS, WIDTH
from lightloom.golden_model.numerics.floats import flush, quiet
from lightloom.golden_model.stimuli.box_families import BOX_FAMILIES, PADDING, Cases
from lightloom.golden_model.tracing.wide_bvh.box_setup import UNDERFLOW
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test

PORTION = 8192
"""Rays at a time."""
DISTANCE_ERROR = 2.0**-26
"""Greatest error of a distance from a plane, in the ray's units, as float64 has it: all of them are below 2**25."""
TIME_ERROR = 2.0**-50
"""Greatest relative error that the product with the slope adds."""


def box_test_figures(count: int, seed: int) -> dict[str, dict[str, Any]]:
    """Attacks with `count` pairs of ray and box, an equal part from each family; figures by family.

    Each has: `pairs`; `false_rejects`, decided exactly, which must be zero; `entered` and `accepted`, parts of all
    pairs that the exact ray enters as they are, and that the box test accepts; `false_accepts`, the part of the pairs
    that are missed exactly which is accepted. A ray that passes within 2**-26 units counts as entering.
    """
    part = -(-count // (WIDTH * len(BOX_FAMILIES)))
    return {name: _family_figures(name, part, [seed, number]) for number, name in enumerate(BOX_FAMILIES)}


def _family_figures(name: str, rays: int, seed: list[int]) -> dict[str, Any]:
    pairs = rejects = entered = accepted = wrong = 0
    rng = np.random.default_rng(seed)
    while pairs < rays * WIDTH:
        cases = BOX_FAMILIES[name](min(PORTION, rays - pairs // WIDTH), rng)
        accepts = accepted_boxes(cases)
        rejects += len(false_rejects(cases, accepts))
        _, misses = Truth(cases, 0, grown=False).decided()
        pairs += misses.size
        entered += int((~misses).sum())
        accepted += int(accepts.sum())
        wrong += int((accepts & misses).sum())
    return {
        "pairs": pairs,
        "false_rejects": rejects,
        "entered": entered / pairs,
        "accepted": accepted / pairs,
        "false_accepts": wrong / max(pairs - entered, 1),
    }


def accepted_boxes(cases: Cases) -> np.ndarray:
    """What the box test says: bool (N, 8)."""
    hits = node_test(cases.tests(cases.box_rays()))
    out = np.zeros((len(hits), WIDTH), dtype=bool)
    row, place = np.nonzero(np.arange(WIDTH) < hits["count"][:, None])
    out[row, hits["slot"][row, place]] = True
    return out


def false_rejects(cases: Cases, accepts: np.ndarray) -> list[tuple[int, int]]:
    """The pairs (ray, slot) that must not be rejected and are."""
    truth = Truth(cases, PADDING, grown=True)
    enters, misses = truth.decided()
    unclear = np.argwhere(~accepts & ~misses & ~enters)
    return [
        *((int(row), int(slot)) for row, slot in np.argwhere(~accepts & enters)),
        *((int(row), int(slot)) for row, slot in unclear if truth.exact(int(row), int(slot))),
    ]


class Truth:
    """Which boxes exact rays enter, the boxes grown by `padding` of the ray's units and, where `grown`, by the pad for
    underflow.
    """

    def __init__(self, cases: Cases, padding: int, *, grown: bool):
        box_rays = cases.box_rays()
        self.padding, self.grown = padding, grown
        self.origin, self.direction, self.start = (
            flush(x).astype(np.float64)
            for x in (cases.rays["origin"], cases.rays["direction"], cases.setups["lattice_origin"])
        )
        self.t_min, self.t_max = (flush(cases.rays[name]).astype(np.float64) for name in ("t_min", "t_max"))
        self.scale = box_rays["scale"].astype(np.int64) - SCALE_BIAS
        self.lattice = cases.setups["lattice_exponent"].astype(np.int64)
        self.lower, self.upper = cases.corners()
        self.rate = np.abs(self.direction).max(axis=1)

    @quiet
    def decided(self) -> tuple[np.ndarray, np.ndarray]:
        """(certainly entered, certainly missed), bool (N, 8) each, by float64 and the bounds of its errors."""
        pad = np.full(len(self.rate), float(self.padding))
        if self.grown:
            pad += np.ldexp(1 + self.rate, self.scale + UNDERFLOW)
        first, last = (np.ldexp(t * self.rate, self.scale)[:, None] for t in (self.t_min, self.t_max))
        # The latest entry and the earliest exit, at the earliest and at the latest.
        entry_low, entry_high = (np.repeat(first, WIDTH, axis=1) for _ in range(2))
        leave_low, leave_high = (np.repeat(last, WIDTH, axis=1) for _ in range(2))
        for k in range(3):
            position = np.ldexp(self.origin[:, k] - self.start[:, k], self.scale)[:, None]
            lower, upper = (
                np.ldexp(planes[:, :, k].astype(np.float64), (self.scale + self.lattice)[:, None])
                for planes in (self.lower, self.upper)
            )
            backwards = (self.direction[:, k] < 0)[:, None]
            near = np.where(backwards, position - upper, lower - position) - pad[:, None]
            far = np.where(backwards, position - lower, upper - position) + pad[:, None]
            slope = (self.rate / np.abs(self.direction[:, k]))[:, None]
            entry_low = np.maximum(entry_low, times(near - DISTANCE_ERROR, slope, -1))
            entry_high = np.maximum(entry_high, times(near + DISTANCE_ERROR, slope, 1))
            leave_low = np.minimum(leave_low, times(far - DISTANCE_ERROR, slope, -1))
            leave_high = np.minimum(leave_high, times(far + DISTANCE_ERROR, slope, 1))
        return entry_high < leave_low, entry_low > leave_high

    def exact(self, row: int, slot: int) -> bool:
        """Whether a ray enters a box, in rational numbers."""
        unit = Fraction(2) ** int(-self.scale[row])
        cell = Fraction(2) ** int(self.lattice[row])
        pad = self.padding * unit
        if self.grown:
            pad += Fraction(2) ** UNDERFLOW * (1 + Fraction(self.rate[row]))
        first, last = self.t_min[row], self.t_max[row]
        entries = [Fraction(first)] if np.isfinite(first) else []
        leaves = [Fraction(last)] if np.isfinite(last) else []
        for k in range(3):
            origin, way, start = (Fraction(x[row, k]) for x in (self.origin, self.direction, self.start))
            near = start + int(self.lower[row, slot, k]) * cell - pad - origin
            far = start + int(self.upper[row, slot, k]) * cell + pad - origin
            if way == 0:
                if near > 0 or far < 0:
                    return False
                continue
            entries.append(min(near / way, far / way))
            leaves.append(max(near / way, far / way))
        return all(entry <= leave for entry in entries for leave in leaves)


def times(distance: np.ndarray, slope: np.ndarray, towards: int) -> np.ndarray:
    """distance * slope, its greatest error added (`towards` 1) or subtracted (-1); an infinite slope decides all."""
    product = distance * slope
    product = product + towards * np.abs(product) * TIME_ERROR
    endless = np.where(distance == 0, towards * np.inf, np.copysign(np.inf, distance))
    return np.where(np.isinf(slope), endless, product)

"""The box test is conservative: on grids, by attack, and for hits of the triangle test (docs/node_test.md)."""

from typing import Any

import numpy as np
import pytest

from lightloom.bench.boxes import Truth, accepted_boxes, box_test_figures
from lightloom.golden_model.contract.formats import BOX_SETUP, NODE_BLOCK, NODE_KIND, RAY, WIDTH
from lightloom.golden_model.numerics.floats import canonical, quiet
from lightloom.golden_model.stimuli import box_families
from lightloom.golden_model.stimuli.box_families import BOX_FAMILIES, Cases, corners_of
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.golden_model.tracing.wide_bvh import box_setup
from lightloom.golden_model.tracing.wide_bvh.quantization import lattice_around
from tests.golden_model.tracing_cases import FAMILIES

SEED = 90
SLACK = 10
"""How many units farther than its pad the box test may reach for small boxes, by rounding outwards."""


# --- exhaustively, two axes of the true box test ----------------------------------------------------------------------


def plane_grid() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays and boxes on a small grid: origins (N, 2) in lattice units, directions (N, 2), boxes (N, 8, 2 axes, 2)."""
    sides = [(low, high) for low in (0, 1, 3) for high in (0, 1, 3) if low <= high]
    boxes = np.array([(x, y) for x in sides for y in sides])
    boxes = np.concatenate([boxes, boxes[: -len(boxes) % WIDTH]]).reshape(-1, WIDTH, 2, 2)
    steps, ways = np.arange(-14, 18), np.array([-3, -1, 0, 2])
    grid = np.stack(np.meshgrid(steps, steps, ways, ways, np.arange(len(boxes)), indexing="ij"), axis=-1).reshape(-1, 5)
    grid = grid[(grid[:, 2] != 0) | (grid[:, 3] != 0)]
    return grid[:, :2], grid[:, 2:4], boxes[grid[:, 4]]


def entered(place: np.ndarray, way: np.ndarray, boxes: np.ndarray, grown: int) -> np.ndarray:
    """Whether the rays, from t = 0 on, enter the boxes grown by a number of the ray's units: bool (N, 8), exactly."""
    out = np.ones(boxes.shape[:2], dtype=bool)
    # Entries and exits are fractions of whole numbers, in quarters of a lattice unit.
    entries, exits = [(np.zeros((len(place), 1), np.int64), np.ones((len(place), 1), np.int64))], []
    for k in range(2):
        near, far = boxes[:, :, k, 0] * 4 - grown, boxes[:, :, k, 1] * 4 + grown
        near, far = near - place[:, k, None] * 4, far - place[:, k, None] * 4
        rate = way[:, k, None]
        out &= (rate != 0) | ((near <= 0) & (far >= 0))
        # A zero component bounds nothing: -1 / 0 and 1 / 0 lie beyond everything.
        entries.append((np.where(rate > 0, near, np.where(rate < 0, -far, -1)), np.abs(rate)))
        exits.append((np.where(rate > 0, far, np.where(rate < 0, -near, 1)), np.abs(rate)))
    for a, b in entries:
        for c, d in exits:
            out &= a * d <= c * b
    return out


def cases_of(rays: np.ndarray, nodes: np.ndarray, lattice_origin: Any = 0, lattice_exponent: Any = 0) -> Cases:
    """Cases of RAY (N,) and NODE_BLOCK (N,) on one lattice."""
    prepared = ray_setup(rays)
    setups = np.zeros(len(rays), dtype=BOX_SETUP)
    for name in ("origin", "inverse", "axis", "t_min"):
        setups[name] = prepared[name]
    setups["direction"] = rays["direction"]
    setups["lattice_origin"], setups["lattice_exponent"] = lattice_origin, lattice_exponent
    return Cases(rays=rays, setups=setups, nodes=nodes)


def test_all_rays_and_boxes_of_a_grid_in_a_plane() -> None:
    place, way, boxes = plane_grid()
    rays = np.zeros(len(place), dtype=RAY)
    rays["origin"][:, :2], rays["direction"][:, :2], rays["t_max"] = place, way, np.inf
    nodes = np.zeros(len(place), dtype=NODE_BLOCK)
    nodes["kind"], nodes["count"] = NODE_KIND, WIDTH
    for k, axis in enumerate("xy"):
        nodes[f"lower_{axis}"], nodes[f"upper_{axis}"] = boxes[:, :, k, 0], boxes[:, :, k, 1]
    accepts = accepted_boxes(cases_of(rays, nodes))
    assert accepts.size > 500_000
    must = entered(place, way, boxes, box_families.PADDING)
    assert must.any()
    assert not (must & ~accepts).any()
    # And it is no more than the pad and some rounding: what is missed by that is rejected.
    may = entered(place, way, boxes, box_setup.PAD + SLACK)
    assert not may.all()
    assert not (accepts & ~may).any()


# --- attacked with rays and boxes, against exact arithmetic -----------------------------------------------------------


def attack(count: int) -> None:
    figures = box_test_figures(count, SEED)
    assert set(figures) == set(BOX_FAMILIES)
    assert sum(family["pairs"] for family in figures.values()) >= count
    wrong = {name: family["false_rejects"] for name, family in figures.items() if family["false_rejects"]}
    assert not wrong, f"seed {SEED}: false rejects {wrong}"
    for name, family in figures.items():
        assert family["entered"] > 0, f"{name}: no box entered"
        assert family["accepted"] < 0.95, f"{name}: nothing rejected"


def test_no_box_is_rejected_that_a_ray_enters() -> None:
    attack(1_000_000)


@pytest.mark.long
def test_no_box_is_rejected_that_a_ray_enters_in_ten_million() -> None:
    attack(10_000_000)


def test_the_attack_finds_a_pad_that_is_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """With 15 units instead of 21; the least pad for underflow adds one unit."""
    monkeypatch.setattr(box_setup, "PAD", box_families.PADDING - 1)
    found = sum(family["false_rejects"] for family in box_test_figures(400_000, SEED).values())
    assert found > 0


@pytest.mark.parametrize("family", BOX_FAMILIES)
def test_the_oracle_in_float64_agrees_with_rational_numbers(family: str) -> None:
    cases = BOX_FAMILIES[family](24, np.random.default_rng([SEED, 1]))
    for truth in (Truth(cases, 0, grown=False), Truth(cases, box_families.PADDING, grown=True)):
        enters, misses = truth.decided()
        assert not (enters & misses).any()
        assert (enters | misses).any()
        for row, slot in np.argwhere(enters | misses):
            assert truth.exact(row, slot) == enters[row, slot], f"{family} seed {[SEED, 1]}: ray {row} box {slot}"


# --- hits of the triangle test ----------------------------------------------------------------------------------------


@quiet
def hits_in_boxes(family: str, seed: list[int], *, alone: bool) -> tuple[Cases, np.ndarray]:
    """Every hit of a case in a quantised box of its triangle, as slot 0 of a node that lies anyhow; t (N,) of the hits.

    The lattice is that of the case's triangles, or of each hit's triangle `alone`, which leaves it the least room.
    """
    rng = np.random.default_rng(seed)
    triangles, rays = FAMILIES[family](rng)
    corners = canonical(np.stack([triangles[name] for name in ("v0", "v1", "v2")], axis=1))
    usable = np.isfinite(corners).all(axis=(1, 2))
    triangles, corners = triangles[usable], corners[usable]
    ray, index = np.divmod(np.arange(len(rays) * len(triangles)), max(len(triangles), 1))
    hits = ray_triangle(triangle_tests(ray_setup(rays)[ray], triangles[index]))
    found = np.flatnonzero(hits["hit"])
    if alone:
        found = rng.permutation(found)[:40]
    nodes = np.zeros(len(found), dtype=NODE_BLOCK)
    nodes["kind"], nodes["count"] = NODE_KIND, 1
    lower, upper = corners[index[found]].min(axis=1), corners[index[found]].max(axis=1)
    origins, exponents = np.zeros((len(found), 3), np.float32), np.zeros(len(found), np.int64)
    groups = np.arange(len(found))[:, None] if alone else np.arange(len(found))[None]
    for group in groups if len(found) else []:
        whole = (lower[group], upper[group]) if alone else (corners.min(axis=1), corners.max(axis=1))
        lattice = lattice_around(whole[0].min(axis=0), whole[1].max(axis=0))
        origins[group], exponents[group] = lattice.origin, lattice.exponent
        low, high = lattice.floor(lower[group]), lattice.ceil(upper[group])
        corner = low - np.minimum(low, rng.integers(0, 1 << 20, low.shape) >> rng.integers(0, 20, low.shape))
        # The least exponent from which the box's upper side is reached, or one more.
        least = np.zeros(low.shape, np.int64)
        for _ in range(13):
            least += (-((corner - high) >> least)) > 255
        exponent = np.minimum(least + rng.integers(0, 2, low.shape), 13)
        nodes["origin"][group], nodes["exponent"][group] = corner, exponent
        for k, axis in enumerate("xyz"):
            nodes[f"lower_{axis}"][group, 0] = ((low - corner) >> exponent)[:, k]
            nodes[f"upper_{axis}"][group, 0] = (-((corner - high) >> exponent))[:, k]
        first, last = (side[:, 0] for side in corners_of(nodes[group]))
        assert ((first <= low) & (last >= high)).all()
    chosen = rays[ray[found]]
    chosen["t_max"] = hits["t"][found]
    return cases_of(chosen, nodes, origins, exponents), hits["t"][found]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_box_of_a_hit_is_accepted_with_the_hit_as_t_max(family: str) -> None:
    """What pruning by the best hit so far rests on: the box that holds a hit is entered at or before it."""
    total = 0
    for number in range(4):
        seed = [SEED, number]
        cases, t = hits_in_boxes(family, seed, alone=number % 3 == 0)
        accepts = accepted_boxes(cases)[:, 0]
        wrong = np.flatnonzero(~accepts)
        assert not len(wrong), f"{family} seed {seed}: {cases.rays[wrong[0]]} t {t[wrong[0]]} {cases.nodes[wrong[0]]}"
        total += len(accepts)
    assert total > 100


def test_hits_beside_a_scene_that_overflows_are_kept() -> None:
    """A lattice so wide that a ray's distance from its origin is infinite: the ray cannot know where it is."""
    far = np.float32(3e38)
    rays = np.zeros(1, dtype=RAY)
    rays["origin"], rays["direction"], rays["t_max"] = [far, 0, -1], [0, 0, 1], np.inf
    triangle = np.zeros(1, dtype=[("v0", "<f4", 3), ("v1", "<f4", 3), ("v2", "<f4", 3)])
    triangle["v0"], triangle["v1"], triangle["v2"] = [far, -1, 0], [far, 1, 0], [far * np.float32(0.9), 0, 0]
    assert ray_triangle(triangle_tests(ray_setup(rays), triangle))["hit"][0]
    lattice = lattice_around(np.array([-far, -1, 0], np.float32), np.array([far, 1, 1], np.float32))
    node = np.zeros(1, dtype=NODE_BLOCK)
    node["kind"], node["count"], node["exponent"] = NODE_KIND, 1, 13
    low, high = (lattice.floor(triangle["v2"]) >> 13, -(-lattice.ceil(triangle["v0"]) >> 13))
    for k, axis in enumerate("xyz"):
        node[f"lower_{axis}"][0, 0], node[f"upper_{axis}"][0, 0] = low[0, k], high[0, k]
    cases = cases_of(rays, node, lattice.origin, lattice.exponent)
    assert cases.box_rays()["blind"][0]
    assert accepted_boxes(cases)[0, 0]

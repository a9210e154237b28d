"""What the node test is beyond being conservative (`test_node_test_exact.py`): order, limits, and its compiled twin."""

from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import (
    BOX_RAY,
    NODE_BLOCK,
    NODE_EXPONENT_MAX,
    NODE_HITS,
    NODE_TEST,
    POSITION_BIAS,
    TIME_BIAS,
    TIME_BITS,
    WIDTH,
)
from lightloom.golden_model.tracing.wide_bvh.node_test import node_test
from tests.needs import needs_numba

SEED = 41
COUNT = 20_000


def any_bits(count: int, rng: np.random.Generator) -> np.ndarray:
    """NODE_TEST (N,) of random bits, one in 16 of them blind."""
    words = rng.integers(0, 1 << 32, (count, bitpack.words(NODE_TEST)), dtype=np.uint32)
    tests = bitpack.unpack(words, NODE_TEST)
    tests["blind"] &= rng.integers(0, 8, count) == 0
    return tests


def likely_hits(count: int, rng: np.random.Generator) -> np.ndarray:
    """NODE_TEST (N,) of rays that start in or beside their node, with every steepness and coarseness."""
    tests = any_bits(count, rng)
    tests["exponent"] %= 14
    tests["pad"] %= 64
    tests["count"] = rng.integers(0, WIDTH + 1, count)
    tests["steepness"] >>= rng.integers(0, 5, (count, 3)).astype(np.uint8)
    tests["coarseness"] >>= rng.integers(0, 5, count).astype(np.uint8)
    for k, axis in enumerate("xyz"):
        low, high = tests[f"lower_{axis}"], tests[f"upper_{axis}"]
        tests[f"lower_{axis}"], tests[f"upper_{axis}"] = np.minimum(low, high), np.maximum(low, high)
        reach = 255 << tests["exponent"][:, k].astype(np.int64)
        inside = tests["origin"][:, k] + (rng.uniform(-0.2, 1.2, count) * reach).astype(np.int64)
        tests["position"][:, k] = np.clip(
            (inside << 2 >> tests["coarseness"]) + POSITION_BIAS, 0, 2 * POSITION_BIAS - 1
        )
    tests["t_min"] = rng.integers(TIME_BIAS, TIME_BIAS + 64, count)
    tests["t_max"] = rng.integers(TIME_BIAS, 1 << TIME_BITS, count)
    return tests


OPERANDS = {family.__name__: family for family in (any_bits, likely_hits)}


def fields_of(tests: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """The part of NODE_TEST (N,) that another format has too."""
    out = np.zeros(len(tests), dtype=dtype)
    for name in set(dtype.names or ()) & set(tests.dtype.names or ()):
        out[name] = tests[name]
    return out


@needs_numba
@pytest.mark.parametrize("family", OPERANDS)
def test_the_compiled_twin_agrees(family: str) -> None:
    from lightloom.golden_model.tracing.compiled import compiled
    from lightloom.golden_model.tracing.wide_bvh.node_test_numba import COMPILED_RAY, node_hits

    @compiled
    def all_hits(rays: Any, times: Any, nodes: Any, counts: Any, slots: Any, entries: Any) -> None:
        for k in range(len(rays)):
            counts[k] = node_hits(rays[k], times[k], nodes[k], slots[k], entries[k])

    tests = OPERANDS[family](COUNT, np.random.default_rng(SEED))
    counts, (slots, entries) = np.zeros(COUNT, np.int64), np.full((2, COUNT, WIDTH), -1, dtype=np.int64)
    rays = fields_of(tests, BOX_RAY).view(COMPILED_RAY)
    all_hits(rays, tests["t_max"], fields_of(tests, NODE_BLOCK), counts, slots, entries)

    listed = np.arange(WIDTH) < counts[:, None]
    twin = np.zeros(COUNT, NODE_HITS)
    twin["count"], twin["slot"], twin["entry"] = counts, np.where(listed, slots, 0), np.where(listed, entries, 0)
    wrong = np.flatnonzero(~bitpack.equal(twin, node_test(tests)))
    assert not len(wrong), f"seed {SEED}, {len(wrong)} differ, first {wrong[0]}: {tests[wrong[0]]}"


@pytest.mark.parametrize("family", OPERANDS)
def test_children_come_nearest_first(family: str) -> None:
    hits = node_test(OPERANDS[family](COUNT, np.random.default_rng(SEED + 1)))
    count, entry, slot = (hits[name].astype(np.int64) for name in ("count", "entry", "slot"))
    assert len(np.unique(count)) == WIDTH + 1, "every count of hits should occur"
    key = entry * WIDTH + slot
    both = np.arange(1, WIDTH) < count[:, None]
    assert (key[:, 1:] > key[:, :-1])[both].all()
    beyond = np.arange(WIDTH) >= count[:, None]
    assert not entry[beyond].any()
    assert not slot[beyond].any()


@pytest.mark.parametrize("family", OPERANDS)
def test_a_smaller_t_max_only_cuts_the_list(family: str) -> None:
    """What the stack's rule of revisits rests on."""
    rng = np.random.default_rng(SEED + 2)
    tests = OPERANDS[family](COUNT, rng)
    before = node_test(tests)
    tests["t_max"] = (tests["t_max"] * rng.random(COUNT)).astype(np.uint32)
    after = node_test(tests)
    assert (after["count"] <= before["count"]).all()
    assert (after["count"] < before["count"]).any()
    kept = np.arange(WIDTH) < after["count"][:, None]
    for name in ("slot", "entry"):
        assert (np.where(kept, before[name], 0) == after[name]).all()


def test_a_blind_ray_enters_every_child_at_once() -> None:
    tests = any_bits(COUNT, np.random.default_rng(SEED + 3))
    tests["blind"] = True
    hits = node_test(tests)
    assert (hits["count"] == np.minimum(tests["count"], WIDTH)).all()
    assert not hits["entry"].any()


def test_slots_beyond_the_count_are_not_looked_at() -> None:
    rng = np.random.default_rng(SEED + 4)
    tests, others = likely_hits(COUNT, rng), any_bits(COUNT, rng)
    before = node_test(tests)
    empty = np.arange(WIDTH) >= tests["count"][:, None]
    for axis in "xyz":
        for side in ("lower", "upper"):
            name = f"{side}_{axis}"
            tests[name] = np.where(empty, others[name], tests[name])
    assert bitpack.equal(node_test(tests), before).all()


def test_greater_exponents_count_as_the_greatest() -> None:
    tests = likely_hits(COUNT, np.random.default_rng(SEED + 5))
    tests["exponent"] = NODE_EXPONENT_MAX
    greatest = node_test(tests)
    tests["exponent"] = np.random.default_rng(SEED + 6).integers(NODE_EXPONENT_MAX, 16, (COUNT, 3))
    assert bitpack.equal(node_test(tests), greatest).all()

"""The ray-triangle unit against its model: every bit of every result."""

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.tracing.ray_triangle import ray_triangle
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PARAMETERS, PRESETS, Config
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.ray_vectors import ray_triangle_vectors
from tests.rtl.agreement import assert_agrees, bulk_unit

SEED = 20130413
CHUNK = 250_000


UNITS = ["ray_triangle", "ray_triangle_half"]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("preset", ["tiny", "base"])
def test_agrees_with_the_model(unit: str, preset: str) -> None:
    results = assert_agrees(unit, preset, ray_triangle_vectors(210_000, SEED), f"seed {SEED}")
    assert results["hit"].mean() > 0.3
    assert 0.3 < results["front"].sum() / results["hit"].sum() < 0.7


@pytest.mark.long
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("preset", list(PRESETS))
def test_agrees_with_the_model_on_millions(unit: str, preset: str) -> None:
    for seed in range(SEED + 1, SEED + 17):
        assert_agrees(unit, preset, ray_triangle_vectors(CHUNK, seed), f"seed {seed}")


@pytest.mark.parametrize("unit", UNITS)
def test_results_survive_stalls(unit: str) -> None:
    operands = ray_triangle_vectors(20_000, SEED)
    assert equal(bulk_unit(unit, "tiny").run(operands, stall_seed=SEED), ray_triangle(operands)).all()


@pytest.mark.long
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("depth", PARAMETERS["reciprocal_depth"].values)
def test_every_depth_of_the_reciprocal(unit: str, depth: int) -> None:
    operands = ray_triangle_vectors(20_000, SEED)
    results = BulkUnit(unit, PRESETS["tiny"].but(reciprocal_depth=depth)).run(operands)
    assert equal(results, ray_triangle(operands)).all(), f"ray_triangle_vectors(20_000, {SEED})"


def test_guard_bit_alone_rounds_every_reciprocal() -> None:
    """What `determinant` relies on, for every significand: 25 bits of the quotient, for 1 all ones, give 1 / m."""
    significands = np.arange(1 << 23, 1 << 24, dtype=np.int64)
    quotients = np.minimum((1 << 48) // significands, (1 << 25) - 1)
    rounded = (quotients >> 1) + (quotients & 1)
    expected = np.float32(1) / significands.astype(np.float32)
    assert (rounded.astype(np.float32) * np.float32(2.0**-47) == expected).all()


@pytest.mark.parametrize("config", PRESETS.values(), ids=PRESETS.keys())
def test_latency_is_the_longest_path(config: Config) -> None:
    shear = 2 * config.operators.add_depth + config.operators.multiply_depth
    reciprocal = 2 * min(config.operators.add_depth, 4) + config.operators.reciprocal_cycles + 1
    depth = 2 * config.operators.multiply_depth + 2 * config.operators.add_depth
    edges = shear + config.operators.difference_of_products_depth
    expected = edges + max(reciprocal, depth) + config.operators.multiply_depth + config.operators.compare_depth
    assert CATALOGUE["ray_triangle"](config).latency == expected

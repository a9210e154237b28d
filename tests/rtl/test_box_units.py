"""The units of the box test against their models: every bit of every result."""

from collections.abc import Callable

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal, pack, unpack
from lightloom.golden_model.contract.formats import WIDTH
from lightloom.golden_model.models import model_results
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS, Config
from lightloom.rtl.intersection.box_axis import STEPS
from lightloom.sim.bulk import BulkUnit
from lightloom.verif.vectors.box_vectors import box_setup_vectors, node_test_vectors, ray_time_vectors
from tests.rtl.agreement import assert_agrees, bulk_unit

SEED = 20170724
CHUNK = 250_000
VECTORS: dict[str, Callable[[int, int], np.ndarray]] = {
    "ray_time": ray_time_vectors,
    "box_setup": box_setup_vectors,
    "node_test": node_test_vectors,
}


@pytest.mark.parametrize("preset", ["tiny", "base"])
@pytest.mark.parametrize("unit", VECTORS)
def test_agrees_with_the_model(unit: str, preset: str) -> None:
    assert_agrees(unit, preset, VECTORS[unit](180_000, SEED), f"seed {SEED}")


@pytest.mark.long
@pytest.mark.parametrize("preset", list(PRESETS))
@pytest.mark.parametrize("unit", VECTORS)
def test_agrees_with_the_model_on_millions(unit: str, preset: str) -> None:
    for seed in range(SEED + 1, SEED + 17):
        assert_agrees(unit, preset, VECTORS[unit](CHUNK, seed), f"seed {seed}")


def test_the_vectors_reach_every_case() -> None:
    """Otherwise agreement means little."""
    tests = node_test_vectors(50_000, SEED)
    assert (unpack(pack(tests), tests.dtype) == tests).all(), "a field holds more than its bits"
    hits = model_results("node_test", tests, PRESETS["base"].flat())
    assert (np.bincount(hits["count"], minlength=WIDTH + 1) > 500).all()
    listed = np.arange(WIDTH - 1) < hits["count"][:, None].astype(int) - 1
    later, same = hits["entry"][:, :-1] < hits["entry"][:, 1:], hits["entry"][:, :-1] == hits["entry"][:, 1:]
    turned = hits["slot"][:, :-1] > hits["slot"][:, 1:]
    assert ((later & turned & listed).sum() > 5000) & ((same & listed).sum() > 5000)
    assert {*np.unique(tests["exponent"])} == set(range(16))
    assert {*np.unique(tests["steepness"])} == {*np.unique(tests["coarseness"])} == set(range(32))
    rays = model_results("box_setup", box_setup_vectors(50_000, SEED))
    assert 0.1 < rays["blind"].mean() < 0.4
    assert {*np.unique(rays["steepness"])} == set(range(28))
    assert {*np.unique(rays["coarseness"])} == set(range(32))


@pytest.mark.parametrize("unit", VECTORS)
def test_results_survive_stalls(unit: str) -> None:
    operands = VECTORS[unit](20_000, SEED)
    expected = model_results(unit, operands, PRESETS["tiny"].flat())
    assert equal(bulk_unit(unit, "tiny").run(operands, stall_seed=SEED), expected).all()


@pytest.mark.parametrize("config", PRESETS.values(), ids=PRESETS.keys())
def test_latencies(config: Config) -> None:
    deeper = config.operators.deeper
    latency = {unit: CATALOGUE[unit](config).latency for unit in VECTORS}
    assert latency == {
        "ray_time": config.operators.multiply_depth + config.operators.convert_depth,
        "box_setup": max(deeper.add_depth + 2, deeper.multiply_depth + 1) + config.operators.convert_depth,
        "node_test": config.node_test.depth,
    }


@pytest.mark.long
@pytest.mark.parametrize("depth", range(STEPS + 1))
def test_every_depth(depth: int) -> None:
    config = PRESETS["tiny"].but(node_test_depth=depth)
    operands = node_test_vectors(20_000, SEED)
    unit, expected = BulkUnit("node_test", config), model_results("node_test", operands, config.flat())
    assert equal(unit.run(operands), expected).all(), f"node_test_vectors(20_000, {SEED})"
    assert unit.latency == depth

"""Ray setup against its model: every bit of every result."""

import pytest

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS, Config
from lightloom.verif.vectors.ray_vectors import ray_setup_vectors
from tests.rtl.agreement import assert_agrees, bulk_unit

SEED = 20130413
CHUNK = 250_000


@pytest.mark.parametrize("preset", ["tiny", "base"])
def test_agrees_with_the_model(preset: str) -> None:
    results = assert_agrees("ray_setup", preset, ray_setup_vectors(210_000, SEED), f"seed {SEED}")
    assert set(results["axis"]) == {0, 1, 2}
    assert 0.4 < results["flip"].mean() < 0.6


@pytest.mark.long
@pytest.mark.parametrize("preset", list(PRESETS))
def test_agrees_with_the_model_on_millions(preset: str) -> None:
    for seed in range(SEED + 1, SEED + 17):
        assert_agrees("ray_setup", preset, ray_setup_vectors(CHUNK, seed), f"seed {seed}")


def test_results_survive_stalls() -> None:
    operands = ray_setup_vectors(20_000, SEED)
    assert equal(bulk_unit("ray_setup", "tiny").run(operands, stall_seed=SEED), ray_setup(operands)).all()


@pytest.mark.parametrize("config", PRESETS.values(), ids=PRESETS.keys())
def test_latency_is_the_longest_path(config: Config) -> None:
    assert CATALOGUE["ray_setup"](config).latency == config.operators.divide_depth + 1 + config.operators.multiply_depth

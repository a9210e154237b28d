"""Ray setup's model against exact arithmetic and against its definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightloom.golden_model.contract.bitpack import equal
from lightloom.golden_model.contract.formats import RAY
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.verif.vectors.ray_vectors import RAY_FAMILIES, ray_setup_vectors, rays
from tests.golden_model import exact_rays

SEED = 7


@pytest.mark.parametrize("family", RAY_FAMILIES)
def test_agrees_with_exact_arithmetic(family: str) -> None:
    operands = RAY_FAMILIES[family](400, np.random.default_rng(SEED))
    results = ray_setup(operands)
    for k in range(len(operands)):
        one = slice(k, k + 1)
        assert equal(results[one], exact_rays.ray_setup(operands[one])).all(), (
            f"{family}, seed {SEED}, ray {operands[k]}"
        )


def test_shear_takes_the_direction_to_the_axis() -> None:
    ray = rays(np.zeros((1, 3)), np.array([[3.0, -8.0, 2.0]]))
    prepared = ray_setup(ray)[0]
    assert (prepared["axis"], prepared["flip"]) == (1, True)
    # The dominant axis is y and runs backwards: kx and ky are x and z instead of z and x.
    assert prepared["shear"].tolist() == [3 / -8, 2 / -8, 1 / -8]
    assert prepared["inverse"].tolist() == [np.float32(1 / 3), -1 / 8, 1 / 2]


@pytest.mark.parametrize(
    ("direction", "axis"),
    [((1, 1, 1), 0), ((-1, 1, 1), 0), ((0, 1, -1), 1), ((1, 0, -1), 0), ((1, 1, 1.0000001), 2), ((0, -0.0, 0), 0)],
)
def test_ties_go_to_the_lowest_axis(direction: tuple[float, float, float], axis: int) -> None:
    assert ray_setup(rays(np.zeros((1, 3)), np.array([direction])))["axis"][0] == axis


@pytest.mark.parametrize(
    "direction",
    [(0, 0, 0), (0, -0.0, 0), (1e-39, 0, 0), (np.nan, 1, 1), (1, np.inf, 1), (1, 1, -np.inf), (1, 2.0**127, 1)],
)
def test_unusable_directions_get_a_nan_shear(direction: tuple[float, float, float]) -> None:
    assert (ray_setup(rays(np.zeros((1, 3)), np.array([direction])))["shear"].view(np.uint32) == 0x7FC00000).all()


@pytest.mark.parametrize("direction", [(2.0**126, 0, 0), (0, 2.0**-126, 0), (1e-39, 0, 1), (0, -0.0, -1)])
def test_usable_directions_keep_their_shear(direction: tuple[float, float, float]) -> None:
    assert np.isfinite(ray_setup(rays(np.zeros((1, 3)), np.array([direction])))["shear"]).all()


@settings(deadline=None)
@given(st.lists(st.floats(width=32), min_size=8, max_size=8))
def test_result_is_canonical_and_the_shear_small(values: list[float]) -> None:
    ray = np.array([(values[:3], values[3:6], values[6], values[7])], dtype=RAY)
    prepared = ray_setup(ray)[0]
    for name in ("origin", "shear", "inverse", "t_min", "t_max"):
        bits = np.atleast_1d(prepared[name]).view(np.uint32)
        magnitude = bits & 0x7FFFFFFF
        assert ((magnitude <= 0x7F800000) | (bits == 0x7FC00000)).all()
        assert ((magnitude == 0) | (magnitude >= 0x00800000)).all()
    assert np.isnan(prepared["shear"]).all() or (np.abs(prepared["shear"][:2]) <= np.float32(1)).all()


def test_shear_is_the_quotient_within_two_roundings() -> None:
    ray = RAY_FAMILIES["plausible"](100_000, np.random.default_rng(SEED))
    prepared = ray_setup(ray)
    row, kz = np.arange(len(ray)), prepared["axis"].astype(np.intp)
    direction = ray["direction"].astype(np.float64)
    for part, turn in ((0, 1), (1, 2)):
        k = np.where(prepared["flip"], (kz + 3 - turn) % 3, (kz + turn) % 3)
        exact = direction[row, k] / direction[row, kz]
        assert (np.abs(prepared["shear"][:, part] - exact) <= 2.001 * 2.0**-24 * np.abs(exact)).all()


def test_the_mixture_holds_usable_and_unusable_rays() -> None:
    usable = np.isfinite(ray_setup(ray_setup_vectors(10_000, SEED))["shear"]).all(axis=1).mean()
    assert 0.5 < usable < 0.95

"""The units that see to texels, against exact arithmetic: every bit, whatever the operands."""

from collections.abc import Callable

import numpy as np
import pytest

from lightloom.golden_model.contract.bitpack import equal, pack, unpack
from lightloom.golden_model.contract.formats import HIDDEN, LIKELY, SEEN
from lightloom.golden_model.engine.selection.texel_match import depth_tolerance
from lightloom.golden_model.models import model_results
from lightloom.verif.vectors.unit_vectors import unit_vectors
from tests import exact_texels

SEED = 68
COUNT = 1200
UNITS = {name: getattr(exact_texels, name) for name in ("texel_project", "texel_match", "texel_blend")}


def check(name: str, exact: Callable[[np.void], np.void], count: int, seed: int) -> np.ndarray:
    operands = unit_vectors(name, count, seed)
    found = model_results(name, operands)
    expected = np.array([exact(record) for record in operands], dtype=found.dtype)
    wrong = np.flatnonzero(~equal(found, expected))
    for k in wrong[:1]:
        pytest.fail(f"unit_vectors({name!r}, {count}, {seed})[{k}]: {operands[k]}: {found[k]}, not {expected[k]}")
    return found


@pytest.mark.parametrize("name", UNITS)
def test_agrees_with_exact_arithmetic(name: str) -> None:
    check(name, UNITS[name], COUNT, SEED)


@pytest.mark.long
@pytest.mark.parametrize("name", UNITS)
def test_agrees_with_exact_arithmetic_on_many(name: str) -> None:
    for seed in range(SEED + 1, SEED + 21):
        check(name, UNITS[name], 5000, seed)


@pytest.mark.parametrize("name", UNITS)
def test_vectors_fit_their_fields(name: str) -> None:
    operands = unit_vectors(name, 5000, SEED)
    assert (pack(unpack(pack(operands), operands.dtype)) == pack(operands)).all()
    assert equal(unpack(pack(operands), operands.dtype), operands).all()


def test_the_vectors_reach_every_outcome() -> None:
    """Otherwise agreement means little."""
    places = model_results("texel_project", unit_vectors("texel_project", 6000, SEED))
    assert 0.2 < places["visible"].mean() < 0.6
    assert (places["outside"] > 0).sum() > 100
    operands = unit_vectors("texel_match", 6000, SEED)
    assert np.isnan(depth_tolerance(operands)).sum() > 10
    matches = model_results("texel_match", operands)
    assert min((matches["degree"] == degree).mean() for degree in (HIDDEN, LIKELY, SEEN)) > 0.05
    assert (np.bincount(matches["lod"], minlength=4) > 50).all()
    blends = model_results("texel_blend", unit_vectors("texel_blend", 6000, SEED))
    assert 0.05 < blends["noticed"].mean() < 0.6
    for name in ("spread", "deviation"):
        assert len(np.unique(blends[name])) > 100
        assert (blends[name] == 4095).sum() > 20

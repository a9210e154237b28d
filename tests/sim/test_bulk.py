"""The bulk harness: it loses nothing under stalls, and says so of a unit that does."""

from functools import cache

import numpy as np
import pytest

from lightloom.gen.verilog import verilog_of
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.models import model_results
from lightloom.rtl.catalogue import CATALOGUE
from lightloom.rtl.config import PRESETS
from lightloom.sim import bulk, toolchain
from lightloom.sim.bulk import BulkError, BulkUnit
from tests.vectors import random_vectors

NAME, SEED, COUNT = "float_compare", 7, 20_000
OPERANDS = random_vectors(NAME, COUNT, SEED)
EXPECTED = model_results(NAME, OPERANDS)


@cache
def unit() -> BulkUnit:
    return BulkUnit(NAME)


def broken(original: str, mutant: str) -> BulkUnit:
    """The unit with one piece of its Verilog replaced."""
    good = verilog_of(NAME, PRESETS["base"])
    assert good.count(original) == 1
    return BulkUnit(NAME, verilog=good.replace(original, mutant))


@pytest.mark.parametrize("stall_seed", [None, 1, 2, 2**63 - 1])
def test_results_are_the_models(stall_seed: int | None) -> None:
    assert bitpack.equal(unit().run(OPERANDS, stall_seed=stall_seed), EXPECTED).all()


def test_full_rate_and_declared_latency() -> None:
    unit().run(OPERANDS)
    assert unit().latency == CATALOGUE[NAME](PRESETS["base"]).latency
    assert COUNT <= unit().cycles < COUNT + 1000, "one operation a cycle, and a tail"
    assert unit().throughput > 0


def test_chunks_are_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk, "CHUNK", 777)
    assert bitpack.equal(unit().run(OPERANDS[:2000]), EXPECTED[:2000]).all()


def test_no_operands() -> None:
    assert len(unit().run(OPERANDS[:0])) == 0


def test_wrong_dtype_is_refused() -> None:
    with pytest.raises(TypeError, match="takes operands of dtype"):
        unit().run(np.zeros(3, dtype=np.float32))


def test_unknown_unit_is_refused() -> None:
    with pytest.raises(InputError, match=r"^float_cube: no such unit; known are .*float_add"):
        BulkUnit("float_cube")


def test_a_wrong_bit_is_seen() -> None:
    wrong = broken("{ tag0, ", "{ tag0, ~").run(OPERANDS)
    assert not bitpack.equal(wrong, EXPECTED).any()


@pytest.mark.parametrize(
    ("original", "mutant", "stall_seed", "message"),
    [
        ("{ tag0, ", "{ 8'h00, ", None, "wrong tag"),
        ("else if (i__ready) o__valid", "else o__valid", 3, "wrong tag|a result before its operands|hangs"),
        ("_0_ | o__ready", "1'b1", 3, "wrong tag|hangs"),
        ("_0_ | o__ready", "1'b0", 3, "hangs"),
        ("o__valid <= i__valid", "o__valid <= 1'b1", None, "a result before its operands|wrong tag|too many"),
    ],
    ids=["tag", "withdrawn", "lost", "stuck", "invented"],
)
def test_a_broken_stream_is_an_error(original: str, mutant: str, stall_seed: int | None, message: str) -> None:
    with pytest.raises(BulkError, match=message):
        broken(original, mutant).run(OPERANDS, stall_seed=stall_seed)


def test_a_simulator_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    unit().run(OPERANDS[:1])

    def build(*_: object, **__: object) -> str:
        raise AssertionError("built again")

    monkeypatch.setattr(toolchain, "run", build)
    assert bitpack.equal(BulkUnit(NAME).run(OPERANDS[:10]), EXPECTED[:10]).all()

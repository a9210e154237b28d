"""Hosts that differ in what is left open: which NaN an operation makes, casts out of range, the order of texels."""

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.engine import maintainer
from lightloom.golden_model.engine.sampling.gather import gather
from lightloom.golden_model.numerics import floats

MODEL = "lightloom.golden_model."


def everywhere(monkeypatch: pytest.MonkeyPatch, name: str, function: Callable[..., Any]) -> None:
    """Puts `function` in the place of `floats.name` in every module of the model that uses it."""
    before = getattr(floats, name)
    users = [each for key, each in sys.modules.items() if key.startswith(MODEL) and vars(each).get(name) is before]
    assert floats in users
    assert len(users) > 10
    for module in users:
        monkeypatch.setattr(module, name, function)


def nans_are_random(monkeypatch: pytest.MonkeyPatch, seed: int) -> Callable[[], int]:
    """Every NaN that an operation makes gets a sign and a payload at random; the result says how many there were."""
    random, flush, met = np.random.default_rng(seed), floats.flush, 0

    def scrambled(x: np.ndarray) -> np.ndarray:
        nonlocal met
        out = np.asarray(flush(x))
        wrong = np.isnan(out)
        if out.dtype == np.float32 and wrong.any():
            met += int(np.count_nonzero(wrong))
            payload = random.integers(1, 1 << 22, out.shape, dtype=np.uint32) | np.uint32(0x7FC00000)
            sign = random.integers(0, 2, out.shape, dtype=np.uint32) << np.uint32(31)
            out = np.where(wrong, (payload | sign).view(np.float32), out)
        return out

    everywhere(monkeypatch, "flush", scrambled)
    return lambda: met


@contextmanager
def casts_are_errors(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A NaN or a number out of range that is cast to an integer is an error, also where the model hides warnings.

    NumPy says so where the processor does. So without one, a host whose casts saturate has the same bits.
    """
    errstate = np.errstate

    def telling(**_: Any) -> Any:
        return errstate(all="ignore", invalid="warn")

    monkeypatch.setattr(np, "errstate", telling)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*encountered in cast")
        with pytest.raises(RuntimeWarning, match="in cast"), np.errstate():
            np.full(8, np.nan, dtype=np.float32).astype(np.int64)
        yield


def texels_are_shuffled(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """The texels of an update are sampled in another order."""
    random = np.random.default_rng(seed)

    def shuffled(world: Any, update: Any, *others: Any) -> Any:
        order = random.permutation(len(update.texel))
        mixed = replace(update, texel=update.texel[order], record=update.record[order], number=update.number[order])
        done = yield from gather(world, mixed, *others)
        return replace(done, sums=done.sums[np.argsort(order)])

    monkeypatch.setattr(maintainer, "gather", shuffled)

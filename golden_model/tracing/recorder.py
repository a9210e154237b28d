"""Remembers ray-triangle tests as they entered the unit, so that they can be replayed through the RTL."""

from typing import Any

import numpy as np

from lightloom.golden_model.contract.formats import RAY_TRIANGLE

KEY = np.dtype([("ray", np.int64), ("primitive", np.int32)])
"""Names a test: the ray's number among all rays that the recorder saw, and the triangle's index."""


class TestRecorder:
    """Counts every test of the traversals that it is handed to, and keeps a fair sample of them.

    Each test has a rank, a hash of (seed, ray number, primitive); the `limit` tests of lowest rank are kept. So every
    subset of that size is equally likely, and which one it is depends on the tests alone, not on the order in which
    they were made, the backend or the size of batches. Up to `limit` tests in total, all are kept.

    One recorder may serve many calls of `trace`, on different trees too: rays are numbered on from call to call.
    """

    __test__ = False  # pytest takes every class named Test… for tests

    def __init__(self, limit: int, seed: int):
        """`limit` >= 1 tests are kept at most; `seed` is any integer."""
        if limit < 1:
            raise ValueError(f"limit must be at least 1, not {limit}")
        self.limit = limit
        self.rays = 0
        """Rays traced."""
        self.nodes = 0
        """Inner nodes visited (two boxes tested each)."""
        self.total = 0
        """Triangle tests made."""
        self.offset = np.uint64(seed * 0x9E3779B97F4A7C15 % 2**64)
        self.threshold = np.uint64(2**64 - 1)
        """Tests of a higher rank cannot be in the sample any more."""
        self._held = 0
        self._ranks: list[np.ndarray] = []
        self._keys: list[np.ndarray] = []
        self._tests: list[np.ndarray] = []

    def offset_of_call(self) -> np.uint64:
        """What is added to (ray << 32) + primitive before `mix`, for rays numbered within the present call."""
        return np.uint64((int(self.offset) + (self.rays << 32)) % 2**64)

    def record(self, ray: np.ndarray, primitive: np.ndarray, tests: np.ndarray) -> None:
        """Counts tests RAY_TRIANGLE (N,) of rays (N,), numbered within the present call, and triangles (N,)."""
        self.total += len(tests)
        ray = ray + self.rays
        wanted = rank(self.offset, ray, primitive) <= self.threshold
        self.keep(ray[wanted], primitive[wanted], tests[wanted])

    def keep(self, ray: np.ndarray, primitive: np.ndarray, tests: np.ndarray) -> None:
        """Takes wanted tests RAY_TRIANGLE (N,), named by ray numbers and primitives (N,)."""
        if not len(tests):
            return
        keys = np.zeros(len(tests), dtype=KEY)
        keys["ray"], keys["primitive"] = ray, primitive
        self._ranks.append(rank(self.offset, ray, primitive))
        self._keys.append(keys)
        self._tests.append(tests)
        self._held += len(tests)
        if self._held > 2 * self.limit:
            self._trim()

    def sample(self) -> np.ndarray:
        """RAY_TRIANGLE (M,), M = min(total, limit): the sample, by ray number and then primitive."""
        self._trim()
        return self._tests[0][self._order()] if self._tests else np.zeros(0, dtype=RAY_TRIANGLE)

    def keys(self) -> np.ndarray:
        """KEY (M,): which tests `sample` returns, in the same order."""
        self._trim()
        return self._keys[0][self._order()] if self._keys else np.zeros(0, dtype=KEY)

    def _order(self) -> np.ndarray:
        return np.lexsort((self._keys[0]["primitive"], self._keys[0]["ray"]))

    def _trim(self) -> None:
        """Joins what was kept and drops all but the `limit` tests of lowest rank."""
        if not self._held:
            return
        ranks, keys, tests = (np.concatenate(part) for part in (self._ranks, self._keys, self._tests))
        if len(ranks) > self.limit:
            self.threshold = np.partition(ranks, self.limit - 1)[self.limit - 1]
            low = ranks <= self.threshold  # ranks are all different: exactly `limit` of them
            ranks, keys, tests = ranks[low], keys[low], tests[low]
        self._ranks, self._keys, self._tests, self._held = [ranks], [keys], [tests], len(ranks)


def rank(offset: np.uint64, ray: np.ndarray, primitive: np.ndarray) -> np.ndarray:
    """(N,) uint64 hash of tests' names; no two tests of the first 2**32 rays have the same."""
    return mix((ray.astype(np.uint64) << np.uint64(32)) + primitive.astype(np.uint64) + offset)


def mix(x: Any) -> Any:
    """The finaliser of SplitMix64: a bijection of uint64 whose every output bit depends on every input bit."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))

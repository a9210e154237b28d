"""What maintenance does with texels by the hundred thousand: NumPy's definitions, or compiled twins on threads.

A twin gives the same bits as its definition, for any number of threads: each part of the texels is done by itself.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from lightloom.golden_model.engine.publishing.smoothing import Smoother
from lightloom.golden_model.engine.selection.screen_test import ScreenTest, screen_test
from lightloom.golden_model.tables.lightmap import Lightmaps
from lightloom.golden_model.tracing.bvh.traversal import backend_of

PORTION = 16384
"""Texels of a part: few enough for the processor's cache, and for the threads to end together."""


class Kernels:
    """One of each, for a backend and a number of threads."""

    screen_test: ScreenTest
    smoother: Callable[[Lightmaps], Smoother]

    def __init__(self, backend: str = "numpy", threads: int = 1):
        """`backend` and `threads` as for `Structure`; NumPy's run on one."""
        if backend_of(backend) == "numpy":
            self.screen_test, self.smoother = screen_test, Smoother
            return
        # Imported when needed: numba takes half a second to load.
        from lightloom.golden_model.engine.publishing.smoothing_numba import CompiledSmoother
        from lightloom.golden_model.engine.selection import screen_test_numba

        self._map: Callable[..., Iterable[None]] = map if threads == 1 else ThreadPoolExecutor(threads).map
        self.screen_test = partial(screen_test_numba.screen_test, run=self._run)
        self.smoother = partial(CompiledSmoother, run=self._run)

    def _run(self, work: Callable[[slice], None], count: int) -> None:
        """Has `work` done for `count` things, a slice of them at a time, on all threads."""
        parts = (slice(first, min(first + PORTION, count)) for first in range(0, count, PORTION))
        for _ in self._map(work, parts):
            pass

"""The acceleration structure of a moving scene: a tree for each object, joined under a tree over their boxes.

The coarse part comes first ([0062]): when `Structure.update` returns, the boxes of all objects are known and rays may
start. Objects that stay keep their trees. One that has moved keeps the shape of its tree and gets new boxes
(`build.refit`), or is built anew when that has made the tree too poor. With `ForestOptions.demand` this is done for an
object when the first ray enters its box, and not at all for one that no ray enters.

Hits have the bits that one new tree over all triangles would give. docs/structure.md describes and measures it.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import quiet
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.structures.forest import Figures, Forest, ForestOptions
from lightloom.golden_model.tracing.bvh.build import Bvh
from lightloom.golden_model.tracing.bvh.ray_box import box_rays, ray_box
from lightloom.golden_model.tracing.bvh.traversal import CHUNK, backend_of, trace
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.recorder import TestRecorder

MOST_THREADS = 256


def require_threads(threads: int, called: str = "threads") -> None:
    """Raises InputError for a number of threads out of range; `called` is what the user knows it by."""
    if not 1 <= threads <= MOST_THREADS:
        raise InputError(f"{called} {threads}: must be 1 to {MOST_THREADS}")


class Structure:
    """Traces rays through the frames of a scene, one frame at a time: a `trace_protocol.Trace`."""

    def __init__(
        self,
        scene: Scene,
        backend: str = "auto",
        recorder: TestRecorder | None = None,
        threads: int = 1,
        options: ForestOptions | None = None,
    ):
        """Of a scene at rest or of any frame, ready to trace it. `backend` and `recorder` as for `traversal.trace`.

        `threads`, 1 to 256, changes no bit of any hit; what a recorder sees goes through one. Raises InputError.
        """
        require_threads(threads)
        self.backend, self.recorder, self.threads = backend_of(backend), recorder, threads
        self.options = options or ForestOptions()
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self.scene = scene
        self._fine = Forest(scene, self.options)
        self._coarse: Forest | None = None

    def update(self, scene: Scene) -> None:
        """Follows the scene to another of its frames (`scene_at`)."""
        self.scene = scene
        self._fine.update(scene)
        if self._coarse is not None and scene.coarse is not None:
            self._coarse.update(scene.coarse)

    def trace(self, rays: np.ndarray, *, any_hit: bool = False, coarse: bool = False) -> np.ndarray:
        """RAY (N,) to HIT (N,), as `traversal.trace`.

        With `coarse` the hits are those with `scene.coarse`, whose triangles they name; of a scene that has none, those
        with the scene itself.
        """
        forest = self._forest(coarse)
        if not forest.waiting:
            return self._traced(forest.joined, rays, any_hit)
        parts = [self._demanding(forest, rays[part], any_hit) for part in _parts(len(rays), 1)]
        if self.recorder is not None:
            # It is to see each ray once, in the tree that is left: rays that wait for detail start anew.
            return self._traced(forest.joined, rays, any_hit)
        return np.concatenate([np.zeros(0, dtype=HIT), *parts])

    def figures(self, *, coarse: bool = False) -> Figures:
        """What the trees of the current frame have cost until now."""
        return self._forest(coarse).figures

    def bvh(self, *, coarse: bool = False) -> Bvh:
        """The joined tree of the current frame; with `demand`, of the objects that rays have asked for."""
        return self._forest(coarse).joined

    def _forest(self, coarse: bool) -> Forest:
        if not coarse or self.scene.coarse is None:
            return self._fine
        # A scene whose coarse geometry nobody traces does not pay for it.
        if self._coarse is None:
            self._coarse = Forest(self.scene.coarse, self.options)
        return self._coarse

    def _traced(self, bvh: Bvh, rays: np.ndarray, any_hit: bool) -> np.ndarray:
        if self._pool is None or self.recorder is not None:
            return trace(bvh, rays, any_hit=any_hit, backend=self.backend, recorder=self.recorder)
        traced = self._pool.map(
            lambda part: trace(bvh, rays[part], any_hit=any_hit, backend=self.backend),
            _parts(len(rays), self.threads),
        )
        return np.concatenate([np.zeros(0, dtype=HIT), *traced])

    def _demanding(self, forest: Forest, rays: np.ndarray, any_hit: bool) -> np.ndarray:
        """Traces rays and has made what they enter, nearest first; those that entered something start again.

        A ray asks for the nearest body that waits and that it enters before the best hit it has so far, as one does
        that meets the body's box in a traversal from near to far.
        """
        hits = np.zeros(len(rays), dtype=HIT)
        open_rays = np.arange(len(rays))
        while len(open_rays):
            found = trace(forest.joined, rays[open_rays], any_hit=any_hit, backend=self.backend)
            hits[open_rays] = found
            entered = _entered(forest, rays[open_rays], found, any_hit)
            forest.demand([forest.waiting[k] for k in np.unique(entered[entered >= 0])])
            open_rays = open_rays[entered >= 0]
        return hits


@quiet
def _entered(forest: Forest, rays: np.ndarray, hits: np.ndarray, any_hit: bool) -> np.ndarray:
    """Which of the waiting bodies each RAY (N,) enters first, not beyond its HIT; (N,) int64, -1 for none.

    The test is that of the traversal, with the pad that covers all bodies of the frame, so no hit can be missed.
    """
    prepared = ray_setup(rays)
    slabs = box_rays(prepared, rays["direction"], *forest.bounds())
    hit = hits["primitive"] >= 0
    nearest = np.where(hit, hits["t"], prepared["t_max"])
    open_rays = ~np.isnan(prepared["shear"][:, 0]) & ~(hit & any_hit)
    body = np.full(len(rays), -1, dtype=np.int64)
    for number, (lower, upper) in enumerate(forest.boxes()):
        entry, enters = ray_box(slabs, lower[:, None], upper[:, None], prepared["t_min"], nearest)
        # Of equal entries the first body's counts; a ray that has asked for none takes any.
        taken = enters & open_rays & ((body < 0) | (entry < nearest))
        body[taken], nearest[taken] = number, entry[taken]
    return body


def _parts(count: int, threads: int) -> Iterator[slice]:
    """`count` rays in parts of about the same size for the threads, each at most a chunk of the traversal."""
    parts = threads * -(-count // (threads * CHUNK))
    size = max(-(-count // max(parts, 1)), 1)
    return (slice(begin, begin + size) for begin in range(0, count, size))

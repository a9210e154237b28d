"""The ray collector: one for all emitters of rays ([0059], [0063]), which groups them by common work ([0064], [0090]).

Fragment shading, the frame shader and lightmap maintenance hand their rays to one collector. It packs rays of a kind
into collections: of the same test (nearest or any hit), through the same geometry, in the same octant of directions,
from the same cell of space. These are the rays that meet the same nodes and triangles. A collection is traced when it
is full, and every result goes back to the emitter of its ray, in the order in which that emitter sent its rays.

How it works in hardware ([0090]). The bits of a ray's kind, its scheduling key, select one of a fixed number of
collection definitions. A definition holds the key of one open collection and the slot that its rays are stored in. A
ray of the same key joins; a full collection's slot goes on the ready stack, and a new slot is taken from the empty
stack with the next ray. A ray of another key forces the collection out before it is full. When the emitters are done,
what is left open is forced out as well. So the memory is bounded, and nothing waits for a ray that never comes.

The model looks at a whole wave of rays at once, definition by definition, and finds the same collections. A hit is a
function of ray and triangles alone, so no choice here changes a bit of any result.
"""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from lightloom.golden_model.contract.formats import HIT
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.numerics.floats import float_to_fixed_down, flush, quiet
from lightloom.golden_model.numerics.structured import join, put, take

FRAGMENT_SHADING, FRAME_SHADER, MAINTENANCE = "fragment shading", "frame shader", "lightmap maintenance"
EMITTERS = (FRAGMENT_SHADING, FRAME_SHADER, MAINTENANCE)


class KindTrace(Protocol):
    """Traces RAY (N,) to HIT (N,), as `Structure.trace`."""

    def __call__(self, rays: np.ndarray, *, any_hit: bool = False, coarse: bool = False) -> np.ndarray: ...


@dataclass(frozen=True, kw_only=True)
class Packing:
    """How rays are grouped."""

    capacity: int = 64
    """Rays of a full collection, 1 to 1024."""
    definitions: int = 1024
    """Collections that may be open at a time, a power of two, 1 to 65536."""
    cells: int = 4
    """Cells of space along each axis, a power of two, 1 to 64."""

    def __post_init__(self) -> None:
        if not 1 <= self.capacity <= 1024:
            raise InputError(f"collection capacity {self.capacity}: must be 1 to 1024")
        if self.definitions & (self.definitions - 1) or not 1 <= self.definitions <= 65536:
            raise InputError(f"collection definitions {self.definitions}: must be a power of two, 1 to 65536")
        if self.cells & (self.cells - 1) or not 1 <= self.cells <= 64:
            raise InputError(f"collector cells {self.cells}: must be a power of two, 1 to 64")


@dataclass(kw_only=True)
class CollectorFigures:
    """What went through a collector."""

    rays: dict[str, int] = field(default_factory=lambda: dict.fromkeys(EMITTERS, 0))
    """By emitter."""
    kinds: dict[str, int] = field(
        default_factory=lambda: {"nearest": 0, "any": 0, "nearest coarse": 0, "any coarse": 0}
    )
    """By kind of test and geometry."""
    waves: int = 0
    """Times that everything waiting was traced."""
    collections: int = 0
    full: int = 0
    """Collections that left with as many rays as fit."""
    forced: int = 0
    """Collections that a ray of another kind forced out before they were full; the rest was left at a wave's end."""

    @property
    def mean_fill(self) -> float:
        """Rays a collection, 0 before the first."""
        return sum(self.rays.values()) / self.collections if self.collections else 0.0


@dataclass(frozen=True)
class _Batch:
    rays: np.ndarray
    kind: int  # any hit: 1, coarse: 2


class Collector:
    """Collects rays and traces them, wave by wave."""

    def __init__(self, trace: KindTrace, low: np.ndarray, high: np.ndarray, packing: Packing | None = None):
        """`low` and `high` (3,) float32 bound what the cells divide; rays from outside are of the border cells."""
        self.packing = packing or Packing()
        self.figures = CollectorFigures()
        self._trace = trace
        self._low = np.asarray(low, dtype=np.float32)
        self._per_cell = _cells_per_unit(self._low, np.asarray(high, dtype=np.float32), self.packing.cells)
        self._waiting: list[_Batch] = []
        self._results: list[np.ndarray] = []

    def emit(self, emitter: str, rays: np.ndarray, *, any_hit: bool = False, coarse: bool = False) -> int:
        """Takes RAY (N,) for the next `run`; returns the ticket for their results. `emitter` is one of `EMITTERS`."""
        self.figures.rays[emitter] += len(rays)
        self._waiting.append(_Batch(rays, any_hit + 2 * coarse))
        return len(self._waiting) - 1

    def run(self) -> None:
        """Traces everything that waits. Tickets of the wave before become void."""
        batches, self._waiting = self._waiting, []
        sizes = [len(batch.rays) for batch in batches]
        hits = np.zeros(sum(sizes), dtype=HIT)
        if len(hits):
            rays = join([batch.rays for batch in batches])
            kind = np.repeat(np.array([batch.kind for batch in batches], dtype=np.uint32), sizes)
            order, begins = self._pack(self._keys(rays, kind))
            self._count(order, begins, kind)
            kind = kind[order]
            rays = take(rays, order)
            for number in np.unique(kind):
                chosen = np.flatnonzero(kind == number)
                some = rays if len(chosen) == len(rays) else take(rays, chosen)
                traced = self._trace(some, any_hit=bool(number & 1), coarse=bool(number & 2))
                put(hits, order[chosen], traced)
        self._results = np.split(hits, np.cumsum(sizes)[:-1]) if batches else []

    def hits(self, ticket: int) -> np.ndarray:
        """HIT (N,) of the rays emitted for `ticket`, in their order; valid from one `run` to the next."""
        return self._results[ticket]

    def now(self, emitter: str, rays: np.ndarray, *, any_hit: bool = False) -> np.ndarray:
        """HIT (N,) of RAY (N,) at once, in a wave of their own with whatever else waits."""
        ticket = self.emit(emitter, rays, any_hit=any_hit)
        self.run()
        return self.hits(ticket)

    def collections(self, rays: np.ndarray, *, any_hit: bool = False, coarse: bool = False) -> list[np.ndarray]:
        """The collections that RAY (N,) would come to by themselves, in order of leaving: numbers of rays each."""
        order, begins = self._pack(self._keys(rays, np.full(len(rays), any_hit + 2 * coarse, dtype=np.uint32)))
        return np.split(order, begins[1:])

    @quiet
    def _keys(self, rays: np.ndarray, kind: np.ndarray) -> np.ndarray:
        """Scheduling keys (N,) uint32: kind, octant (the signs of the direction), cell of the origin."""
        key = kind.copy()
        for axis in range(3):
            key = (key << np.uint32(1)) | np.signbit(rays["direction"][:, axis])
        for axis in range(3):
            place = flush(flush(rays["origin"][:, axis] - self._low[axis]) * self._per_cell[axis])
            # A NaN, which no ray from a surface has, belongs to cell 0.
            cell = np.clip(float_to_fixed_down(place), 0, self.packing.cells - 1).astype(np.uint32)
            key = key * np.uint32(self.packing.cells) + cell
        return key

    def definition(self, key: np.ndarray) -> np.ndarray:
        """The definition that scheduling keys (N,) uint32 belong to, (N,) uint16: the low bits xor the next ones."""
        bits = np.uint32(self.packing.definitions.bit_length() - 1)
        return ((key ^ (key >> bits)) & np.uint32(self.packing.definitions - 1)).astype(np.uint16)

    def _pack(self, key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Collections of a stream of keys (N,): the rays in order of their collections, and where each begins.

        A definition sees the rays whose key belongs to it and nothing else, so definitions can be looked at one after
        the other: a new collection begins where the key changes, and after `capacity` rays of the same. They are
        returned in the order in which they leave: with the ray that fills them or forces them out; the rest at the end.
        """
        count = len(key)
        definition = self.definition(key)
        order = np.argsort(definition, kind="stable")  # 16 bits: a radix sort
        key, definition = key[order], definition[order]
        change = np.concatenate([[True], key[1:] != key[:-1]])
        run_begin = np.flatnonzero(change)
        length = np.diff(np.append(run_begin, count))
        collections = -(-length // self.packing.capacity)
        run = np.repeat(np.arange(len(run_begin)), collections)
        place = np.arange(len(run)) - np.repeat(np.cumsum(collections) - collections, collections)
        begin = run_begin[run] + place * self.packing.capacity
        size = np.diff(np.append(begin, count))

        # When each leaves: with its own last ray if that fills it, with the first of the next in its definition if that
        # is of another key, else at the end.
        last = order[begin + size - 1]
        following = np.minimum(begin + size, count - 1)
        forced = (begin + size < count) & (definition[following] == definition[begin])
        leaves = np.where(size == self.packing.capacity, last, np.where(forced, order[following], count))
        self._last_pack = int((size == self.packing.capacity).sum()), int((leaves < count).sum())
        leaving = np.argsort(leaves, kind="stable")
        begin, size = begin[leaving], size[leaving]
        starts = np.cumsum(size) - size
        gather = np.repeat(begin - starts, size) + np.arange(count)
        return order[gather], starts

    def _count(self, order: np.ndarray, begins: np.ndarray, kind: np.ndarray) -> None:
        full, early = self._last_pack
        self.figures.waves += 1
        self.figures.collections += len(begins)
        self.figures.full += full
        self.figures.forced += early - full
        for number, name in enumerate(self.figures.kinds):
            self.figures.kinds[name] += int(np.count_nonzero(kind == number))


@quiet
def _cells_per_unit(low: np.ndarray, high: np.ndarray, cells: int) -> np.ndarray:
    """Cells a unit of length along each axis, (3,) float32; 0 along an axis of no extent."""
    extent = flush(high - low)
    per_unit = flush(np.float32(cells) / extent)
    return np.where((extent > 0) & np.isfinite(per_unit), per_unit, np.float32(0))

"""Measures the traversal unit in Verilated hardware, and holds its results against the golden model: `lightloom bench`.

Every run is compared with `golden_model.tracing.wide_bvh.traversal.trace_tree` in all bits, and where a ray makes one
visit at a time, its counts too. What is measured depends on the seed alone, but for the speed of the simulation.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from lightloom.bench.tree import BUNNY
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import RAY_QUERY
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES, diffuse_rays, texel_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim.traversal import TraversalRun, TraversalUnit, memory_bits

DRAGON = Path("build/meshes/dragon.ply")
SEED = 82
Advance = Callable[[float], None]
Row = dict[str, Any]


SWEPT = {"width": "widths", "contexts": "contexts", "latency": "latencies", "units": "units"}
"""Options that take several numbers, and the field of the `Sweep` that each one gives."""


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What is measured."""

    scenes: tuple[str, ...]
    """Names or paths, as for `load_scene`."""
    preset: str = "base"
    """Whatever of the hardware is not swept,"""
    settings: tuple[tuple[str, int], ...] = ()
    """but for these parameters of it: names and values."""
    widths: tuple[int, ...] = (8,)
    """Children of a node."""
    contexts: tuple[int, ...] = (64,)
    """Rays in a unit."""
    latencies: tuple[int, ...] = (0, 100, 400)
    """Of the memory, in cycles."""
    units: tuple[int, ...] = ()
    """Traversal units at one memory port, each number with the first width and contexts, at latency 100, with rays in
    each of ORDERS."""
    rays: int = 10_000
    """Diffuse rays of a measured run; times the number of units."""
    identity_rays: int = 4_000
    """Rays of all families, half of them any-hit, that are compared with the golden model for each scene and width."""
    box_pairs: int = 100_000
    """Pairs of ray and box for the rate of false accepts."""

    @property
    def runs(self) -> int:
        """Steps that `measure` reports."""
        shapes = len(self.scenes) * len(self.widths)
        speeds = shapes * len(self.contexts) * len(self.latencies) + len(self.scenes) * len(self.units) * len(ORDERS)
        return speeds + shapes * len(CONDITIONS) + 1


def command_of(sweep: Sweep) -> str:
    """The command line that measures a sweep of the command line."""
    full = sweep.identity_rays == default_sweep(True).identity_rays
    words = ["lightloom bench traversal", *(["--full"] if full else [])]
    default = default_sweep(full)
    if sweep.preset != default.preset:
        words += ["--preset", sweep.preset]
    words += [f"--set {name}={value}" for name, value in sweep.settings]
    if sweep.scenes != default.scenes:
        words += [f"--scene {scene}" for scene in sweep.scenes]
    if sweep.rays != default.rays:
        words += ["--rays", str(sweep.rays)]
    for option, field in SWEPT.items():
        numbers = getattr(sweep, field)
        if numbers != getattr(default, field):
            words += [f"--{option}", ",".join(map(str, numbers))]
    return " ".join([*words, "--json"])


def default_scenes(full: bool) -> tuple[str, ...]:
    """The Cornell box and, where `make meshes` has put them, the bunny and (if `full`) the dragon."""
    return ("cornell-box", *(str(path) for path in (BUNNY, *((DRAGON,) if full else ())) if path.exists()))


def default_sweep(full: bool) -> Sweep:
    """The quick one takes a few minutes, the full one about an hour on two cores, a third of it to build simulators."""
    if not full:
        return Sweep(scenes=default_scenes(full))
    return Sweep(
        scenes=default_scenes(full),
        widths=(8, 4),
        contexts=(64, 16, 32, 128),
        latencies=(0, 50, 100, 200, 400),
        units=(1, 2, 4),
        rays=30_000,
        identity_rays=100_000,
        box_pairs=1_000_000,
    )


ORDERS = {"random": diffuse_rays, "texel by texel": texel_rays}
"""Rays that have nothing to do with those before them, and as the maintenance of lightmaps emits them."""

CONDITIONS: dict[str, dict[str, Any]] = {
    "one visit at a time": {"overlap": 1, "latency": 0},
    "out of order, stalled": {
        "latency": 30,
        "reorder": 60,
        "interleave": True,
        "memory_stall": 32,
        "stall_seed": SEED,
    },
}
"""Under which results are compared with the golden model. A few adversarial rays meet every node of the tree, one after
the other, while the unit is otherwise empty: therefore latencies are short."""


def measure(sweep: Sweep, advance: Advance) -> dict[str, Any]:
    """Ready for JSON: `command`, and the tables `speed`, `units`, `identity` and `boxes`, lists of rows.

    `advance` is told of each run that is done.
    """
    from lightloom.bench.boxes import box_test_figures

    tables: dict[str, list[Row]] = {"speed": [], "units": [], "identity": [], "boxes": []}

    def collect(table: str, rows: Iterator[Row]) -> None:
        for row in rows:
            tables[table].append(row)
            advance(1)

    for scene in sweep.scenes:
        _triangles(scene)  # what cannot be read is found out before the work
    # All scenes on a simulator before the next one is built.
    for width in sweep.widths:
        for contexts in sweep.contexts:
            collect("speed", _speed(sweep, width, contexts))
        collect("identity", _identity(sweep, width))
    for units in sweep.units:
        collect("units", _units(sweep, units))
    figures = box_test_figures(sweep.box_pairs, SEED)
    tables["boxes"] = [{"family": family, **values} for family, values in figures.items()]
    advance(1)
    return {"command": command_of(sweep), **tables}


def _speed(sweep: Sweep, width: int, contexts: int) -> Iterator[Row]:
    for scene, latency in product(sweep.scenes, sweep.latencies):
        yield _measured(_config(sweep, width=width, contexts=contexts), scene, sweep.rays, latency)


def _units(sweep: Sweep, units: int) -> Iterator[Row]:
    config = _config(sweep, width=sweep.widths[0], contexts=sweep.contexts[0], units=units)
    for scene, order in product(sweep.scenes, ORDERS):
        yield _measured(config, scene, sweep.rays * units, 100, order)


def _identity(sweep: Sweep, width: int) -> Iterator[Row]:
    config = _config(sweep, width=width, contexts=sweep.contexts[0])
    for scene, (name, options) in product(sweep.scenes, CONDITIONS.items()):
        blocks, queries = _tree(scene, width, config.traversal.stack), _mixed_queries(scene, sweep.identity_rays)
        run, different, counts = _run(config, blocks, queries, **options)
        strict = options.get("overlap") == 1
        yield {
            "scene": Path(scene).stem,
            "width": width,
            "condition": name,
            "rays": len(queries),
            "any_hit_rays": int(queries["any_hit"].sum()),
            "mismatches": different,
            "count_mismatches": _count_mismatches(run, counts) if strict else None,
            "cycles_per_ray": run.cycles / len(queries),
            "node_tests": run.counters["node_tests"] / len(queries),
            "revisits": run.counters["revisits"] / len(queries),
        }


def _measured(config: Config, scene: str, rays: int, latency: int, order: str = "random") -> Row:
    """One row: a run of diffuse rays, closest hit, all sides free."""
    blocks = _tree(scene, config.tree.width, config.traversal.stack)
    queries = queries_of(ORDERS[order](_triangles(scene), rays, SEED))
    run, different, counts = _run(config, blocks, queries, latency=latency)
    count = run.counters
    cycles = run.cycles * config.traversal.units
    golden = {name: int(counts[name].sum()) for name in ("node_tests", "triangle_tests")}
    # The cycles that the busier of the two test units needs for what the algorithm asks for; tests that the unit makes
    # beyond that, because a ray runs ahead of its own hits, do not count.
    needed = max(golden["node_tests"], golden["triangle_tests"] * config.triangle_test.interval)
    return {
        "scene": Path(scene).stem,
        "units": config.traversal.units,
        "width": config.tree.width,
        "contexts": config.traversal.contexts,
        "latency": latency,
        "order": order,
        "rays": rays,
        "cycles_per_ray": run.cycles / rays,
        "node_tests": count["node_tests"] / rays,
        "triangle_tests": count["triangle_tests"] / rays,
        "leaf_visits": count["leaf_visits"] / rays,
        **{f"golden_{name}": number / rays for name, number in golden.items()},
        "ratio": cycles / max(needed, 1),  # 1 is ideal
        **{
            f"{unit}_{state}": count[f"{unit}_{state}"] / cycles
            for unit in ("node", "triangle")
            for state in ("busy", "starved", "stalled")
        },
        **{f"{cache}_hits": _hit_rate(count, cache) for cache in ("node", "triangle")},
        "bytes_per_ray": run.beats * config.memory.axi_width / 8 / rays,
        "mismatches": different,
        "cycles_per_second": run.throughput,
    }


def _hit_rate(count: dict[str, int], cache: str) -> float:
    """The part of requests whose block was there."""
    hits = count[f"{cache}_hits"]
    return hits / max(hits + count[f"{cache}_misses"] + count[f"{cache}_merged"], 1)


def _run(
    config: Config, blocks: np.ndarray, queries: np.ndarray, **options: Any
) -> tuple[TraversalRun, int, np.ndarray]:
    """A run, the number of rays whose results differ from the golden model in any bit, and the golden COUNTS."""
    run = _unit(config, memory_bits(blocks)).run(blocks, queries, **options)
    expected, counts = trace_tree(blocks, queries, width=config.tree.width, stack=config.traversal.stack)
    return run, int((~bitpack.equal(run.results, expected)).sum()), counts


def _count_mismatches(run: TraversalRun, counts: np.ndarray) -> int:
    """How many of the counters differ from the sums of the golden COUNTS."""
    return sum(int(counts[name].sum()) != run.counters[name] for name in COUNTS.names or ())


def _config(sweep: Sweep, *, units: int = 1, **fields: Any) -> Config:
    """The preset with other parameters, and a tag with room for twice the rays that may be inside."""
    config = PRESETS[sweep.preset].but(units=units, **dict(sweep.settings) | fields)
    return config.but(tag_width=max(config.streams.tag_width, (2 * config.traversal.contexts * units - 1).bit_length()))


@lru_cache(maxsize=8)
def _unit(config: Config, bits: int) -> TraversalUnit:
    return TraversalUnit(config, memory_bits=bits)


@cache
def _triangles(scene: str) -> np.ndarray:
    return load_scene(scene).triangles


@lru_cache(maxsize=6)
def _tree(scene: str, width: int, levels: int) -> np.ndarray:
    return build_wide(_triangles(scene), width=width, max_levels=levels).blocks


@lru_cache(maxsize=2)
def _mixed_queries(scene: str, count: int) -> np.ndarray:
    """RAY_QUERY (count,): all families of rays, each in equal parts for the nearest hit and any hit, shuffled."""
    part = -(-count // (2 * len(RAY_FAMILIES)))
    queries = np.concatenate(
        [
            queries_of(family(_triangles(scene), part, SEED + number), any_hit=any_hit)
            for number, (family, any_hit) in enumerate(product(RAY_FAMILIES.values(), (False, True)))
        ]
    )
    assert queries.dtype == RAY_QUERY
    return queries[np.random.default_rng(SEED).permutation(len(queries))[:count]]

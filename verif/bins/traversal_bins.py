"""Functional bins of the traversal unit, out of rays with their results, the tree they went through, and counters."""

import numpy as np

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import LOAD_ERRORS, RAY_QUERY, TRACE_ERRORS, TRIANGLE_BLOCK, TRIANGLES_KIND
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.golden_model.tracing.wide_bvh.encode import WideBvh, tree_triangles
from lightloom.verif.bins.coverage import Groups, StreamCycles, cases

WITHIN_A_TEST = 150
"""So many rays of a run are looked at for equal distances, which takes a test of every triangle."""
PLACES = ("the only one of a leaf", "the first of two", "the second of two")


def ray_groups(queries: np.ndarray, results: np.ndarray, blocks: np.ndarray) -> Groups:
    """Of RAY_QUERY and RAY_RESULT (N,), with the tree uint32 (B, 16) that the rays went through."""
    assert queries.dtype == RAY_QUERY
    failed, invalid = results["error"] != 0, results["invalid"]
    hit = results["primitive"] >= 0
    miss = ~hit & ~failed & ~invalid
    front, any_hit, cull, mask = results["front"], queries["any_hit"], queries["cull"], queries["mask"]
    edge = hit & ((results["u"] == 0) | (results["v"] == 0) | (results["u"] + results["v"] == 1))
    nearest = edge & ~any_hit
    seen = {"hit": hit, "miss": miss, "failed": failed}
    return {
        "results": cases(
            nearest_front=hit & front & ~any_hit,
            nearest_back=hit & ~front & ~any_hit,
            any=hit & any_hit,
            on_an_edge=edge,
            miss=miss,
            invalid=invalid & ~failed,
            invalid_without_a_tree=invalid & failed,
            empty_range=miss & ~(queries["t_min"] < queries["t_max"]),
        ),
        **{
            what: {
                f"{faces}, {name}": int((mask & asked & (cull == culls)).sum())
                for faces, culls in (("both faces", False), ("culling", True))
                for name, mask in seen.items()
            }
            for what, asked in (("nearest hit", ~any_hit), ("any hit", any_hit))
        },
        "masks": cases(
            none=mask == 0, some_hit=hit & (mask != 255), some_miss=miss & (mask != 255) & (mask != 0), all=mask == 255
        ),
        "errors": {name: int((results["error"] == code).sum()) for name, code in TRACE_ERRORS.items()},
        "triangle that is hit": _places(results["primitive"][hit], blocks),
        "equal distances": {"the lower index is taken": _ties(queries[nearest], results[nearest], blocks)},
    }


def _places(primitive: np.ndarray, blocks: np.ndarray) -> dict[str, int]:
    """Where in its leaf each of the triangles lies."""
    leaves = bitpack.unpack(np.ascontiguousarray(blocks[1:]), TRIANGLE_BLOCK)
    leaves = leaves[leaves["kind"] == TRIANGLES_KIND]
    one, two = leaves[leaves["count"] == 1]["primitive"], leaves[leaves["count"] == 2]["primitive"]
    places = (one[:, 0], two[:, 0], two[:, 1])
    return {name: int(np.isin(primitive, found).sum()) for name, found in zip(PLACES, places, strict=True)}


def _ties(queries: np.ndarray, results: np.ndarray, blocks: np.ndarray) -> int:
    """Rays that meet another triangle at the same distance."""
    queries, results = queries[:WITHIN_A_TEST], results[:WITHIN_A_TEST]
    primitives, triangles, masks = tree_triangles(WideBvh(blocks))
    if not len(queries):
        return 0
    prepared = ray_setup(queries)
    shape = len(queries), len(triangles)
    tests = triangle_tests(
        np.repeat(prepared, shape[1]), np.tile(triangles, shape[0]), np.repeat(queries["cull"], shape[1])
    )
    found = ray_triangle(tests).reshape(shape)
    visible = (masks & queries["mask"][:, None]) != 0
    same = found["hit"] & visible & (found["t"] == results["t"][:, None])
    return int((same & (primitives > results["primitive"][:, None])).any(axis=1).sum())


def load_groups(error: str) -> Groups:
    """A tree was loaded, or refused because of `error`."""
    return {"trees": {("loaded" if name == "none" else f"refused: {name}"): int(name == error) for name in LOAD_ERRORS}}


def channel_groups(cycles: StreamCycles) -> Groups:
    """What the channels of addresses and data did. The unit has room for all that it asks for and never holds data."""
    return {
        group: {name: count for name, count in bins.items() if count or not _holds_data(group, name)}
        for group, bins in cycles.groups().items()
    }


def _holds_data(group: str, name: str) -> bool:
    return (group == "data" and "held" in name) or (group == "addresses and data" and name.endswith(", held"))


def counter_groups(counters: dict[str, int], lines: dict[str, int]) -> Groups:
    """What the unit has counted; and caches that gave up blocks, since they asked for more than they have `lines`."""
    return {
        "counted": counters,
        "runs in which blocks gave way": {
            f"{cache} cache": int(counters[f"{cache}_misses"] > number) for cache, number in lines.items()
        },
    }


def memory_groups(overtaken: int, mixed: int, most_under_way: int) -> Groups:
    """What the memory has done."""
    return {"memory": {"bursts overtaken": overtaken, "beats of bursts mixed": mixed, "several bursts": most_under_way}}

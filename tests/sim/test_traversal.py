"""The harness of the traversal unit, what it says of a unit that breaks the rules, and the unit in it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import BVH_MAGIC, RAY_QUERY, RAY_RESULT, TRACE_ERRORS, TRIANGLE
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import RAY_FAMILIES, diffuse_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import COUNTS, queries_of, trace_tree
from lightloom.rtl.config import PRESETS, Config
from lightloom.sim import toolchain
from lightloom.sim.traversal import TraversalError, TraversalUnit
from tests.golden_model import meshes
from tests.golden_model.tracing.test_watertight import Mesh

STAND_IN = Path(__file__).with_name("traversal_stand_in.v").read_text(encoding="utf-8")
SEED, COUNT, BLOCKS = 53, 5000, 300
STAND_IN_CONFIG = Config.of(tag_width=6)


@cache
def stand_in(original: str = "", mutant: str = "") -> TraversalUnit:
    """The stand-in, with one piece of its Verilog replaced."""
    assert not original or STAND_IN.count(original) == 1
    text = STAND_IN.replace(original, mutant) if original else STAND_IN
    return TraversalUnit(STAND_IN_CONFIG, memory_bits=16, verilog=text, level=0)


@cache
def tree() -> np.ndarray:
    blocks = np.random.default_rng(SEED).integers(0, 2**32, (BLOCKS, 16), dtype=np.uint32)
    blocks[0, 0] = BVH_MAGIC
    return blocks


@cache
def queries() -> np.ndarray:
    """Each asks the stand-in for a block."""
    out = np.zeros(COUNT, dtype=RAY_QUERY)
    out["origin"][:, 0] = np.random.default_rng(SEED).integers(0, BLOCKS, COUNT, dtype=np.uint32).view(np.float32)
    return out


def expected(blocks: np.ndarray, overlap: int = 4) -> np.ndarray:
    """What the stand-in answers."""
    wanted = queries()["origin"][:, 0].view(np.uint32)
    out = np.zeros(COUNT, dtype=RAY_RESULT)
    out["primitive"] = blocks[wanted, 0].view(np.int32)
    for k, name in enumerate(("t", "u")):
        out[name] = blocks[wanted, k + 1].view(np.float32)
    out["v"], out["block"], out["front"] = wanted.view(np.float32), wanted, overlap % 2 == 1
    return out


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"latency": 0, "overlap": 3},
        {"latency": 400, "reorder": 100, "interleave": True, "memory_stall": 64, "stall_seed": 1},
        {"latency": 10, "reorder": 128, "stall_seed": 2**63 - 1, "base": 64},
    ],
)
def test_results_come_in_the_order_of_the_rays(options: dict) -> None:
    run = stand_in().run(tree(), queries(), **options)
    assert bitpack.equal(run.results, expected(tree(), options.get("overlap", 4))).all()
    assert run.counters == {"rays": COUNT, "node_tests": COUNT, "leaf_visits": 0}
    assert (run.bursts, run.beats, run.load_error) == (COUNT, COUNT, 0)
    assert run.throughput > 0


def test_cycles() -> None:
    """The stand-in has as many rays under way as there are tags."""
    for latency in (20, 200):
        run = stand_in().run(tree(), queries(), latency=latency)
        period = max(1.0, (latency + 2) / 64)
        assert period * COUNT <= run.cycles <= 1.1 * period * COUNT + latency + 10
        assert run.most_in_flight <= 64
    assert run.most_in_flight == 64
    # Half of the beats take twice as long.
    assert 1.99 * COUNT < stand_in().run(tree(), queries(), latency=1, bandwidth=128).cycles < 2.01 * COUNT


def test_blocks_that_cannot_be_read() -> None:
    run = stand_in().run(tree(), queries(), bad_blocks=(7, 9))
    wanted = queries()["origin"][:, 0].view(np.uint32)
    assert (run.results["error"] == np.isin(wanted, (7, 8, 9))).all()
    assert run.results["error"].any()


def test_a_tree_that_is_refused_is_told() -> None:
    blocks = tree().copy()
    blocks[0, 0] += 1
    run = stand_in().run(blocks, queries())
    assert run.load_error == 2
    assert bitpack.equal(run.results, expected(blocks)).all()


def test_no_rays() -> None:
    run = stand_in().run(tree(), queries()[:0])
    assert (len(run.results), run.cycles) == (0, 0)


def test_what_cannot_be_run_is_refused() -> None:
    with pytest.raises(InputError, match="19,200 bytes at 60,000 is more than the simulated memory holds, 65,536"):
        stand_in().run(tree(), queries(), base=60_000)
    with pytest.raises(TypeError, match="RAY_QUERY"):
        stand_in().run(tree(), np.zeros(3, dtype=np.float32))
    with pytest.raises(ValueError, match="stall_seed"):
        stand_in().run(tree(), queries(), stall_seed=0)


@pytest.mark.parametrize(
    ("original", "mutant", "message"),
    [
        ("out_tag = m_axi_rid[5:0]", "out_tag = ~m_axi_rid[5:0]", "a result whose tag no operand has"),
        ("m_axi_rready = o__ready || header", "m_axi_rready = 1", "hangs: no operand, result"),
        ("o__valid = m_axi_rvalid && !header", "o__valid = !header && state == 3", "a result whose tag no operand has"),
        ("? 3 : 4;", "? 0 : 0;", "hangs: it does not load"),
        (
            "m_axi_arsize = 6",
            "m_axi_arsize = 7",
            "a rule of AXI is broken; ar_size: .*asked for more bytes",
        ),
        ("else if (m_axi_arready) asks <= 0;", "else asks <= 0;", "hangs|withdrew arvalid"),
    ],
    ids=["tag", "lost", "made up", "no tree", "rule", "withdrawn"],
)
def test_a_unit_that_breaks_the_rules_is_an_error(original: str, mutant: str, message: str) -> None:
    with pytest.raises(TraversalError, match=message):
        stand_in(original, mutant).run(tree(), queries()[:200], stall_seed=5, memory_stall=64)


def test_a_simulator_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in()

    def build(*_: object, **__: object) -> str:
        raise AssertionError("built again")

    monkeypatch.setattr(toolchain, "run", build)
    TraversalUnit(STAND_IN_CONFIG, memory_bits=16, verilog=STAND_IN, level=0)


# --- the unit itself ------------------------------------------------------------------------------------------------


@cache
def unit() -> TraversalUnit:
    return TraversalUnit(PRESETS["base"], level=1)


@cache
def box() -> np.ndarray:
    return build_wide(load_scene("cornell-box").triangles).blocks


@cache
def all_families(part: int = 400) -> np.ndarray:
    """An equal part of each family, for the nearest hit and for any hit, with random masks, some culled."""
    rng = np.random.default_rng(SEED)
    triangles = load_scene("cornell-box").triangles
    rays = np.concatenate([family(triangles, part, SEED + k) for k, family in enumerate(RAY_FAMILIES.values())])
    rays = np.concatenate([rays, rays])
    mask = rng.choice(np.array([0xFF, 0x01, 0x80, 0], dtype=np.uint8), len(rays), p=[0.85, 0.05, 0.05, 0.05])
    out = queries_of(rays, any_hit=np.arange(len(rays)) >= len(rays) // 2, cull=rng.random(len(rays)) < 0.25, mask=mask)
    return out[rng.permutation(len(out))]


def compare(results: np.ndarray, want: np.ndarray) -> None:
    wrong = np.flatnonzero(~bitpack.equal(results, want))
    assert not len(wrong), (
        f"seed {SEED}, ray {wrong[0]}: {all_families()[wrong[0]]}: {results[wrong[0]]} {want[wrong[0]]}"
    )


@pytest.mark.parametrize(
    "options",
    [
        {"overlap": 1},
        {"latency": 0},
        {"latency": 40, "reorder": 100, "interleave": True, "memory_stall": 64, "stall_seed": SEED},
        {"overlap": 2, "latency": 10, "bandwidth": 40, "seed": 7, "base": 1 << 26},
    ],
)
def test_the_unit_gives_the_golden_results(options: dict) -> None:
    run = unit().run(box(), all_families(), **options)
    want, counts = trace_tree(box(), all_families())
    compare(run.results, want)
    assert run.counters["rays"] == len(all_families())
    assert (run.beats, run.load_error) == (run.counters["beats"], 0)
    # More visits at a time may be in vain, and no fewer are made.
    for name in COUNTS.names or ():
        golden = int(counts[name].sum())
        assert golden == run.counters[name] if options.get("overlap") == 1 else golden <= run.counters[name], name


def test_errors_are_the_golden_models() -> None:
    """Blocks that cannot be read, and blocks that are wrong."""
    blocks = box().copy()
    blocks[11, 0] ^= 3
    run = unit().run(blocks, all_families(), bad_blocks=(5, 6), overlap=1)
    want, _ = trace_tree(blocks, all_families(), bad_blocks=(5, 6))
    compare(run.results, want)
    assert {TRACE_ERRORS[name] for name in ("none", "memory", "kind")} == set(run.results["error"])
    assert run.counters["errors"] == (run.results["error"] != 0).sum()
    blocks[0, 3] ^= 1
    run = unit().run(blocks, all_families())
    compare(run.results, trace_tree(blocks, all_families())[0])
    assert run.load_error != 0
    assert (run.results["error"] == TRACE_ERRORS["header"]).all()


def test_a_scene_without_triangles() -> None:
    blocks = build_wide(load_scene("cornell-box").triangles[:0]).blocks
    run = unit().run(blocks, all_families())
    assert bitpack.equal(run.results, trace_tree(blocks, all_families())[0]).all()
    assert (run.results["primitive"] == -1).all()


def test_memory_is_hidden_by_other_rays() -> None:
    """Where everything is in the caches, the latency of the memory costs a few first blocks."""
    queries = queries_of(RAY_FAMILIES["diffuse"](load_scene("cornell-box").triangles, 4000, SEED))
    cycles = {latency: unit().run(box(), queries, latency=latency).cycles for latency in (0, 200)}
    assert cycles[200] < 1.1 * cycles[0] + 1000


def test_every_ray_that_must_hit_a_watertight_mesh_does() -> None:
    """Rays at vertices, edges and faces of closed meshes and height fields, through the whole unit: 21,600."""
    for shape, size in [("sphere", 4), ("torus", 64), ("height field", 64)]:
        for turned in (False, True):
            mesh = Mesh(shape, size, turned)
            rays, by = mesh.rays(3600)
            blocks = build_wide(mesh.bvh.triangles).blocks
            results = unit().run(blocks, queries_of(rays)).results
            leaks = np.flatnonzero((results["primitive"] < 0) | (results["t"] > by * 1.001))
            assert not len(leaks), f"{shape}, turned {turned}: {len(leaks)} rays, the first is {rays[leaks[0]]}"
            assert bitpack.equal(results, trace_tree(blocks, queries_of(rays))[0]).all()


def test_stacks_that_are_read_and_written_all_the_time() -> None:
    """Many rays on a scene that needs deep stacks, at a latency where visits of a ray often come back together."""
    triangles = meshes.bunny()
    blocks = build_wide(triangles).blocks
    queries = queries_of(diffuse_rays(triangles, 20_000, SEED))
    results = unit().run(blocks, queries, latency=30).results
    wrong = np.flatnonzero(~bitpack.equal(results, trace_tree(blocks, queries)[0]))
    assert not len(wrong), f"seed {SEED}: {len(wrong)} rays differ, the first is {queries[wrong[0]]}"


def soup(count: int, size: float) -> np.ndarray:
    """TRIANGLE (count,) in a cube; their corners lie so far from their centres."""
    rng = np.random.default_rng(SEED)
    triangles = np.zeros(count, TRIANGLE)
    centre = rng.random((count, 3), np.float32)
    for name in ("v0", "v1", "v2"):
        triangles[name] = centre + rng.normal(scale=size, size=(count, 3)).astype(np.float32)
    return triangles


@pytest.mark.parametrize("busy", ["leaf_visits", "node_tests"])
def test_hardly_a_visit_is_needless_where_a_test_is_busy(busy: str) -> None:
    """What waits in front of the blocks of one test keeps rays from running ahead, though the other one has no work."""
    triangles = load_scene("cornell-box").triangles if busy == "leaf_visits" else soup(5000, 0.01)
    blocks = build_wide(triangles).blocks
    queries = queries_of(diffuse_rays(triangles, 1500, SEED))
    golden, counts = trace_tree(blocks, queries)
    run = unit().run(blocks, queries, latency=20)
    assert bitpack.equal(run.results, golden).all()
    assert run.counters[busy] < 1.005 * counts[busy].sum()


def test_visits_that_wait_keep_to_their_own_rays() -> None:
    """Triangles that overlap: nodes leave long lists, and while one is written, the node stage stops with visits of
    other rays in it, whose distances must stay theirs. Half of the rays are short, the others meet little."""
    triangles = soup(600, 0.3)
    seen_by_long = np.random.default_rng(SEED + 1).random(len(triangles)) < 0.06
    blocks = build_wide(triangles, masks=np.where(seen_by_long, 1, 2).astype(np.uint8)).blocks
    rays = diffuse_rays(triangles, 3000, SEED)
    short = np.arange(len(rays)) % 2 == 0
    rays["t_max"][short] = 0.05
    queries = queries_of(rays, mask=np.where(short, 0xFF, 1).astype(np.uint8))
    run = unit().run(blocks, queries, latency=0)
    wrong = np.flatnonzero(~bitpack.equal(run.results, trace_tree(blocks, queries)[0]))
    assert not len(wrong), f"seed {SEED}: {len(wrong)} rays differ, the first is {queries[wrong[0]]}"
    assert run.counters["node_stalled"] > 0.03 * run.cycles

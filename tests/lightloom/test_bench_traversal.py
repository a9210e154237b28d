"""`lightloom bench traversal`: what it measures, the page made of it. The simulator is the base preset's."""

import json
import re
from dataclasses import replace

import pytest

from lightloom.bench.traversal import CONDITIONS, SEED, Sweep, command_of, default_sweep, measure
from lightloom.bench.traversal_page import page, tables
from lightloom.commands.bench import NUMBERS, SETTABLE
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import diffuse_rays
from lightloom.golden_model.tracing.wide_bvh.encode import build_wide
from lightloom.golden_model.tracing.wide_bvh.traversal import queries_of
from lightloom.rtl.config import PARAMETERS, PLACES, PRESETS, Config
from lightloom.sim.traversal import TraversalUnit

from .conftest import Run

SMALL = Sweep(scenes=("cornell-box",), latencies=(0, 100), rays=600, identity_rays=400, box_pairs=2000)

SAME = {name: getattr(default_sweep(False), name) for name in ("identity_rays", "box_pairs")}
"""What has no option."""

pytestmark = pytest.mark.usefixtures("quickly_built")


@pytest.mark.long
def test_measured(cli: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lightloom.bench.traversal.default_sweep", lambda full: replace(SMALL, units=(1,)))
    outcome = cli("bench", "traversal", "--latency", "0,50", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    measured = report["traversal"]
    assert report["results"] == []
    assert [row["latency"] for row in measured["speed"]] == [0, 50]
    assert [row["condition"] for row in measured["identity"]] == list(CONDITIONS)
    assert [row["mismatches"] for name in ("speed", "units", "identity") for row in measured[name]] == [0] * 6
    assert measured["identity"][0]["count_mismatches"] == 0
    for row in measured["speed"]:
        assert row["node_tests"] > 1
        assert row["ratio"] >= 1
        needed = max(row["golden_node_tests"], row["golden_triangle_tests"])
        assert row["cycles_per_ray"] == pytest.approx(row["ratio"] * needed, rel=1e-9)
        for name in ("node_tests", "triangle_tests"):
            assert row[f"golden_{name}"] <= row[name]
        for unit in ("node", "triangle"):
            parts = sum(row[f"{unit}_{state}"] for state in ("busy", "starved", "stalled"))
            assert parts == pytest.approx(1, abs=0.05)
        assert 0 < row["node_hits"] <= 1
        assert row["bytes_per_ray"] > 0
    assert all(row["false_rejects"] == 0 for row in measured["boxes"])
    text = page([report])
    for title, columns, rows in tables(measured):
        assert f"## {title}\n\n| {' | '.join(columns)} |\n" in text
        assert len(rows) in (1, 2, len(measured["boxes"]))


@pytest.mark.parametrize("latency", [0, 100])
def test_running_ahead_does_not_slow_the_cornell_box(latency: int) -> None:
    """Its triangle test is always busy, so that visits which turn out to be needless would cost time."""
    config = PRESETS["base"].but(tag_width=8)
    triangles = load_scene("cornell-box").triangles
    blocks, queries = build_wide(triangles).blocks, queries_of(diffuse_rays(triangles, 4000, SEED))
    unit = TraversalUnit(config, level=1)
    most = config.traversal.overlap
    one, several = (unit.run(blocks, queries, overlap=overlap, latency=latency) for overlap in (1, most))
    assert several.cycles <= 1.01 * one.cycles


def test_a_page_of_two_reports() -> None:
    row = {"scene": "room", "width": 8, "condition": "any", "rays": 5, "mismatches": 0, "count_mismatches": 0}
    row |= {"cycles_per_ray": 1.0, "node_tests": 1.0, "revisits": 0.0}
    report = {"machine": {"processor": "any"}}
    empty: dict[str, object] = {"speed": [], "units": [], "boxes": []}
    parts = [{"command": f"run {scene}", "identity": [row | {"scene": scene}], **empty} for scene in ("hall", "room")]
    versions: list[dict[str, str]] = [{"commit": "0123456789"}, {}]
    text = page([report | {"traversal": part, "versions": v} for part, v in zip(parts, versions, strict=True)])
    assert "```\n# at 0123456789\nrun hall\n# at a commit that was not recorded\nrun room\n```\n" in text
    assert text.index("| hall | 8 |") < text.index("| room | 8 |")


def test_the_command_of_a_sweep(cli: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """It asks for the same sweep."""
    asked: list[Sweep] = []

    def record(sweep: Sweep, advance: object) -> dict[str, object]:
        asked.append(sweep)
        return {"command": "", "speed": [], "units": [], "identity": [], "boxes": []}

    monkeypatch.setattr("lightloom.bench.traversal.measure", record)
    sweep = Sweep(scenes=("a", "b"), preset="tiny", widths=(4,), contexts=(16, 8), latencies=(7,), units=(1, 4), rays=5)
    cached = replace(SMALL, settings=(("node_sets", 128), ("multiplier_blocks", True)), **SAME)
    for wanted in (sweep, cached, default_sweep(False), default_sweep(True), replace(default_sweep(True), widths=(8,))):
        assert cli(*command_of(wanted).split()[1:]).code == 0
        assert asked.pop() == wanted


def test_runs_are_what_the_progress_counts() -> None:
    done: list[float] = []
    measure(replace(SMALL, latencies=(10,)), done.append)
    assert sum(done) == replace(SMALL, latencies=(10,)).runs


def test_the_full_sweep_has_all_that_the_quick_one_has() -> None:
    quick, full = default_sweep(False), default_sweep(True)
    for name in ("scenes", "widths", "contexts", "latencies", "units"):
        assert set(getattr(quick, name)) <= set(getattr(full, name))
    assert full.identity_rays >= 100_000


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--width", "5"], ["--width 5", "4 or 8"]),
        (["--contexts", "64,7"], ["--contexts 64,7", "7 is not possible", "a power of two, 2 to 256"]),
        (["--units", "0"], ["--units 0", "1 to 16"]),
        (["--latency", "fast"], ["--latency fast", "whole numbers"]),
        (["--preset", "bass"], ["preset 'bass'", "base"]),
        (["--set", "node_sets"], ["--set node_sets", "node_sets=128"]),
        (["--set", "node_sets=many"], ["--set node_sets=many", "a power of two, 2 to 1024"]),
        (["--set", "node_sets=7"], ["--set node_sets=7", "a power of two, 2 to 1024"]),
        (["--set", "stack=0"], ["--set stack=0: stack 0: must be 4 to 64"]),
        (["--set", "multiplier_blocks=2"], ["multiplier_blocks 2: must be False or True"]),
        (["--set", "tag_width=8"], ["--set tag_width=8: tag_width is not to be set"]),
        (["--set", "texel_blend_interval=4"], ["--set texel_blend_interval=4", "`traversal` does not depend on"]),
        (["--set", "stack=8", "--set", "stack=16"], ["--set stack", "2 times"]),
        (["--set", "node_set=8"], ["parameter 'node_set'", "node_sets"]),
        (["--rays", "0"], ["--rays 0", "at least 1"]),
        (["--scene", "no-such-scene.obj"], ["no-such-scene.obj"]),
    ],
)
def test_bad_options(cli: Run, options: list[str], words: list[str]) -> None:
    cli("bench", "traversal", *options).refused(*words)


@pytest.mark.parametrize("name", NUMBERS)
def test_what_has_an_option_of_its_own_is_no_setting(cli: Run, name: str) -> None:
    cli("bench", "traversal", "--set", f"{name}=8").refused(f"--set {name}=8", f"give it as --{name} 8")
    cli("bench", "traversal", "--set", name).refused(f"--set {name}:", f"give it as --{name}")


@pytest.mark.parametrize(
    "option",
    ["--width 4", "--contexts 8", "--latency 3", "--units 2", "--scene a", "--preset tiny", "--set stack=8", "--full"],
)
def test_options_of_another_benchmark(cli: Run, option: str) -> None:
    """They would say nothing."""
    cli("bench", "tracing", *option.split()).refused(option.split()[0], "traversal")


def test_hardware_that_cannot_be(cli: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever a parameter is refused, it is bad input."""

    def measure(sweep: Sweep, advance: object) -> dict[str, object]:
        Config.of(contexts=12)
        return {}

    monkeypatch.setattr("lightloom.bench.traversal.measure", measure)
    cli("bench", "traversal").refused("contexts 12: must be a power of two, 2 to 256")


def test_the_help_has_every_range(cli: Run) -> None:
    shown = cli("bench", "--help").out
    for name, each in PARAMETERS.items():
        if name in SETTABLE:
            assert re.search(rf"^ *{name} +{re.escape(each.allowed)}$", shown, re.MULTILINE), name
    others = {name for name, (block, _) in PLACES.items() if block == "texel"}
    assert {*PARAMETERS} - {*SETTABLE} == {"tag_width", "width", "contexts", "units"} | others
    assert not [name for name in others if name in shown]

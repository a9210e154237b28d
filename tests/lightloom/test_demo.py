"""The whole chain in small, its report page, and what happens when the Verilog is wrong."""

import html.parser
import json
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.stimuli.ray_families import diffuse_rays
from lightloom.golden_model.tracing.ray_setup import ray_setup
from lightloom.golden_model.tracing.ray_triangle import ray_triangle, triangle_tests
from lightloom.hardware import replay as replay_module
from lightloom.hardware.replay import replay
from lightloom.render.sequence import looped, shown_lightmaps
from lightloom.sim.bulk import BulkUnit

from .conftest import Run, files_below

TINY = ("--frames", 4, "--size", "16x12", "--budget", 3000, "--replay-limit", 5000)


class Broken:
    """A unit that is wrong in one bit of some results."""

    throughput = 1e6
    cycles = 1

    def __init__(self, *_: object) -> None:
        pass

    def run(self, operands: np.ndarray) -> np.ndarray:
        results = ray_triangle(operands)
        hits = np.flatnonzero(results["hit"])
        results["u"].view(np.uint32)[hits[1]] ^= 1
        results["front"][hits[2]] ^= True
        return results


def some_tests(count: int) -> np.ndarray:
    triangles = load_scene("cornell-box").triangles
    index = np.random.default_rng(3).integers(0, len(triangles), count)
    return triangle_tests(ray_setup(diffuse_rays(triangles, count, seed=3)), triangles[index])


class Page(html.parser.HTMLParser):
    """Collects what a page refers to, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_data(self, data: str) -> None:
        self.text += data


def page_of(folder: Path) -> Page:
    page = Page()
    page.feed((folder / "report.html").read_text(encoding="utf-8"))
    page.close()
    return page


@pytest.mark.usefixtures("quick_verilog", "coarse_cornell_box")
def test_demo(cli: Run, tmp_path: Path) -> None:
    outcome = cli("demo", *TINY, "--out", tmp_path / "demo", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    assert report == json.loads((tmp_path / "demo" / "report.json").read_text())
    assert (report["replayed"], report["mismatches"]) == (5000, 0)
    assert report["tests"] > 5000
    assert report["sampled"]
    assert len(report["render"]["frames"]) == 4
    assert report["versions"]["numpy"] == np.__version__
    expected = {
        "contact-sheet.png",
        "film.webp",
        "report.html",
        "verilog/float_compare.v",
        "verilog/float_compare.json",
    }
    expected |= {f"frames/000{k}.png" for k in range(4)}
    expected |= {f"lightmap/000{k}.{kind}" for k in (0, 1, 3) for kind in ("png", "exr")}
    assert expected <= files_below(tmp_path / "demo")

    page = page_of(tmp_path / "demo")
    assert all(link.startswith("data:image/") for link in page.links)
    assert len(page.links) == 1 + 4 + 3
    assert not {"script", "link", "iframe"} & set(page.tags)
    for figure in ("5,000", f"{report['tests']:,}", "float_compare", report["command"]):
        assert figure in page.text


@pytest.mark.usefixtures("quick_verilog", "coarse_cornell_box")
def test_demo_with_wrong_verilog(cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lightloom.sim.bulk.BulkUnit", Broken)
    outcome = cli("demo", *TINY, "--out", tmp_path / "demo")
    assert outcome.code == 1
    report = json.loads((tmp_path / "demo" / "report.json").read_text())
    assert report["mismatches"] == 2
    assert report["replay"]["differing_bits"] == {"t": 0, "u": 1, "v": 0, "hit": 0, "front": 1}
    wrong = report["replay"]["examples"][0]
    for side in ("golden_model", "verilog"):
        assert f"u {wrong[side]['u']}" in outcome.out
    text = page_of(tmp_path / "demo").text
    assert wrong["golden_model"]["u"] in text
    assert wrong["verilog"]["u"] in text


def test_replay_lists_mismatches_in_hex(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_module, "CHUNK", 1000)
    tests = some_tests(2500)
    steps: list[float] = []
    outcome = replay("ray_triangle", tests, Broken(), steps.append)
    assert steps == [1000, 1000, 500]
    assert (outcome.replayed, outcome.mismatches) == (2500, 6)
    assert (outcome.differing_bits["u"], outcome.differing_bits["front"], outcome.differing_bits["t"]) == (3, 3, 0)
    want = ray_triangle(tests)
    assert outcome.hits == int(want["hit"].sum())
    for example in outcome.examples:
        at = example["number"]
        assert example["golden_model"]["u"] == f"{want['u'].view(np.uint32)[at]:08X}"
        assert example["operands"]["v0"] == " ".join(f"{x:08X}" for x in tests["v0"].view(np.uint32)[at])
        assert example["verilog"] != example["golden_model"]


def test_replay_through_the_verilog() -> None:
    tests = some_tests(3000)
    outcome = replay("ray_triangle", tests, BulkUnit("ray_triangle"), lambda steps: None)
    assert (outcome.replayed, outcome.mismatches, outcome.examples) == (3000, 0, [])
    assert outcome.hits > 50
    assert outcome.cycles >= 3000
    assert bitpack.equal(tests, some_tests(3000)).all()


def test_looped_camera_path() -> None:
    scene = load_scene("cornell-box")
    short = looped(scene, 12)
    assert [key.frame for key in short.camera_path] == [0, 3, 6, 9, 12]
    np.testing.assert_array_equal(short.camera_at(6).position, scene.camera_at(60).position)
    assert looped(scene, 1).camera_at(0).position.shape == (3,)


@pytest.mark.parametrize(("frames", "shown"), [(1, [0]), (2, [0, 1]), (8, [0, 1, 3, 7]), (30, [0, 1, 3, 7, 15, 29])])
def test_shown_lightmaps(frames: int, shown: list[int]) -> None:
    assert shown_lightmaps(frames) == shown

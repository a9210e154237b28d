"""Policies compared: the measures, what is compared and shown, and the whole command in small."""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import GBUFFER, TEXEL_STATE
from lightloom.golden_model.engine.selection.policy import POLICIES, Policy
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.tables.lightmap import EMPTY, VALID
from lightloom.policies.judge import counted_pixels, darkened, error, flip, straight_light, visible_texels
from lightloom.policies.options import Comparison
from lightloom.policies.parameters import changed_parameters, parameters
from lightloom.policies.report import budget_shares, few_counted, frames_a_turn, summary
from lightloom.render.policy_pictures import (
    ERROR_RANGE,
    QUANTITIES,
    UNKNOWN_AGE,
    ages,
    error_colours,
    error_legend,
    legend,
    relative_error,
)

from .conftest import LAMP, ROOM, Run, files_below

BEHIND = """
[[quad]]
name = "behind the camera"
corners = [[-2, 0, 6], [-2, 3, 6], [2, 3, 6], [2, 0, 6]]
"""
ABOVE = """
[[quad]]
name = "lamp"
corners = [[-0.8, 1.4, -1.5], [-0.8, 0.5, -1.5], [0.8, 0.5, -1.5], [0.8, 1.4, -1.5]]
emission = [5, 5, 5]
[[quad]]
name = "panel"
corners = [[-1, 0.1, 1.5], [1, 0.1, 1.5], [1, 0.1, -0.5], [-1, 0.1, -0.5]]
material = "{surface}"
"""
WINDOW = """
[[quad]]
name = "before the eye"
corners = [[-9, -9, 3.5], [9, -9, 3.5], [9, 9, 3.5], [-9, 9, 3.5]]
emission = [5, 5, 5]
"""
GLASS = """
[[sphere]]
center = [0, 1, 1]
radius = 0.6
subdivisions = 2
material = "glass"
"""
TINY = (
    "--frames",
    4,
    "--size",
    "24x24",
    "--budget",
    1000,
    "--reference-rays",
    8,
    "--reference-every",
    2,
    "--backend",
    "numpy",
)


# --- measures -------------------------------------------------------------------------------------------------------


def test_error_is_the_sum_of_departures_over_the_sum_of_the_reference() -> None:
    reference = np.array([[[1, 2, 3], [4, 0, 0]]], dtype=np.float32)
    image = reference + np.array([[[1, 0, -1], [0, 0, 3]]], dtype=np.float32)
    assert error(image, reference) == pytest.approx(5 / 10)
    assert error(reference, reference) == 0
    assert error(image, np.zeros_like(reference)) is None
    image[0, 0, 0] = np.nan  # counts in neither sum
    assert error(image, reference) == pytest.approx(4 / 9)


def test_darkened_pixels_are_below_a_quarter_of_both() -> None:
    before = np.array([[4, 4, 0.5, 4, 4]], dtype=np.float32)
    wanted = np.array([[4, 0.5, 4, 4, 4]], dtype=np.float32)
    shown = np.array([[0.9, 0.9, 0.9, 1.0, 0.0]], dtype=np.float32)
    straight = np.full((1, 5, 3), 0.25, dtype=np.float32)
    pictures = [np.repeat(each[..., None], 3, axis=2) for each in (shown, before, wanted)]
    every = np.ones((1, 5), dtype=bool)
    assert darkened(pictures[0] + straight, pictures[1], straight, pictures[2], every) == 2 / 5
    first = np.array([[True, True, False, False, False]])
    assert darkened(pictures[0] + straight, pictures[1], straight, pictures[2], first) == 1 / 2
    assert darkened(pictures[0] + straight, pictures[1], straight, pictures[2], ~every) == 0


def test_shares_of_the_budget() -> None:
    """The least counts where the budget pays for 20 updates, and for no more than all texels."""
    frames = [{"spent": 96}, {"spent": 101}]
    assert budget_shares(frames, 100, 5, 20) == {"least_share": 0.96, "greatest_share": 1.01}
    assert budget_shares(frames, 100, 5, 19)["least_share"] is None
    assert budget_shares(frames, 100, 6, 1000)["least_share"] is None
    options = Comparison(budget=100, directions=16, light_samples=4)
    assert frames_a_turn(50, options) == 10
    assert frames_a_turn(0, options) > 0


def test_relative_error_has_a_sign_and_a_floor() -> None:
    reference = np.ones((1, 4, 3), dtype=np.float32)
    reference[0, 3] = 0
    image = reference * np.array([0.5, 1, 1.5, 0], dtype=np.float32)[None, :, None]
    image[0, 3] = 0.01
    every = np.ones((1, 4), dtype=bool)
    found = relative_error(image, reference, every)[0]
    assert found[:3] == pytest.approx([-0.5, 0, 0.5])
    assert found[3] == pytest.approx(0.01 / (0.05 * 0.75))
    assert not relative_error(image, np.zeros_like(reference), every).any()
    assert not relative_error(image, reference, ~every).any()
    # A lamp raises no floor.
    lamp = np.full((1, 1, 3), 1000, dtype=np.float32)
    shown, wanted = (np.concatenate([picture, lamp], axis=1) for picture in (image, reference))
    assert relative_error(shown, wanted, np.array([[True] * 4 + [False]]))[0].tolist() == [*found, 0]


def test_colours_of_errors_tell_the_sign_and_grow_lighter() -> None:
    dark, little_dark, none, little_bright, bright = error_colours(np.array([-9, -0.1, 0, 0.1, 9])).astype(int)
    assert dark[2] > dark[0]
    assert little_dark[2] > little_dark[0]
    assert bright[0] > bright[2]
    assert little_bright[0] > little_bright[2]
    assert none.sum() < min(little_dark.sum(), little_bright.sum())
    assert little_dark.sum() < dark.sum()
    ends = error_colours(np.array([-ERROR_RANGE, ERROR_RANGE]))
    assert [error_legend()[0], error_legend()[-1]] == ["#" + bytes(end).hex() for end in ends]


def test_ages_count_across_the_turn_of_the_frame_number() -> None:
    state = np.zeros(3, dtype=TEXEL_STATE)
    state["count"] = [1, 5, 0]
    state["frame"] = [65530, 3, 3]
    assert list(ages(state, 65540)) == [10, 1, UNKNOWN_AGE]


def test_visible_texels_are_those_that_pixels_read_in_the_end() -> None:
    from lightloom.golden_model.charts.unwrap import unwrap

    lightmaps = unwrap(replace(load_scene("cornell-box"), texel_size=100.0))
    texel = int(np.flatnonzero(lightmaps.texels["state"] == VALID)[0])
    owner = int(lightmaps.texels["object"][texel])
    row, column = divmod(texel - int(lightmaps.offset[owner]), int(lightmaps.width[owner]))
    gbuffer = np.zeros((1, 3), dtype=GBUFFER)
    gbuffer["object"], gbuffer["front"] = -1, True
    assert len(visible_texels(lightmaps, gbuffer)) == 0
    # The middle of a texel reads it alone; its back reads nothing.
    gbuffer["object"][0, :2] = owner
    gbuffer["lightmap"][0] = column + 0.5, row + 0.5
    gbuffer["front"][0, 1] = False
    assert list(visible_texels(lightmaps, gbuffer)) == [texel]
    # Where a texel is empty, the one that is shown in its place is read.
    empty = np.flatnonzero((lightmaps.texels["state"] == EMPTY) & (lightmaps.fill >= 0))
    other = int(empty[0])
    owner = int(np.searchsorted(lightmaps.offset, other, side="right")) - 1
    row, column = divmod(other - int(lightmaps.offset[owner]), int(lightmaps.width[owner]))
    gbuffer["object"][0, 0] = owner
    gbuffer["lightmap"][0, 0] = column + 0.5, row + 0.5
    assert list(visible_texels(lightmaps, gbuffer)) == [int(lightmaps.fill[other])]


def test_summary_takes_means_of_what_there_is() -> None:
    frame: dict[str, Any] = {"texels": 10, "on_visible": 0.5, "unknown": 0.0, "seconds": 1.0}
    frames = [
        frame
        | {
            "rays": {"a": 5, "visibility": 0},
            "spent": 5,
            "age": None,
            "oldest": None,
            "error": 0.1,
            "relative_mse": 1.0,
        },
        frame | {"rays": {"a": 7, "visibility": 2}, "spent": 9, "age": 3.0, "oldest": 8},
        frame
        | {"rays": {"a": 3, "visibility": 1}, "spent": 4, "age": 5.0, "oldest": 6, "error": 0.3, "relative_mse": None},
    ]
    found = summary(frames, 8)
    assert (found["error"], found["worst_error"]) == (pytest.approx(0.2), 0.3)
    assert (found["relative_mse"], found["flip"]) == (1.0, None)
    assert (found["age"], found["oldest"]) == (4.0, 8)
    assert (found["rays"], found["deciding"]) == ({"a": 5.0, "visibility": 1.0}, 1.0)
    assert (found["largest_spent"], found["within_budget"]) == (9, False)
    assert summary(frames, 9)["within_budget"]


def test_the_picture_that_a_frame_is_compared_with_differs_by_the_maps_alone(tmp_path: Path) -> None:
    path = tmp_path / "glass.toml"
    path.write_text(ROOM + LAMP + GLASS)
    renderer = Renderer(load_scene(path), width=24, height=16, budget=2000)
    for _ in range(2):
        result = renderer.frame()
        assert result.counts.fragment_rays.total > 0  # rays with random numbers of their own
        np.testing.assert_array_equal(renderer.picture(result, result.lightmap), result.image)


@pytest.mark.parametrize("surface", ["diffuse", "mirror", "glass"])
def test_pixels_that_show_an_emitter_count_in_no_measure(tmp_path: Path, surface: str) -> None:
    path = tmp_path / "lamp.toml"
    path.write_text(ROOM + ABOVE.format(surface=surface))
    scene = load_scene(path)
    renderer = Renderer(scene, width=48, height=40, budget=2000)
    result = renderer.frame()
    counted = counted_pixels(straight_light(renderer, result), result.image)
    seen = result.gbuffer["primitive"]
    names = np.array([*scene.object_names, "nothing"])[np.where(seen >= 0, scene.object_id[seen], -1)]
    lamp = names == "lamp"
    assert lamp.sum() > 50
    assert not counted[lamp & result.gbuffer["front"]].any()
    assert counted[(names == "floor") | (names == "wall") | (names == "nothing")].all()
    panel = counted[names == "panel"]
    assert panel.size > 50
    assert panel.all() == (surface == "diffuse"), "a mirror and glass show the lamp"
    assert panel.any(), "but not everywhere"
    # What is wrong in every other pixel is not made small by what cannot be wrong.
    reference = result.image
    image = np.where(lamp[..., None], reference, reference * np.float32(1.25))
    assert error(image[counted], reference[counted]) == pytest.approx(0.25)
    assert (error(image, reference) or 0) < 0.2
    shown, wanted = (np.minimum(255 * picture, 255).astype(np.uint8) for picture in (image, reference))
    inside, outside, whole = (flip(shown, wanted, part) for part in (counted, ~counted, np.ones_like(counted)))
    assert whole == pytest.approx((inside or 0) * counted.mean() + (outside or 0) * (~counted).mean())
    assert inside != outside
    assert flip(shown, wanted, np.zeros_like(counted)) is None


# --- what is compared and shown -------------------------------------------------------------------------------------


def test_frames_compared_and_shown() -> None:
    options = Comparison(frames=17, reference_every=4)
    assert options.compared == [3, 7, 11, 15], "frame 0 is the same under all policies"
    assert options.shown == [3, 7, 11, 15]
    chosen = Comparison(frames=17, reference_every=8, key_frames=(9, 3, 9))
    assert chosen.shown == [3, 9]
    assert chosen.compared == [3, 7, 9, 15]
    assert Comparison(frames=1).shown == Comparison(frames=1).compared == [0]
    assert Comparison(frames=3, reference_every=2).shown == [1]


def test_baseline() -> None:
    assert Comparison().baseline == "round-robin"
    assert Comparison().full == "influence"
    assert Comparison(policies=("visibility", "influence")).baseline == "visibility"
    with pytest.raises(InputError, match="--policies influence,influence"):
        Comparison(policies=("influence", "influence"))


def test_parameters_have_value_range_and_meaning() -> None:
    rows = {row["name"]: row for row in parameters(Policy(sweep=7))}
    assert list(rows) == [field.name for field in fields(Policy)]
    assert all(row["meaning"] for row in rows.values())
    assert (rows["sweep"]["value"], rows["sweep"]["range"]) == (7, (0, 256))
    assert (rows["visibility"]["range"], rows["visibility"]["choices"]) == (None, None)
    assert rows["influence"]["choices"] == ("off", "volumes", "footprints")


def test_changed_parameters() -> None:
    before = POLICIES["influence"]
    (row,) = changed_parameters(replace(before, heavy_updates=2), before)
    assert (row["name"], row["before"], row["value"]) == ("heavy_updates", before.heavy_updates, 2)
    assert changed_parameters(before, before) == changed_parameters(before, None) == []


@pytest.mark.parametrize("quantity", QUANTITIES, ids=lambda quantity: quantity.name)
def test_legends_fit_their_scale(quantity: object) -> None:
    from lightloom.render.policy_pictures import Quantity

    assert isinstance(quantity, Quantity)
    colours = legend(quantity)
    assert len(set(colours)) == len(colours)
    if quantity.labels:
        assert len(colours) == len(quantity.labels) == quantity.high - quantity.low + 1


# --- the command ----------------------------------------------------------------------------------------------------


def test_policies(cli: Run, tmp_path: Path, room: Path) -> None:
    room.write_text(room.read_text() + BEHIND)
    outcome = cli("policies", room, *TINY, "--out", tmp_path / "a", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    assert report == json.loads((tmp_path / "a" / "policies.json").read_text())
    assert [policy["name"] for policy in report["policies"]] == list(POLICIES)
    assert report["reference"]["frames"] == [1, 3]
    assert report["key_frames"] == [1, 3]
    assert 0 < report["reference"]["noise"] < 0.2
    for policy in report["policies"]:
        rows = policy["frames"]
        assert [row["frame"] for row in rows] == [0, 1, 2, 3]
        assert ["error" in row for row in rows] == [False, True, False, True]
        assert all(0 < row["spent"] <= 1000 and row["spent"] == sum(row["rays"].values()) for row in rows)
        assert all(0 < row["error"] < 1 for row in rows if "error" in row)
        assert all(0 < row["counted"] <= 1 for row in rows if "error" in row)
        assert policy["summary"]["within_budget"]
        assert 0 < policy["summary"]["machine_seconds"] < 0.1
        assert 0 <= rows[3]["flip"] < 1
        assert ["darkened" in row for row in rows] == [False, True, False, True]
        assert 0.5 < policy["summary"]["greatest_share"] <= 1
        assert policy["summary"]["lags"] == 0
    first, *others = report["policies"]
    assert first["summary"]["error_ratio"] == 1
    assert all(other["changes"] for other in others)
    # Nobody sees the wall behind the camera.
    assert others[0]["summary"]["on_visible"] > first["summary"]["on_visible"]
    written = files_below(tmp_path / "a")
    assert {"index.html", "policies.json", "film.webp", "timeline.svg", "frames/0003/reference.png"} <= written
    assert {f"frames/0003/{name}{end}.png" for name in POLICIES for end in ("", "-error")} <= written
    assert {f"maps/0003/{quantity.name}{end}.png" for quantity in QUANTITIES for end in ("", "-maps")} <= written
    page = (tmp_path / "a" / "index.html").read_text(encoding="utf-8")
    assert "data:image/webp;base64," in page


def test_same_options_same_figures(cli: Run, tmp_path: Path, room: Path) -> None:
    room.write_text(room.read_text() + "[render]\nframes = 2\nsize = [24, 16]\nbudget = 700\n")
    found = []
    for name in ("a", "b"):
        # What is not said here the scene says.
        command = ["policies", room, "--policies", "visibility", "--key-frames", "1", "--reference-rays", 8]
        outcome = cli(*command, "--out", tmp_path / name, "--json")
        assert outcome.code == 0, outcome
        report = json.loads(outcome.out)
        assert report["baseline"] == report["full"] == "visibility"
        assert report["reference"]["frames"] == [1]
        options = report["options"]
        assert [options[key] for key in ("frames", "width", "height", "budget")] == [2, 24, 16, 700]
        found.append([[row[key] for key in ("spent", "age")] for row in report["policies"][0]["frames"]])
        found[-1].append([report["policies"][0]["frames"][1]["error"]])
    assert found[0] == found[1]
    again = cli(*report["command"].split()[1:], "--out", tmp_path / "c", "--json")
    assert again.code == 0, again
    assert json.loads(again.out)["policies"][0]["summary"]["error"] == report["policies"][0]["summary"]["error"]


def test_a_picture_of_nothing_but_a_lamp_has_no_figures(cli: Run, tmp_path: Path) -> None:
    path = tmp_path / "lamp.toml"
    path.write_text(ROOM.replace("[[quad]]", WINDOW + "[[quad]]", 1))
    command = ["policies", path, "--frames", 2, "--size", "12x8", "--budget", 500, "--reference-rays", 8]
    outcome = cli(*command, "--policies", "visibility", "--out", tmp_path / "out", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    row = report["policies"][0]["frames"][1]
    assert [row[name] for name in ("counted", "error", "relative_mse", "flip")] == [0, None, None, None]
    assert report["few_counted"].startswith("frame 1: errors are those of 0 %")
    assert outcome.err.splitlines()[-1] == f"warning: {report['few_counted']}"
    assert report["few_counted"] in (tmp_path / "out" / "index.html").read_text(encoding="utf-8")


def test_frames_that_hardly_count_are_named() -> None:
    rows: list[dict[str, Any]] = [{"frame": 0}, {"frame": 1, "counted": 0.5}, {"frame": 2}]
    assert few_counted(rows) is None
    assert (few_counted([*rows, {"frame": 3, "counted": 0.104}]) or "").startswith("frame 3: errors are those of 10 %")
    rows += [{"frame": 3, "counted": 0.0}, {"frame": 5, "counted": 0.25}]
    assert (few_counted(rows) or "").startswith("frames 3, 5: errors are those of 0 to 25 %")


def test_walls_that_glow_faintly_count(cli: Run, tmp_path: Path, room: Path) -> None:
    found = []
    for glow in (0, 1e-4, 0.05):
        path = tmp_path / "wall.toml"
        path.write_text(room.read_text().replace('name = "wall"', f'name = "wall"\nemission = [{glow}, 0, 0]'))
        command = ["policies", path, *TINY, "--frames", 2, "--policies", "visibility"]
        outcome = cli(*command, "--out", tmp_path / "out", "--json")
        assert outcome.code == 0, outcome
        report = json.loads(outcome.out)
        assert report["few_counted"] is None
        found.append(report["policies"][0]["frames"][1])
    dark, *glowing = found
    for row in glowing:
        assert row["counted"] == pytest.approx(dark["counted"], abs=0.1)
        assert row["error"] == pytest.approx(dark["error"], rel=0.2), "as the walls' own light does not count"


def test_bad_input(cli: Run, tmp_path: Path, room: Path) -> None:
    out = ("--out", tmp_path / "out")
    cli("policies", room, "--policies", "round-robin,vizibility", *out).refused("vizibility", "visibility")
    cli("policies", room, "--policies", "influence,influence", *out).refused("--policies", "once")
    cli("policies", room, "--reference-every", 0, *out).refused("--reference-every")
    cli("policies", room, "--key-frames", "3,x", *out).refused("--key-frames 3,x")
    cli("policies", room, "--frames", 4, "--key-frames", "4", *out).refused("--key-frames 4", "0 to 3")
    cli("policies", room, "--reference-rays", 100, *out).refused("--reference-rays 100")
    cli("policies", room, "--budget", 3, *out).refused("--budget 3")
    assert not (tmp_path / "out").exists()

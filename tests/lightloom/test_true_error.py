"""E true: where it is taken, what it is, and that a path-traced picture is made once."""

import json
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.renderer import Renderer
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.pose import scene_at
from lightloom.golden_model.scene.scene import Scene
from lightloom.golden_model.stimuli.layouts.catalogue import write_layout
from lightloom.policies.true_error import STILL, resting_frame, true_figures, true_pictures

from .conftest import LAMP, ROOM, Run


def test_the_frame_at_rest(tmp_path: Path) -> None:
    """The dimmer's lamp holds its last level from frame 29 on; it is the first of 60 frames."""
    dimmer = load_scene(write_layout("dimmer", 0, tmp_path))
    assert resting_frame(dimmer, 48) == 29 + STILL - 1
    assert resting_frame(dimmer, 88) == resting_frame(dimmer, 89) == 88
    assert resting_frame(dimmer, 100) == 99
    assert resting_frame(load_scene(write_layout("corridor", 0, tmp_path)), 10) == STILL - 1


def test_a_scene_that_is_never_at_rest_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "loop.toml"
    turning = LAMP + "loop = 9\npath = [{frame = 0, emission = 1.0}, {frame = 5, emission = 0.5}, {frame = 9}]\n"
    path.write_text(ROOM + turning)
    with pytest.raises(InputError, match="--true: the scene is not still for 60 frames"):
        resting_frame(load_scene(path), 8)


def test_figures_are_of_blocks() -> None:
    """Noise that blocks even out is no error; what differs between the two pictures is the reference's own noise."""
    pictures = np.ones((2, 16, 16, 3), dtype=np.float32)
    pictures[0, :8], pictures[1, :8] = 1.1, 0.9
    straight = np.zeros((16, 16, 3), dtype=np.float32)
    straight[0, 0] = 3  # more than half: does not count
    image = np.ones((16, 16, 3), dtype=np.float32)
    image[:, ::2] += 0.5
    image[:, 1::2] -= 0.5
    image[8:, 8:] += 0.2
    image[0, 0] = 77
    found = true_figures(image, straight, pictures)
    lit = 255  # pixels
    # The pixel that does not count was one of those that are too bright: its block is 0.5 too dark for it.
    assert found["true_error"] == pytest.approx((64 * 0.2 + 0.5) / lit, rel=1e-5)
    assert found["true_energy"] == pytest.approx(1 + (64 * 0.2 - 0.5) / lit, rel=1e-5)
    assert found["true_noise"] == pytest.approx(0.2 * 127 / (2 * lit), rel=1e-5)
    assert set(true_figures(image, straight, 0 * pictures).values()) == {None}


def test_a_picture_is_made_once(tmp_path: Path) -> None:
    room = tmp_path / "room.toml"
    room.write_text(ROOM + LAMP)
    scene = load_scene(room)

    def made(scene: Scene, samples: int) -> np.ndarray:
        gbuffer = Renderer(scene, width=12, height=8, budget=500).frame().gbuffer
        return true_pictures(scene_at(scene, 0), gbuffer, samples, "numpy", told.append, tmp_path / "kept")

    told: list[float] = []
    first = made(scene, 4)
    assert first.shape == (2, 8, 12, 3)
    assert (first[0] != first[1]).any(), "two seeds"
    assert sum(told) == pytest.approx(1)
    (file,) = (tmp_path / "kept" / "true").glob("*.npy")
    written = file.stat().st_mtime_ns
    np.testing.assert_array_equal(made(scene, 4), first)
    assert sum(told) == pytest.approx(1)
    assert file.stat().st_mtime_ns == written
    made(scene, 8)
    room.write_text(room.read_text().replace("emission = [", "emission = [1", 1))
    made(load_scene(room), 4)
    assert len(list((tmp_path / "kept" / "true").glob("*.npy"))) == 3


@pytest.mark.parametrize("emission", ["[5, 5, 5]", "[5e6, 5e6, 5e6]"])
def test_the_command(cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, emission: str) -> None:
    """Whatever the unit in which the frame loop holds light."""
    monkeypatch.setenv("LIGHTLOOM_CACHE", str(tmp_path / "kept"))
    room = tmp_path / "room.toml"
    room.write_text(ROOM + LAMP.replace("[5, 5, 5]", emission))
    small = ["--frames", 2, "--size", "24x16", "--budget", 900, "--reference-rays", 8]
    command = ["policies", room, "--policies", "visibility", *small, "--true", "--true-samples"]
    outcome = cli(*command, 64, "--out", tmp_path / "out", "--json")
    assert outcome.code == 0, outcome
    report = json.loads(outcome.out)
    assert report["reference"]["true_frame"] == 8 + STILL - 1, "as the camera moves up to frame 8"
    assert report["command"].endswith("--true-samples 64 --true")
    summary = report["policies"][0]["summary"]
    assert 0 < summary["true_noise"] < summary["true_error"] < 0.5
    assert 0.7 < summary["true_energy"] < 1.3
    cli(*command, 63, "--out", tmp_path / "odd").refused("--true-samples 63: must be even")
    assert not (tmp_path / "odd").exists()

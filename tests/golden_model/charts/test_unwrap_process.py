"""Charts of meshes on which the unwrapper crashes, hangs or finds nothing; its process, and what is left of it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lightloom.golden_model.charts import unwrap_process
from lightloom.golden_model.charts.curved import FEWEST_TRIANGLES, default_cache, mesh_charts
from lightloom.golden_model.charts.planar import GAP, ObjectCharts
from lightloom.golden_model.charts.unwrap import object_charts, unwrap
from lightloom.golden_model.charts.unwrap_process import KilledError, Unwrapper
from lightloom.golden_model.host.errors import InputError
from lightloom.golden_model.scene.files.load import load_scene
from lightloom.golden_model.scene.mesh import area_vectors
from lightloom.golden_model.scene.shapes import icosphere
from tests import ROOT

FAILING = {
    "crashes": "os.kill(os.getpid(), signal.SIGSEGV)",
    "hangs": "time.sleep(600)",
    "finds nothing": "return {**unwrap(points, faces, padding), 'chart': np.full(len(faces), -1)}",
    "is lost": "return {**unwrap(points, faces, padding), 'uv': np.full((len(faces), 3, 2), np.nan)}",
    "refuses": "raise MemoryError",
}
"""What a program does with meshes that are too large for it."""


def program(folder: Path, failure: str, most: int) -> Path:
    """xatlas, but it fails on meshes of more than `most` triangles."""
    path = folder / "program.py"
    path.write_text(
        f"import os, signal, sys, time\nimport numpy as np\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from lightloom.golden_model.charts import unwrap_process\nunwrap = unwrap_process.unwrap\n"
        f"def fails(points, faces, padding):\n    if len(faces) > {most}:\n        {FAILING[failure]}\n"
        "    return unwrap(points, faces, padding)\n"
        "unwrap_process.unwrap = fails\nunwrap_process.main()\n"
    )
    return path


def ball(level: int) -> np.ndarray:
    return icosphere(level).astype(np.float32)


def check(charts: ObjectCharts, corners: np.ndarray, texel_size: float) -> None:
    """Every triangle lies in the map, turned as on the surface and of about its size; charts keep their distance."""
    assert (charts.chart >= 0).all()
    assert (charts.uv >= 0).all()
    assert (charts.uv <= [charts.width, charts.height]).all()
    edge = charts.uv[:, 1:].astype(np.float64) - charts.uv[:, :1]
    flat = edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]
    area = np.sqrt((area_vectors(corners) ** 2).sum(axis=1)) / texel_size**2
    assert 0.5 < np.abs(flat).sum() / area.sum() < 1.5
    boxes = np.array(
        [
            (charts.uv[charts.chart == k].min(axis=(0, 1)), charts.uv[charts.chart == k].max(axis=(0, 1)))
            for k in range(int(charts.chart.max()) + 1)
        ]
    )
    for k, (low, high) in enumerate(boxes):
        apart = np.maximum(boxes[:, 0] - high, low - boxes[:, 1]).max(axis=1)
        assert (np.delete(apart, k) >= GAP - 1).all(), k


def test_a_sphere_that_xatlas_makes_one_closed_chart_of() -> None:
    """81,920 triangles in one chart without a border: its search for the border of that chart reads address 0."""
    corners = ball(6)
    with Unwrapper() as process:
        points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        assert process.charts(points / np.float32(0.2), index.reshape(-1, 3).astype(np.uint32), GAP) is None
        charts = mesh_charts(corners, 0.2, unwrapper=process)
    check(charts, corners, 0.2)
    assert charts.chart.max() == 1, "two halves"


@pytest.mark.parametrize("failure", FAILING)
def test_what_fails_is_cut_into_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: str) -> None:
    if failure == "hangs":
        monkeypatch.setattr(unwrap_process, "SECONDS", 2.0)
        monkeypatch.setattr(unwrap_process, "SECONDS_A_TRIANGLE", 0.0)
    corners, half = ball(3), 20 * 4**3 // 2
    whole = mesh_charts(corners, 0.1)
    with Unwrapper(program(tmp_path, failure, most=half)) as process:
        first, again = (mesh_charts(corners, 0.1, unwrapper=process) for _ in range(2))
        small = mesh_charts(ball(2), 0.1, unwrapper=process)
    check(first, corners, 0.1)
    assert first.uv.tobytes() == again.uv.tobytes(), "the same pieces again"
    assert first.chart.tobytes() == again.chart.tobytes()
    assert first.uv.tobytes() != whole.uv.tobytes()
    assert small.uv.tobytes() == mesh_charts(ball(2), 0.1).uv.tobytes(), "one that does not fail is left whole"


def test_pieces_that_fail_to_the_last_get_flat_charts(tmp_path: Path) -> None:
    corners = ball(3)
    with Unwrapper(program(tmp_path, "finds nothing", most=0)) as process:
        charts = mesh_charts(corners, 0.02, unwrapper=process)
    assert len(corners) > FEWEST_TRIANGLES
    check(charts, corners, 0.02)


def test_a_process_for_all_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[int] = []

    def start(*arguments: object, **options: object) -> "subprocess.Popen[bytes]":
        child = popen(*arguments, **options)  # type: ignore[call-overload]
        started.append(child.pid)
        return child

    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", start)
    with Unwrapper() as process:
        assert not started, "flat and kept charts need none"
        for level in (2, 3, 3):
            assert object_charts(ball(level), 0.3, unwrapper=process) is not None
        assert len(started) == 1
    assert not Path(f"/proc/{started[0]}").exists()


def test_an_answer_that_was_not_waited_for_is_no_other_meshs(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(stream: object) -> None:
        raise KeyboardInterrupt

    with Unwrapper() as process:
        mesh_charts(ball(1), 0.1, unwrapper=process)
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(unwrap_process, "_receive", interrupted)
            mesh_charts(ball(2), 0.1, unwrapper=process)
        after = mesh_charts(ball(3), 0.1, unwrapper=process)
    assert after.uv.tobytes() == mesh_charts(ball(3), 0.1).uv.tobytes()


def test_a_process_that_does_not_start(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text("raise ImportError\n")
    with Unwrapper(tmp_path / "program.py") as process, pytest.raises(RuntimeError, match="does not start"):
        mesh_charts(ball(2), 0.1, unwrapper=process)


KILLED = {
    "SIGKILL": "os.kill(os.getpid(), signal.SIGKILL)",
    "SIGTERM": "os.kill(os.getpid(), signal.SIGTERM)",
    "exit": "os._exit(1)",
}
"""How a process ends that no fault of its mesh has ended."""


def killed(folder: Path, death: str, times: int) -> Path:
    """xatlas, but its process ends in another way, at the first `times` meshes."""
    path = program(folder, "refuses", most=0)
    note = folder / "deaths"
    path.write_text(
        path.read_text().replace(
            "raise MemoryError",
            f"with open({str(note)!r}, 'a+') as note:\n"
            f"            note.write('x')\n            note.seek(0)\n            deaths = len(note.read())\n"
            f"        if deaths <= {times}:\n            {KILLED[death]}",
        )
    )
    return path


@pytest.mark.parametrize("death", KILLED)
def test_a_process_killed_once_leaves_its_mesh_whole(tmp_path: Path, death: str) -> None:
    corners = ball(3)
    with Unwrapper(killed(tmp_path, death, times=1)) as process:
        charts = mesh_charts(corners, 0.1, unwrapper=process)
    assert charts.uv.tobytes() == mesh_charts(corners, 0.1).uv.tobytes()


@pytest.mark.parametrize("death", KILLED)
def test_of_a_process_killed_twice_nothing_is_kept(tmp_path: Path, death: str) -> None:
    corners, cache = ball(3), tmp_path / "cache"
    with Unwrapper(killed(tmp_path, death, times=2)) as process:
        with pytest.raises(KilledError):
            mesh_charts(corners, 0.1, cache, process)
        assert (tmp_path / "deaths").read_text() == "xx"
        assert not cache.exists()
        after = mesh_charts(corners, 0.1, cache, process)
    assert after.uv.tobytes() == mesh_charts(corners, 0.1).uv.tobytes()


def test_the_object_whose_process_is_killed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scene.toml"
    path.write_text("[[sphere]]\nname = 'moon'\ncenter = [0, 0, 0]\nradius = 1\n")
    child = killed(tmp_path, "SIGKILL", times=2)
    monkeypatch.setattr("lightloom.golden_model.charts.unwrap.Unwrapper", lambda: Unwrapper(child))
    with pytest.raises(InputError, match=r"scene.*: object 'moon': .* was killed, perhaps for want of memory"):
        unwrap(load_scene(path), 0.1, cache=tmp_path / "cache")
    assert not (tmp_path / "cache").exists()


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LIGHTLOOM_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", lambda user: dict[int, str]()[user])
    assert default_cache() is None
    monkeypatch.setenv("XDG_CACHE_HOME", "/kept")
    assert default_cache() == Path("/kept/lightloom")


def gone(process: str) -> bool:
    """Whether a process has ended; where nobody waits for orphans it stays in the list, as a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


@pytest.mark.parametrize("end_of_parent", ["SIGINT", "SIGTERM", "SIGHUP", "SIGKILL"])
def test_no_process_is_left_behind(tmp_path: Path, end_of_parent: str) -> None:
    child = program(tmp_path, "hangs", most=0)
    child.write_text(
        child.read_text().replace(
            "time.sleep", f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()));time.sleep"
        )
    )
    caller = (
        "import signal\n"
        "from pathlib import Path\n"
        "from lightloom.golden_model.charts.curved import mesh_charts\n"
        "from lightloom.golden_model.scene.shapes import icosphere\n"
        "from lightloom.golden_model.charts.unwrap_process import Unwrapper\n"
        # Who runs the tests in the background has it ignored, which children inherit.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"with Unwrapper(Path({str(child)!r})) as process:\n"
        "    mesh_charts(icosphere(3).astype('float32'), 0.1, unwrapper=process)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    parent = subprocess.Popen([sys.executable, "-c", caller], env=environment, stderr=subprocess.DEVNULL)
    noted = tmp_path / "pid"
    end = time.monotonic() + 300
    while not (noted.exists() and noted.read_text()) and time.monotonic() < end:
        time.sleep(0.02)
    parent.send_signal(signal.Signals[end_of_parent])
    assert parent.wait(300) != 0
    end = time.monotonic() + 10
    while not gone(noted.read_text()) and time.monotonic() < end:
        time.sleep(0.02)
    assert gone(noted.read_text())

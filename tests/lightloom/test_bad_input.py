"""Bad input: one clear line, exit code 2, nothing half-written."""

import errno
import json
import resource
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from .conftest import PROGRAM, ROOM, Outcome, Run, files_below

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
RAYS: dict[str, np.ndarray] = {
    "origin": np.zeros((4, 3), dtype=np.float32),
    "direction": np.ones((4, 3), dtype=np.float32),
    "t_min": np.zeros(4, dtype=np.float32),
    "t_max": np.ones(4, dtype=np.float32),
}


def save(path: Path, **arrays: np.ndarray) -> Path:
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


def refused_everywhere(cli: Run, folder: Path, scene: object, *words: str) -> None:
    """Every command that takes a scene refuses it, and leaves nothing behind."""
    rays = save(folder / "rays.npz", **RAYS)
    points = save(folder / "points.npz", position=RAYS["origin"], normal=RAYS["direction"])
    before = files_below(folder)
    cli("trace", scene, "--rays", rays, "--out", folder / "a" / "hits.npz").refused(*words)
    cli("irradiance", scene, "--points", points, "--out", folder / "a" / "e.npz").refused(*words)
    cli("render", scene, "--frames", 1, "--size", "8x8", "--out", folder / "b" / "render").refused(*words)
    assert files_below(folder) == before


@pytest.mark.parametrize("name", ["none.obj", "none.ply", "none.glb", "none.gltf", "none.toml"])
def test_missing_scene(cli: Run, tmp_path: Path, name: str) -> None:
    refused_everywhere(cli, tmp_path, tmp_path / name, name, "no such file")


def test_unknown_scene(cli: Run, tmp_path: Path) -> None:
    refused_everywhere(cli, tmp_path, "cornel-box", "cornel-box", "cornell-box")


PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("cut.ply", PLY.encode() + b"0 0 0\n1 0"),
        ("header.ply", PLY.encode()[:60]),
        ("cut.glb", b"glTF\x02\x00\x00\x00\x00\x10\x00\x00" + b"\x40\x00\x00\x00JSON" + b'{"asset":{"ver'),
        ("cut.obj", b"v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n"),
        ("index.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 3\n"),
        ("cut.toml", b'[[quad]]\nname = "fl'),
        ("noise.obj", bytes(range(256))),
        ("empty.glb", b""),
        ("cut.gltf", b'{"asset": {"version": "2.0"'),
    ],
)
def test_truncated_scene(cli: Run, tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    refused_everywhere(cli, tmp_path, path, name)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (TRIANGLE.replace("v 1 0 0", "v nan 0 0"), ("finite",)),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", ("triangles",)),
        (TRIANGLE.replace("v 0 1 0", "v 2 0 0"), ("area",)),
    ],
    ids=["NaN vertex", "no triangles", "zero-area triangle"],
)
def test_unusable_mesh(cli: Run, tmp_path: Path, content: str, words: tuple[str, ...]) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(content)
    refused_everywhere(cli, tmp_path, path, "mesh.obj", *words)


def test_what_a_mesh_needs_and_is_not_read(cli: Run, tmp_path: Path) -> None:
    path = tmp_path / "mesh.gltf"
    path.write_text('{"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}')
    refused_everywhere(cli, tmp_path, path, "mesh.gltf", "KHR_draco_mesh_compression")


def test_what_is_left_out_is_said_once(cli: Run, tmp_path: Path) -> None:
    """In a line on stderr, whatever the command; stdout stays what it is, and the code 0."""
    path = tmp_path / "mesh.obj"
    path.write_text(TRIANGLE + "f 1 2 2\n")
    scene = tmp_path / "scene.toml"
    scene.write_text(2 * "[[mesh]]\nfile = 'mesh.obj'\n")
    rays = save(tmp_path / "rays.npz", **RAYS)
    for name, number in ((path, "1 triangle"), (scene, "2 triangles")):
        done = cli("trace", name, "--rays", rays, "--out", tmp_path / "hits.npz", "--json")
        assert done.code == 0
        lines = [line for line in done.err.splitlines() if line.startswith("warning: ")]
        assert lines == [f"warning: {name}: {number} without area (first: triangle 1 of mesh) left out"]
        assert json.loads(done.out)


def test_no_light(cli: Run, tmp_path: Path) -> None:
    """Rays can be traced in the dark; nothing else can be done there."""
    path = tmp_path / "dark.toml"
    path.write_text(ROOM)
    rays = save(tmp_path / "rays.npz", **RAYS)
    points = save(tmp_path / "points.npz", position=RAYS["origin"], normal=RAYS["direction"])
    before = files_below(tmp_path)
    cli("render", path, "--out", tmp_path / "render").refused("no light")
    cli("irradiance", path, "--points", points, "--out", tmp_path / "e.npz").refused("no light")
    assert files_below(tmp_path) == before
    assert cli("trace", path, "--rays", rays, "--out", tmp_path / "hits.npz").code == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--budget", "0"], ["--budget 0"]),
        (["--budget", "-1"], ["--budget -1"]),
        (["--budget", "19"], ["--budget 19", "20 rays"]),
        (["--budget", "many"], ["--budget", "integer"]),
        (["--frames", "0"], ["--frames 0"]),
        (["--size", "320"], ["--size 320", "320x240"]),
        (["--size", "0x240"], ["--size 0x240"]),
        (["--size", "-3x5"], ["--size -3x5"]),
        (["--size", "99999x2"], ["--size 99999x2", "16384"]),
        (["--size", "9000x2", "--supersample", "2"], ["--size 9000x2", "8192"]),
        (["--supersample", "0"], ["--supersample 0"]),
        (["--directions", "20"], ["directions 20", "power of two"]),
        (["--light-samples", "0"], ["--light-samples 0: must be 1 to 4096"]),
        (["--directions", "4097"], ["--directions 4097: must be 1 to 4096"]),
        (["--exposure", "0"], ["--exposure 0"]),
        (["--exposure", "nan"], ["--exposure nan"]),
        (["--seed", "-1"], ["--seed -1"]),
        (["--backend", "nump"], ["nump", "numpy"]),
        (["--budgte", "5"], ["--budgte", "--budget"]),
    ],
    ids=" ".join,
)
def test_render_options(cli: Run, tmp_path: Path, room: Path, options: list[str], words: list[str]) -> None:
    before = files_below(tmp_path)
    cli("render", room, "--out", tmp_path / "new" / "render", *options).refused(*words)
    assert files_below(tmp_path) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["emit", "rey_triangle"], ["rey_triangle", "ray_triangle"]),
        (["emit", "ray_triangle", "--preset", "bas"], ["bas", "base"]),
        (["emit", "zzz", "--list"], ["zzz", "ray_triangle"]),
        (["package", "rey_triangle"], ["rey_triangle", "ray_triangle"]),
        (["package", "float_add", "--preset", "bas"], ["bas", "base"]),
        (["package", "float_add", "--bus", "apb"], ["bus 'apb'", "axi4-lite"]),
        (["package", "float_add", "--clock", "0"], ["--clock 0", "0.01 to 10000"]),
        (["layout", "flot_add", "--pdk-root", "."], ["flot_add", "float_add"]),
        (["bench", "traceing"], ["traceing", "tracing"]),
        (["bench", "--rays", "0"], ["--rays 0"]),
        (["bench", "frames", "emission", "--rays", "9"], ["--rays", "`tracing`"]),
        (["bench", "traversal", "--vectors", "9"], ["--vectors", "`ray-triangle`"]),
        (["demo", "--frames", "0"], ["--frames 0"]),
        (["demo", "--budget", "71"], ["--budget 71", "72 rays"]),
        (["demo", "--replay-limit", "0"], ["--replay-limit 0"]),
        (["trace", "cornell-box"], ["--rays"]),
        (["rendre", "cornell-box"], ["rendre", "render"]),
        (["render"], ["SCENE"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_other_options(
    cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("lightloom.gen.emit.verilog_of", lambda unit, config: f"// {unit}\n")
    monkeypatch.setattr("lightloom.sim.bulk.BulkUnit.__init__", lambda self, *_: None)
    cli(*arguments).refused(*words)
    assert files_below(tmp_path) == set()


def changed(**arrays: Any) -> dict[str, np.ndarray]:
    return {name: value for name, value in {**RAYS, **arrays}.items() if value is not None}


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        (changed(direction=None), ["'direction'", "missing"]),
        (changed(direction=np.ones((4, 2), dtype=np.float32)), ["'direction'", "(4, 2)", "(4, 3)"]),
        (changed(t_min=np.zeros(3, dtype=np.float32)), ["'t_min'", "(3,)", "(4,)"]),
        (changed(t_min=np.float32(0)), ["'t_min'", "()"]),
        (changed(origin=np.zeros((4, 3))), ["'origin'", "float64", "float32"]),
        (changed(t_max=np.array([None] * 4)), ["rays.npz"]),
    ],
    ids=["missing array", "wrong shape", "wrong length", "scalar", "wrong type", "objects"],
)
def test_rays_file(cli: Run, tmp_path: Path, arrays: dict[str, np.ndarray], words: list[str]) -> None:
    rays = save(tmp_path / "rays.npz", **arrays)
    before = files_below(tmp_path)
    cli("trace", "cornell-box", "--rays", rays, "--out", tmp_path / "hits.npz").refused("--rays", "rays.npz", *words)
    assert files_below(tmp_path) == before


def test_rays_file_that_is_none(cli: Run, tmp_path: Path) -> None:
    good = save(tmp_path / "good.npz", **RAYS).read_bytes()
    single = tmp_path / "single.npy"
    np.save(single, RAYS["origin"])
    broken = bytearray(good)
    broken[150] ^= 0xFF  # in the first array's data: the checksum does not fit
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("origin.npy", "no array")
    cases = {"words.npz": b"no archive", "cut.npz": good[:200], "empty.npz": b"", "broken.npz": bytes(broken)}
    for name, content in cases.items():
        (tmp_path / name).write_bytes(content)
    before = files_below(tmp_path)
    for name in [*cases, "other.npz", "single.npy"]:
        cli("trace", "cornell-box", "--rays", tmp_path / name, "--out", tmp_path / "hits.npz").refused("--rays", name)
    cli("trace", "cornell-box", "--rays", tmp_path, "--out", tmp_path / "hits.npz").refused("--rays", tmp_path.name)
    cli("trace", "cornell-box", "--rays", "nix.npz", "--out", tmp_path / "h.npz").refused("nix.npz", "no such file")
    assert files_below(tmp_path) == before


def test_points_without_normal(cli: Run, tmp_path: Path) -> None:
    normal = RAYS["direction"].copy()
    normal[2] = 0
    points = save(tmp_path / "points.npz", position=RAYS["origin"], normal=normal)
    cli("irradiance", "cornell-box", "--points", points, "--out", tmp_path / "e.npz").refused("point 2", "normal")
    assert not (tmp_path / "e.npz").exists()


def test_places_that_cannot_be_written(cli: Run, tmp_path: Path, room: Path) -> None:
    rays = save(tmp_path / "rays.npz", **RAYS)
    (tmp_path / "file").write_text("mine")
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "thesis.txt").write_text("mine")
    before = files_below(tmp_path)
    cli("trace", room, "--rays", rays, "--out", tmp_path / "file" / "hits.npz").refused("hits.npz", "--out")
    cli("trace", room, "--rays", rays, "--out", foreign).refused("foreign", "--out")
    cli("trace", room, "--rays", rays, "--out", "/proc/none/hits.npz").refused("hits.npz", "--out")
    for command in (["render", room], ["emit", "float_compare"], ["demo"]):
        cli(*command, "--out", foreign).refused("foreign", "did not write", "--out")
        cli(*command, "--out", tmp_path / "file").refused("file", "is a file")
        cli(*command, "--out", "/proc/none/out").refused("/proc/none/out", "--out")
    assert files_below(tmp_path) == before
    assert (foreign / "thesis.txt").read_text() == "mine"


def limited(*arguments: object, bytes_a_file: int, folder: Path) -> Outcome:
    """Runs a command that may not write files longer than that, which fails like a disk that is full."""
    command = [str(PROGRAM), *(str(argument) for argument in arguments)]
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_a_file, bytes_a_file)),
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize(
    ("options", "limit", "words"),
    [
        (["--size", "64x64"], 200, ["out/frames/0000.png"]),
        (["--size", "4x4"], 500, ["out/lightmap/0000.exr"]),
    ],
    ids=["png", "exr"],
)
def test_full_disk_for_a_folder(tmp_path: Path, room: Path, options: list[str], limit: int, words: list[str]) -> None:
    before = files_below(tmp_path)
    command = ["render", room, "--frames", 1, "--budget", 400, "--backend", "numpy", "--out", "out", *options]
    limited(*command, bytes_a_file=limit, folder=tmp_path).refused(*words, "cannot be written", "large")
    assert files_below(tmp_path) == before


def test_full_disk_for_a_file(tmp_path: Path, room: Path) -> None:
    rays = save(tmp_path / "rays.npz", **{name: np.repeat(value, 100, axis=0) for name, value in RAYS.items()})
    before = files_below(tmp_path)
    command = ["trace", room, "--rays", rays, "--out", "hits.npz"]
    limited(*command, bytes_a_file=1000, folder=tmp_path).refused("hits.npz", "cannot be written", "--out")
    assert files_below(tmp_path) == before


def test_full_disk_for_verilog(cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_text", full)
    cli("emit", "float_compare", "--out", tmp_path / "out").refused("out", "No space left on device", "--out")
    assert files_below(tmp_path) == set()


def test_full_stdout(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:  # noqa: PTH123 (a device)
        done = subprocess.run(
            [str(PROGRAM), "emit", "--list", "--json"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert "No space left on device" in done.stderr.splitlines()[0]

"""A program in C traces rays through the traversal unit's registers, on Verilator: the golden results, in all bits."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from lightloom.gen.manifest import manifest
from lightloom.gen.package.files import render
from lightloom.gen.package.formats import context
from lightloom.gen.package.registers import register_files
from lightloom.gen.package.traversal_bench import Scene, scene
from lightloom.golden_model.contract import bitpack
from lightloom.golden_model.contract.formats import LOAD_ERRORS, RAY_RESULT
from lightloom.rtl.config import Config
from lightloom.sim.register_bus import HERE, WARNINGS, compiled
from lightloom.sim.run_traversal_bench import SMALL
from tests import ROOT
from tests.simulators import needs_gcc

PROGRAM = ROOT / "examples" / "registers" / "trace.c"
ABORTS = Path(__file__).with_name("aborts.c")


@pytest.fixture(scope="module")
def headers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return headers_of(SMALL, tmp_path_factory.mktemp("include"))


def headers_of(config: Config, folder: Path) -> Path:
    """PeakRDL's header of the registers, and ours of the formats, as packages have them, in a folder; the folder."""
    described = manifest("traversal", config, bus="axi4-lite")
    name = f"{described['module']}.h"
    (folder / name).write_bytes(register_files(described, "0.1")[name])
    (folder / "lightloom_formats.h").write_text(render("package_formats.h", **context()))
    return folder


@pytest.fixture(scope="module")
def traced() -> Scene:
    return scene(SMALL)


def run(program: Path, traced: Scene, folder: Path, *, base: int, seed: int) -> subprocess.CompletedProcess[str]:
    """Runs the compiled program on the scene's rays; its results are in `folder`."""
    (folder / "image.bin").write_bytes(traced.image)
    bitpack.pack(traced.operands).tofile(folder / "queries.bin")
    arguments = ["image.bin", str(base), "queries.bin", "results.bin", str(len(traced.operands)), str(seed)]
    return subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True)


@needs_gcc
@pytest.mark.parametrize("seed", [0, 4711])
def test_rays_through_registers_only(headers: Path, traced: Scene, tmp_path: Path, seed: int) -> None:
    program = compiled(PROGRAM, "traversal", SMALL, includes=[headers])
    check_rays(program, traced, tmp_path, seed)


@needs_gcc
@pytest.mark.long
def test_rays_through_registers_at_addresses_of_32_bits(traced: Scene, tmp_path: Path) -> None:
    config = SMALL.but(address_width=32)
    program = compiled(PROGRAM, "traversal", config, includes=[headers_of(config, tmp_path)])
    check_rays(program, traced, tmp_path, seed=32)
    beyond = run(program, traced, tmp_path, base=1 << 32, seed=0)
    assert (beyond.returncode, beyond.stderr) == (1, "no address of the memory: 0x100000000\n")


@needs_gcc
@pytest.mark.parametrize("address_width", [32, 33, 64])
def test_the_example_compiles_at_addresses_of_every_width(address_width: int, tmp_path: Path) -> None:
    """One register of the tree's address, or two."""
    config = SMALL.but(address_width=address_width)
    includes = [f"-I{folder}" for folder in (HERE, headers_of(config, tmp_path))]
    command = ["gcc", "-std=gnu11", *WARNINGS, *includes, "-c", str(PROGRAM), "-o", str(tmp_path / "trace.o")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def check_rays(program: Path, traced: Scene, tmp_path: Path, seed: int) -> None:
    """The program traces the scene's rays: the golden results, and as many as there are."""
    done = run(program, traced, tmp_path, base=traced.base, seed=seed)
    assert done.returncode == 0, f"seed {seed}: {done.stderr}"
    packed = np.fromfile(tmp_path / "results.bin", dtype=np.uint32).reshape(-1, bitpack.words(RAY_RESULT))
    results = bitpack.unpack(packed, RAY_RESULT)
    wrong = np.flatnonzero(~bitpack.equal(results, traced.results))
    assert len(results) == len(traced.operands) > 50
    assert not len(wrong), (
        f"seed {seed}: ray {wrong[0]}, {traced.operands[wrong[0]]}: {results[wrong[0]]}, not {traced.results[wrong[0]]}"
    )
    assert 0 < (traced.results["primitive"] >= 0).sum() < len(results)  # hits and misses
    figures = dict(line.split() for line in done.stdout.splitlines())
    assert int(figures["rays"]) == len(results)
    assert int(figures["beats"]) > 0


@needs_gcc
def test_a_tree_that_is_none_is_refused(headers: Path, traced: Scene, tmp_path: Path) -> None:
    program = compiled(PROGRAM, "traversal", SMALL, includes=[headers])
    done = run(program, traced, tmp_path, base=traced.base + 4, seed=1)
    assert done.returncode == 1
    assert done.stderr == f"no tree: load_error {LOAD_ERRORS['base']}\n"


@needs_gcc
@pytest.mark.parametrize("seed", [0, 31])
def test_an_abort_forgets_what_waits_in_registers(headers: Path, traced: Scene, tmp_path: Path, seed: int) -> None:
    program = compiled(ABORTS, "traversal", SMALL, includes=[headers])
    (tmp_path / "image.bin").write_bytes(traced.image)
    bitpack.pack(traced.operands).tofile(tmp_path / "queries.bin")
    arguments = ["image.bin", str(traced.base), "queries.bin", str(len(traced.operands)), str(seed)]
    done = subprocess.run([program, *arguments], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, f"seed {seed}: {done.stderr}"
    first = traced.results[:1]
    wanted = [int(first[name].view(np.uint32)[0]) for name in ("primitive", "t")]
    assert [int(word, 16) for word in done.stdout.split()] == wanted


@needs_gcc
def test_warnings_are_errors(headers: Path, tmp_path: Path) -> None:
    (tmp_path / "program.c").write_text(PROGRAM.read_text().replace("size_t count;", "size_t count; int unused;", 1))
    with pytest.raises(subprocess.CalledProcessError) as failed:
        compiled(tmp_path / "program.c", "traversal", SMALL, includes=[headers])
    assert "unused" in failed.value.stderr

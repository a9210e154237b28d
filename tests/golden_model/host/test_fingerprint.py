"""Results kept on disk are made anew after a change of anything that they depend on, and of nothing else."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lightloom.golden_model.host.fingerprint import fingerprint, sources
from tests import ROOT
from tests.needs import needs_numba

KEEPERS = [
    pytest.param("lightloom.golden_model.tracing.bvh.traversal_numba", marks=needs_numba),
    pytest.param("lightloom.golden_model.tracing.wide_bvh.traversal_numba", marks=needs_numba),
    "lightloom.gen.verilog",
    "lightloom.gen.flow.synthesis",
]
"""Modules whose results are kept."""


def run(program: str, *arguments: str, root: Path = ROOT, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=root,
        env={**os.environ, "PYTHONPATH": str(root), **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def loaded_with(module: str) -> set[str]:
    """The modules of ours that Python has loaded when it has imported `module`."""
    program = "import importlib, json, sys; importlib.import_module(sys.argv[1]); print(json.dumps(list(sys.modules)))"
    return {name for name in json.loads(run(program, module)) if name.split(".")[0] == "lightloom"}


@pytest.mark.parametrize("module", KEEPERS)
def test_a_change_of_what_is_imported_makes_a_new_fingerprint_and_no_other_does(module: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "lightloom", tmp_path / "lightloom", ignore=shutil.ignore_patterns("__pycache__"))
    drawn_on = loaded_with(module)
    files = {name: tmp_path / path.relative_to(ROOT) for name, path in sources(module).items()}
    assert set(files) == drawn_on
    others = set(tmp_path.rglob("*.py")) - set(files.values())
    assert len(others) > 50

    known = {fingerprint(module, tmp_path)}
    for path in files.values():
        path.write_text(path.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
        fingerprint.cache_clear()
        known.add(fingerprint(module, tmp_path))
    assert len(known) == 1 + len(files)
    for path in others:
        path.write_text("changed = True\n", encoding="utf-8")
    fingerprint.cache_clear()
    assert fingerprint(module, tmp_path) in known


FILES = {
    "__init__": "",
    "a": "def late():\n    from lightloom.inner import b\n",
    "inner/__init__": "import lightloom.c as other\n",
    "inner/b": "import numpy as np\nfrom lightloom import inner, d\nfrom lightloom.a import late\n",
    "c": "text = 'import lightloom.e'\n",
    "d": "from lightloom.f import value\n",
    "e": "",
    "f/__init__": "value = 1\n",
    "f/value": "",
}


def test_every_form_of_import_is_followed(tmp_path: Path) -> None:
    for name, text in FILES.items():
        path = tmp_path / "lightloom" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    found = {str(path.relative_to(tmp_path / "lightloom")) for path in sources("lightloom.a", tmp_path).values()}
    assert found == {f"{name}.py" for name in FILES} - {"e.py"}
    with pytest.raises(ModuleNotFoundError, match=r"lightloom\.g: no file of it in"):
        sources("lightloom.g", tmp_path)


TWIN = """
from lightloom.constants import STEP
from lightloom.golden_model.tracing.compiled import cached

@cached
def stepped(sources, x):
    return x + STEP
"""
CALL = "from lightloom.twin import stepped; print(stepped(1), sum(stepped.func.stats.cache_hits.values()))"


@needs_numba
def test_machine_code_is_made_anew_when_a_constant_of_another_file_changes(tmp_path: Path) -> None:
    for path in sources("lightloom.golden_model.tracing.compiled").values():
        copy = tmp_path / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    twin = tmp_path / "lightloom" / "twin.py"
    twin.write_text(TWIN, encoding="utf-8")

    def call(constants: str) -> list[str]:
        twin.with_name("constants.py").write_text(constants, encoding="utf-8")
        return run(CALL, root=tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "kept")).split()

    assert call("STEP = 1\n") == ["2", "0"]
    assert call("STEP = 5\n") == ["6", "0"]
    assert call("STEP = 1\n") == ["2", "1"]

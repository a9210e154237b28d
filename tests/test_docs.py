"""The examples in README.md and docs/ run."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT
from tests.imports import modules, own_imports

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLE = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
EXAMPLES = [
    pytest.param(example, id=f"{page.name}-{number}")
    for page in PAGES
    for number, example in enumerate(EXAMPLE.findall(page.read_text(encoding="utf-8")))
]


@pytest.mark.parametrize("example", EXAMPLES)
def test_python_example(example: str, tmp_path: Path) -> None:
    env = {**os.environ, "LIGHTLOOM_CACHE": str(ROOT / "build" / "sim")}
    run = [sys.executable, "-W", "error", "-c", example]
    done = subprocess.run(run, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", EXAMPLE.sub("", page.read_text(encoding="utf-8"))):
        if not target.startswith("https://"):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_exist(page: Path) -> None:
    rooms = "golden_model|rtl|gen|sim|verif|lightloom|tests|docs|scenes"
    named = set(re.findall(rf"`((?:{rooms})/[a-z0-9_/.-]+)(?:::\w+)?`", page.read_text(encoding="utf-8")))
    there = {name for name in named if (ROOT / name).exists() or (ROOT / f"{name}.py").exists()}
    assert sorted(named - there) == []


ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
WALKS = re.findall(r"^## (A .*|The same .*)\n((?:(?!^## ).*\n)+)", ARCHITECTURE, re.M)


@pytest.mark.parametrize(("name", "walk"), WALKS, ids=[name for name, _ in WALKS])
def test_a_walk_enters_no_folder_twice(name: str, walk: str) -> None:
    files = [Path(file) for file in re.findall(r"`(\w+/[\w/]+\.py)`", walk)]
    assert len(files) >= 4, name
    assert [str(file) for file in files if not (ROOT / file).exists()] == []
    folders = [files[0].parent]
    for file in files:
        if file.parent != folders[-1]:
            folders.append(file.parent)
    assert len(folders) == len(set(folders)), [str(folder) for folder in folders]


MODEL = "lightloom.golden_model"
BEGINNINGS = (
    *(f"{MODEL}.scene.files.load", f"{MODEL}.renderer"),
    *(f"{MODEL}.tracing.wide_bvh.memory_image", f"{MODEL}.tracing.wide_bvh.traversal"),
    *(f"{MODEL}.machine.schedule", f"{MODEL}.pictures.images", f"{MODEL}.pictures.texel_views"),
    *("lightloom.rtl.catalogue", "lightloom.rtl.buses", "lightloom.rtl.registers.front"),
)
"""Where a texel and a ray begin, in the model and in hardware: what is on their way is what these draw on."""
WHOLE = ("golden_model/numerics", "golden_model/contract", "golden_model/host", "rtl/operators")
"""Folders that the walks name as a whole: what every step draws on, and a file for each operation."""


def drawn_on(*beginnings: str) -> set[Path]:
    """The files that some modules import by any number of steps, and their own; from the checkout's folder."""
    found: set[str] = set()
    waiting = set(beginnings)
    while waiting:
        found |= waiting
        waiting = {used for name in waiting for used in own_imports(modules()[name])} - found
    return {modules()[name].relative_to(ROOT) for name in found}


def test_the_walks_name_every_file_on_the_way() -> None:
    text = "\n".join(walk for _, walk in WALKS)
    named = {Path(file) for file in re.findall(r"`(\w+/[\w/]+\.py)`", text)}
    emitted = {file for file in drawn_on("lightloom.gen.emit") if file.parts[0] == "gen"}
    on_the_way = {file for file in drawn_on(*BEGINNINGS) if str(file.parent) not in WHOLE} | emitted
    assert len(on_the_way) > 150
    assert [folder for folder in WHOLE if f"`{folder}/`" not in text] == []
    assert sorted(map(str, on_the_way - named)) == [], "on the way, but not in docs/architecture.md"
    assert sorted(str(file) for file in named - on_the_way if str(file.parent) not in WHOLE) == [], "on no way"
